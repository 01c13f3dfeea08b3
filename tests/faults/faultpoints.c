/* A library to be loaded before all others: it counts the calls that change files below one
   folder, and makes one of them fail. It lies between the program and the system's own library, so
   it sees every such call whatever code makes it.

   The counter and the names of the calls lie in memory that a process shares with those it forks,
   so whoever armed the fault reads them when the process has ended. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum kind { NONE, KILL, TORN, FULL, BROKEN, INTERRUPTED, SHORT };

#define MOST_CALLS 8192
#define MOST_FILES 4096
#define NAME_SIZE 56

struct record {
    long calls;
    char names[MOST_CALLS][NAME_SIZE];
};

static struct record *record;
static char root[PATH_MAX];
static int armed, kind, has_failed;
static long point;
static unsigned char below_root[MOST_FILES];

__attribute__((constructor)) static void begin(void)
{
    record = mmap(NULL, sizeof *record, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (record == MAP_FAILED)
        abort();
}

/* From now on count calls below `folder`; the one of number `at`, from 0, meets the fault. */
void faultpoints_arm(const char *folder, int fault, long at)
{
    strncpy(root, folder, sizeof root - 1);
    kind = fault;
    point = at;
    has_failed = 0;
    record->calls = 0;
    memset(below_root, 0, sizeof below_root);
    armed = 1;
}

long faultpoints_calls(void)
{
    return record->calls;
}

const char *faultpoints_name(long number)
{
    return number >= 0 && number < MOST_CALLS ? record->names[number] : "";
}

static int is_below(const char *path)
{
    size_t length = strlen(root);
    if (!armed || path == NULL)
        return 0;
    if (path[0] != '/')  /* the working folder is the root */
        return 1;
    return strncmp(path, root, length) == 0 && (path[length] == '/' || path[length] == '\0');
}

static int is_tracked(int file)
{
    return armed && file >= 0 && file < MOST_FILES && below_root[file];
}

/* What a disk that is full refuses: that which takes room. */
static int takes_room(const char *call)
{
    return strcmp(call, "write") == 0 || strcmp(call, "open") == 0 || strcmp(call, "mkdir") == 0
           || strcmp(call, "link") == 0 || strcmp(call, "fsync") == 0;
}

static const char *last_part(const char *path)
{
    const char *slash = path ? strrchr(path, '/') : NULL;
    return slash ? slash + 1 : path ? path : "";
}

/* Count a call, and say whether it is to be made: 0, or -1 with errno set. */
static int pass(const char *call, const char *path)
{
    long number = record->calls++;
    if (number < MOST_CALLS) {
        char *name = record->names[number];
        size_t length = strlen(call);
        memset(name, 0, NAME_SIZE);
        memcpy(name, call, length);
        name[length] = ' ';
        strncpy(name + length + 1, last_part(path), NAME_SIZE - length - 2);
    }
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
    if (armed && kind == TORN && record->calls == point + 1)
        _exit(9);
}

static void *next(const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);
    if (found == NULL)
        abort();
    return found;
}

static int track(int file, int below)
{
    if (file >= 0 && file < MOST_FILES)
        below_root[file] = (unsigned char)below;
    return file;
}

static int opened(const char *name, int folder, const char *path, int flags, mode_t mode, int at)
{
    int below = is_below(path);
    int changes = below && (flags & (O_CREAT | O_TRUNC));
    int file;
    if (changes && pass("open", path) != 0)
        return -1;
    if (at)
        file = ((int (*)(int, const char *, int, mode_t))next(name))(folder, path, flags, mode);
    else
        file = ((int (*)(const char *, int, mode_t))next(name))(path, flags, mode);
    if (changes)
        torn();
    return track(file, below);
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
    track(file, 0);
    return ((int (*)(int))next("close"))(file);
}

ssize_t write(int file, const void *data, size_t size)
{
    ssize_t (*real)(int, const void *, size_t) = (ssize_t(*)(int, const void *, size_t))next("write");
    if (is_tracked(file)) {
        if (pass("write", NULL) != 0)
            return -1;
        if ((kind == TORN || kind == SHORT) && record->calls == point + 1 && size > 1)
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
        if (is_tracked(file)) {                                                                    \
            if (pass("write", NULL) != 0)                                                          \
                return -1;                                                                         \
            if ((kind == TORN || kind == SHORT) && record->calls == point + 1 && size > 1)         \
                size /= 2;                                                                         \
            ssize_t written = real(file, data, size, offset);                                      \
            torn();                                                                                \
            return written;                                                                        \
        }                                                                                          \
        return real(file, data, size, offset);                                                     \
    }

POSITIONED(pwrite, off_t)
POSITIONED(pwrite64, off64_t)

#define ON_FILE(name, call, arguments, values, condition)                                          \
    int name arguments                                                                             \
    {                                                                                              \
        if (condition) {                                                                           \
            if (pass(call, NULL) != 0)                                                             \
                return -1;                                                                         \
            int done = ((int(*) arguments)next(#name))values;                                      \
            torn();                                                                                \
            return done;                                                                           \
        }                                                                                          \
        return ((int(*) arguments)next(#name))values;                                              \
    }

#define ON_PATH(name, call, arguments, values, path)                                               \
    int name arguments                                                                             \
    {                                                                                              \
        if (is_below(path)) {                                                                      \
            if (pass(call, path) != 0)                                                             \
                return -1;                                                                         \
            int done = ((int(*) arguments)next(#name))values;                                      \
            torn();                                                                                \
            return done;                                                                           \
        }                                                                                          \
        return ((int(*) arguments)next(#name))values;                                              \
    }

ON_FILE(fsync, "fsync", (int file), (file), is_tracked(file))
ON_FILE(fdatasync, "fsync", (int file), (file), is_tracked(file))
ON_FILE(ftruncate, "truncate", (int file, off_t size), (file, size), is_tracked(file))
ON_FILE(ftruncate64, "truncate", (int file, off64_t size), (file, size), is_tracked(file))
ON_FILE(fchmod, "chmod", (int file, mode_t mode), (file, mode), is_tracked(file))
ON_PATH(rename, "rename", (const char *from, const char *to), (from, to), to)
ON_PATH(renameat, "rename", (int a, const char *from, int b, const char *to), (a, from, b, to), to)
ON_PATH(link, "link", (const char *from, const char *to), (from, to), to)
ON_PATH(linkat, "link", (int a, const char *from, int b, const char *to, int flags),
        (a, from, b, to, flags), to)
ON_PATH(symlink, "link", (const char *from, const char *to), (from, to), to)
ON_PATH(unlink, "unlink", (const char *path), (path), path)
ON_PATH(unlinkat, "unlink", (int folder, const char *path, int flags), (folder, path, flags), path)
ON_PATH(rmdir, "rmdir", (const char *path), (path), path)
ON_PATH(mkdir, "mkdir", (const char *path, mode_t mode), (path, mode), path)
ON_PATH(mkdirat, "mkdir", (int folder, const char *path, mode_t mode), (folder, path, mode), path)
