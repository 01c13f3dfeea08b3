/* A library to be loaded before all others: it counts the calls that change files below one
   folder, and makes one of them fail. It lies between the program and the system's own library, so
   it sees every such call whatever code makes it.

   The journal of the calls lies in memory that a process shares with those it forks, so whoever
   armed the fault reads it when the process has ended. Where a folder is named for it, every file
   that is synced is copied there too, under the number of the call: that is what a disk still has
   when the power fails. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum kind { NONE, KILL, TORN, FULL, BROKEN, INTERRUPTED, SHORT };

#define MOST_CALLS 8192
#define MOST_FILES 256
#define LINE_SIZE 512

struct journal {
    long calls;
    char lines[MOST_CALLS][LINE_SIZE];
};

static struct journal *journal;
static char root[PATH_MAX], synced[PATH_MAX];
static int armed, kind, has_failed;
static long point;
static char opened_as[MOST_FILES][LINE_SIZE / 2]; /* paths below the root; empty: not there */

__attribute__((constructor)) static void begin(void)
{
    int protection = PROT_READ | PROT_WRITE, flags = MAP_SHARED | MAP_ANONYMOUS;
    journal = mmap(NULL, sizeof *journal, protection, flags, -1, 0);
    if (journal == MAP_FAILED)
        abort();
}

/* From now on count calls below `folder`; the one of number `at`, from 0, meets the fault. */
void faultpoints_arm(const char *folder, int fault, long at, const char *copies)
{
    strncpy(root, folder, sizeof root - 1);
    strncpy(synced, copies, sizeof synced - 1);
    kind = fault;
    point = at;
    has_failed = 0;
    journal->calls = 0;
    memset(opened_as, 0, sizeof opened_as);
    armed = 1;
}

long faultpoints_calls(void)
{
    return journal->calls < MOST_CALLS ? journal->calls : MOST_CALLS;
}

/* A call and the paths it names, with tabs between them. */
const char *faultpoints_line(long number)
{
    return journal->lines[number];
}

/* The path as seen from the root, or NULL where it does not lie below it. */
static const char *below(const char *path)
{
    size_t length = strlen(root);
    if (!armed || path == NULL)
        return NULL;
    if (path[0] != '/') /* the working folder is the root */
        return path;
    if (strncmp(path, root, length) != 0)
        return NULL;
    return path[length] == '/' ? path + length + 1 : path[length] == '\0' ? "." : NULL;
}

static const char *path_of(int file)
{
    return armed && file >= 0 && file < MOST_FILES && opened_as[file][0] ? opened_as[file] : NULL;
}

/* What a disk that is full refuses: that which takes room. */
static int takes_room(const char *call)
{
    return strcmp(call, "write") == 0 || strcmp(call, "open") == 0 || strcmp(call, "mkdir") == 0
           || strcmp(call, "link") == 0 || strcmp(call, "fsync") == 0;
}

/* Enter a call in the journal, and say whether it is to be made: 0, or -1 with errno set. */
static int pass(const char *call, const char *path, const char *target)
{
    long number = journal->calls++;
    if (number < MOST_CALLS)
        snprintf(journal->lines[number], LINE_SIZE, "%s\t%s%s%s", call, path, target ? "\t" : "",
                 target ? target : "");
    if (kind == FULL && has_failed && takes_room(call)) {
        errno = ENOSPC;
        return -1;
    }
    if (number != point)
        return 0;
    switch (kind) {
    case KILL:
        _exit(9);
    case FULL:
        if (!takes_room(call))
            return 0;
        has_failed = 1;
        errno = ENOSPC;
        return -1;
    case BROKEN:
        errno = EIO;
        return -1;
    case INTERRUPTED:
        errno = EINTR;
        return -1;
    }
    return 0;
}

/* What remains of a call that is torn: it has been made, half of it where it has halves. */
static void torn(void)
{
    if (armed && kind == TORN && journal->calls == point + 1)
        _exit(9);
}

static void *next(const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);
    if (found == NULL)
        abort();
    return found;
}

static int track(int file, const char *path)
{
    if (file >= 0 && file < MOST_FILES)
        snprintf(opened_as[file], sizeof opened_as[file], "%s", path ? path : "");
    return file;
}

static int opened(const char *name, int folder, const char *path, int flags, mode_t mode, int at)
{
    const char *place = below(path);
    int changes = place && (flags & (O_CREAT | O_TRUNC));
    int file;
    if (changes && pass("open", place, NULL) != 0)
        return -1;
    if (at)
        file = ((int (*)(int, const char *, int, mode_t))next(name))(folder, path, flags, mode);
    else
        file = ((int (*)(const char *, int, mode_t))next(name))(path, flags, mode);
    if (changes)
        torn();
    return track(file, place);
}

#define MODE(flags, last)                                                                          \
    mode_t mode = 0;                                                                               \
    if ((flags) & (O_CREAT | O_TMPFILE)) {                                                         \
        va_list rest;                                                                              \
        va_start(rest, last);                                                                      \
        mode = (mode_t)va_arg(rest, int);                                                          \
        va_end(rest);                                                                              \
    }

int open(const char *path, int flags, ...)
{
    MODE(flags, flags)
    return opened("open", -1, path, flags, mode, 0);
}

int open64(const char *path, int flags, ...)
{
    MODE(flags, flags)
    return opened("open64", -1, path, flags, mode, 0);
}

int openat(int folder, const char *path, int flags, ...)
{
    MODE(flags, flags)
    return opened("openat", folder, path, flags, mode, 1);
}

int openat64(int folder, const char *path, int flags, ...)
{
    MODE(flags, flags)
    return opened("openat64", folder, path, flags, mode, 1);
}

int close(int file)
{
    track(file, NULL);
    return ((int (*)(int))next("close"))(file);
}

ssize_t write(int file, const void *data, size_t size)
{
    ssize_t (*real)(int, const void *, size_t) = (ssize_t(*)(int, const void *, size_t))next("write");
    if (path_of(file)) {
        if (pass("write", path_of(file), NULL) != 0)
            return -1;
        if ((kind == TORN || kind == SHORT) && journal->calls == point + 1 && size > 1)
            size /= 2;
        ssize_t written = real(file, data, size);
        torn();
        return written;
    }
    return real(file, data, size);
}

#define POSITIONED(name, offset_type)                                                              \
    ssize_t name(int file, const void *data, size_t size, offset_type offset)                      \
    {                                                                                              \
        ssize_t (*real)(int, const void *, size_t, offset_type) =                                  \
            (ssize_t(*)(int, const void *, size_t, offset_type))next(#name);                       \
        if (path_of(file)) {                                                                       \
            if (pass("write", path_of(file), NULL) != 0)                                           \
                return -1;                                                                         \
            if ((kind == TORN || kind == SHORT) && journal->calls == point + 1 && size > 1)         \
                size /= 2;                                                                         \
            ssize_t written = real(file, data, size, offset);                                      \
            torn();                                                                                \
            return written;                                                                        \
        }                                                                                          \
        return real(file, data, size, offset);                                                     \
    }

POSITIONED(pwrite, off_t)
POSITIONED(pwrite64, off64_t)

/* Keep what a file holds, as the disk does from now on. */
static void keep(int file)
{
    char path[PATH_MAX + 32], data[65536];
    off_t offset = 0;
    ssize_t size;
    struct stat status;
    if (!synced[0] || fstat(file, &status) != 0 || !S_ISREG(status.st_mode))
        return;
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    int from = ((int (*)(const char *, int, mode_t))next("open"))(path, O_RDONLY, 0);
    snprintf(path, sizeof path, "%s/%ld", synced, journal->calls - 1);
    int to = ((int (*)(const char *, int, mode_t))next("open"))(path, O_WRONLY | O_CREAT, 0600);
    while ((size = pread(from, data, sizeof data, offset)) > 0) {
        if (((ssize_t(*)(int, const void *, size_t))next("write"))(to, data, (size_t)size) != size)
            abort();
        offset += size;
    }
    if (from < 0 || to < 0 || size != 0)
        abort();
    ((int (*)(int))next("close"))(from);
    ((int (*)(int))next("close"))(to);
}

#define ON_FILE(name, call, arguments, values, after)                                              \
    int name arguments                                                                             \
    {                                                                                              \
        const char *path = path_of(file);                                                          \
        if (path && pass(call, path, NULL) != 0)                                                   \
            return -1;                                                                             \
        int done = ((int(*) arguments)next(#name))values;                                          \
        if (path && done == 0) {                                                                   \
            after;                                                                                 \
            torn();                                                                                \
        }                                                                                          \
        return done;                                                                               \
    }

#define ON_PATH(name, call, arguments, values, path, target)                                       \
    int name arguments                                                                             \
    {                                                                                              \
        if (below(path)) {                                                                         \
            if (pass(call, below(path), below(target)) != 0)                                       \
                return -1;                                                                         \
            int done = ((int(*) arguments)next(#name))values;                                      \
            torn();                                                                                \
            return done;                                                                           \
        }                                                                                          \
        return ((int(*) arguments)next(#name))values;                                              \
    }

ON_FILE(fsync, "fsync", (int file), (file), keep(file))
ON_FILE(fdatasync, "fsync", (int file), (file), keep(file))
ON_FILE(ftruncate, "truncate", (int file, off_t size), (file, size), (void)0)
ON_FILE(ftruncate64, "truncate", (int file, off64_t size), (file, size), (void)0)
ON_FILE(fchmod, "chmod", (int file, mode_t mode), (file, mode), (void)0)
ON_PATH(rename, "rename", (const char *from, const char *to), (from, to), from, to)
ON_PATH(renameat, "rename", (int a, const char *from, int b, const char *to), (a, from, b, to),
        from, to)
ON_PATH(link, "link", (const char *from, const char *to), (from, to), from, to)
ON_PATH(linkat, "link", (int a, const char *from, int b, const char *to, int flags),
        (a, from, b, to, flags), from, to)
ON_PATH(symlink, "symlink", (const char *from, const char *to), (from, to), to, NULL)
ON_PATH(unlink, "unlink", (const char *path), (path), path, NULL)
ON_PATH(unlinkat, "unlink", (int folder, const char *path, int flags), (folder, path, flags), path,
        NULL)
ON_PATH(rmdir, "rmdir", (const char *path), (path), path, NULL)
ON_PATH(mkdir, "mkdir", (const char *path, mode_t mode), (path, mode), path, NULL)
ON_PATH(mkdirat, "mkdir", (int folder, const char *path, mode_t mode), (folder, path, mode), path,
        NULL)
