/* One row of a template against a block of feature words, at each level of instructions.

   A block of frames is cut into planes, one of each byte of the words, so that one instruction
   counts the bits of as many frames as a register has bytes. Needs Python.h. */

#ifndef MOCAPIDX_TEMPLATE_ROWS_H
#define MOCAPIDX_TEMPLATE_ROWS_H

#include <stdint.h>
#include <string.h>

#include "levels.h"

#if LEVELS_OF_X86
#include <immintrin.h>
#endif

enum {
    BLOCK = 2048, /* frames; a multiple of what is counted together */
    PLANES = 8,
    BEFORE = 16, /* room in front of a row: two values of the block before, and alignment */
};

typedef struct {
    _Alignas(64) uint8_t planes[PLANES][BLOCK];
    _Alignas(64) uint8_t counts[BLOCK];
    _Alignas(64) float rows[3][BEFORE + BLOCK];
} Room;

/* What a row of a template asks of the bytes of a word: the planes that count, and in each the
   bits that should be set and those that matter. */
typedef struct {
    int planes;
    int plane[PLANES];
    uint8_t ones[PLANES], care[PLANES];
} Bytes;

/* One level of instructions. `count` finds how many bits of each frame differ from what a row
   asks; it may go on to the end of the registers that it fills together. `add_row` fills a row
   from the two above it. */
typedef struct {
    void (*count)(const Room *room, const Bytes *row, uint8_t *counts, Py_ssize_t frames);
    void (*add_row)(const uint8_t *counts, int32_t of, const float *up, const float *two_up,
                    float *here, Py_ssize_t frames, int weighted);
} Level;

/* The correctly rounded quotient n / d for whole 0 <= n, d <= 64, without a division: `high` has
   18 bits, so n * high is exact, and the sum is rounded once of what is right to 42 bits. No such
   quotient lies so near to the middle between two floats (a test tries all of them). */
typedef struct {
    float high, low;
} Reciprocal;

static Reciprocal reciprocal(int32_t of)
{
    double whole = 1.0 / (of > 1 ? of : 1);
    float high = (float)whole;
    uint32_t bits;
    memcpy(&bits, &high, sizeof bits);
    bits &= ~(uint32_t)63;
    memcpy(&high, &bits, sizeof bits);
    return (Reciprocal){high, (float)(whole - high)};
}

INLINED float smaller(float a, float b)
{
    return a < b ? a : b;
}

INLINED void add_row_anyhow(const uint8_t *restrict counts, int32_t of, const float *up,
                            const float *two_up, float *restrict here, Py_ssize_t frames,
                            int weighted)
{
    const Reciprocal share = reciprocal(of);
    const float high = share.high, low = share.low;
    if (!up) {
        for (Py_ssize_t t = 0; t < frames; t++) {
            const float n = (float)counts[t];
            here[t] = n * high + n * low;
        }
    } else if (weighted) {
        for (Py_ssize_t t = 0; t < frames; t++) {
            const float n = (float)counts[t];
            const float cost = n * high + n * low;
            here[t] = smaller(smaller(up[t - 1], up[t - 2]), two_up[t - 1] + cost) + cost;
        }
    } else {
        for (Py_ssize_t t = 0; t < frames; t++) {
            const float n = (float)counts[t];
            const float cost = n * high + n * low;
            here[t] = smaller(smaller(up[t - 1], up[t - 2]), two_up[t - 1]) + cost;
        }
    }
}

static void add_row_portable(const uint8_t *counts, int32_t of, const float *up,
                             const float *two_up, float *here, Py_ssize_t frames, int weighted)
{
    add_row_anyhow(counts, of, up, two_up, here, frames, weighted);
}

static void count_portable(const Room *room, const Bytes *row, uint8_t *counts, Py_ssize_t frames)
{
    const uint64_t every = 0x0101010101010101u;
    memset(counts, 0, (size_t)frames);
    for (int i = 0; i < row->planes; i++) {
        const uint8_t *plane = room->planes[row->plane[i]];
        const uint64_t ones = row->ones[i] * every, cares = row->care[i] * every;
        for (Py_ssize_t t = 0; t < frames; t += 8) {
            uint64_t bytes, sum;
            memcpy(&bytes, plane + t, 8);
            memcpy(&sum, counts + t, 8);
            bytes = (bytes ^ ones) & cares;
            bytes -= (bytes >> 1) & 0x55 * every;
            bytes = (bytes & 0x33 * every) + ((bytes >> 2) & 0x33 * every);
            sum += (bytes + (bytes >> 4)) & 0x0f * every;
            memcpy(counts + t, &sum, 8);
        }
    }
}

#if LEVELS_OF_X86

FOR("ssse3")
static void add_row_ssse3(const uint8_t *counts, int32_t of, const float *up, const float *two_up,
                          float *here, Py_ssize_t frames, int weighted)
{
    add_row_anyhow(counts, of, up, two_up, here, frames, weighted);
}

FOR("ssse3")
static void count_ssse3(const Room *room, const Bytes *row, uint8_t *counts, Py_ssize_t frames)
{
    const __m128i bits = _mm_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
    const __m128i nibble = _mm_set1_epi8(15);
    __m128i ones[PLANES], care[PLANES];
    for (int i = 0; i < row->planes; i++) {
        ones[i] = _mm_set1_epi8((char)row->ones[i]);
        care[i] = _mm_set1_epi8((char)row->care[i]);
    }
    for (Py_ssize_t t = 0; t < frames; t += 16) {
        __m128i sum = _mm_setzero_si128();
        for (int i = 0; i < row->planes; i++) {
            __m128i bytes = _mm_load_si128((const __m128i *)(room->planes[row->plane[i]] + t));
            bytes = _mm_and_si128(_mm_xor_si128(bytes, ones[i]), care[i]);
            const __m128i lower = _mm_and_si128(bytes, nibble);
            const __m128i upper = _mm_and_si128(_mm_srli_epi16(bytes, 4), nibble);
            sum = _mm_add_epi8(sum, _mm_shuffle_epi8(bits, lower));
            sum = _mm_add_epi8(sum, _mm_shuffle_epi8(bits, upper));
        }
        _mm_store_si128((__m128i *)(counts + t), sum);
    }
}

FOR("avx2")
static void add_row_avx2(const uint8_t *counts, int32_t of, const float *up, const float *two_up,
                         float *here, Py_ssize_t frames, int weighted)
{
    add_row_anyhow(counts, of, up, two_up, here, frames, weighted);
}

FOR("avx2")
static void count_avx2(const Room *room, const Bytes *row, uint8_t *counts, Py_ssize_t frames)
{
    const __m256i bits = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,
                                          0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
    const __m256i nibble = _mm256_set1_epi8(15);
    __m256i ones[PLANES], care[PLANES];
    for (int i = 0; i < row->planes; i++) {
        ones[i] = _mm256_set1_epi8((char)row->ones[i]);
        care[i] = _mm256_set1_epi8((char)row->care[i]);
    }
    for (Py_ssize_t t = 0; t < frames; t += 32) {
        __m256i sum = _mm256_setzero_si256();
        for (int i = 0; i < row->planes; i++) {
            __m256i bytes = _mm256_load_si256((const __m256i *)(room->planes[row->plane[i]] + t));
            bytes = _mm256_and_si256(_mm256_xor_si256(bytes, ones[i]), care[i]);
            const __m256i lower = _mm256_and_si256(bytes, nibble);
            const __m256i upper = _mm256_and_si256(_mm256_srli_epi16(bytes, 4), nibble);
            sum = _mm256_add_epi8(sum, _mm256_shuffle_epi8(bits, lower));
            sum = _mm256_add_epi8(sum, _mm256_shuffle_epi8(bits, upper));
        }
        _mm256_store_si256((__m256i *)(counts + t), sum);
    }
}

FOR(AVX512_INSTRUCTIONS)
static void add_row_avx512(const uint8_t *counts, int32_t of, const float *up,
                           const float *two_up, float *here, Py_ssize_t frames, int weighted)
{
    add_row_anyhow(counts, of, up, two_up, here, frames, weighted);
}

FOR(AVX512_INSTRUCTIONS)
static void count_avx512(const Room *room, const Bytes *row, uint8_t *counts, Py_ssize_t frames)
{
    __m512i ones[PLANES], care[PLANES];
    for (int i = 0; i < row->planes; i++) {
        ones[i] = _mm512_set1_epi8((char)row->ones[i]);
        care[i] = _mm512_set1_epi8((char)row->care[i]);
    }
    for (Py_ssize_t t = 0; t < frames; t += 4 * 64) {
        __m512i sums[4] = {{0}}; /* four at a time wait for each other less */
        for (int i = 0; i < row->planes; i++) {
            const uint8_t *plane = room->planes[row->plane[i]] + t;
            for (int j = 0; j < 4; j++) {
                __m512i bytes = _mm512_load_si512(plane + 64 * j);
                bytes = _mm512_and_si512(_mm512_xor_si512(bytes, ones[i]), care[i]);
                sums[j] = _mm512_add_epi8(sums[j], _mm512_popcnt_epi8(bytes));
            }
        }
        for (int j = 0; j < 4; j++)
            _mm512_store_si512(counts + t + 64 * j, sums[j]);
    }
}

#endif

static const Level levels[LEVELS] = {
    [PORTABLE] = {count_portable, add_row_portable},
#if LEVELS_OF_X86
    [AVX512] = {count_avx512, add_row_avx512},
    [AVX2] = {count_avx2, add_row_avx2},
    [SSSE3] = {count_ssse3, add_row_ssse3},
#endif
};

static int32_t bits_set(uint64_t word)
{
    int32_t count = 0;
    for (; word; word &= word - 1)
        count++;
    return count;
}

static Bytes bytes_of(uint64_t ones, uint64_t care)
{
    Bytes row = {0};
    for (int plane = 0; plane < PLANES; plane++, ones >>= 8, care >>= 8)
        if (care & 255) {
            row.plane[row.planes] = plane;
            row.ones[row.planes] = (uint8_t)ones;
            row.care[row.planes++] = (uint8_t)care;
        }
    return row;
}

static void cut_planes(Room *room, const uint64_t *words, Py_ssize_t frames)
{
    for (int plane = 0; plane < PLANES; plane++)
        for (Py_ssize_t t = 0; t < frames; t++)
            room->planes[plane][t] = (uint8_t)(words[t] >> 8 * plane);
}

#endif
