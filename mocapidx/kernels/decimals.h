/* The words of a text, and the decimal numbers among them, correctly rounded.

   Needs Python.h, whose float() converts the odd ones. */

#ifndef MOCAPIDX_DECIMALS_H
#define MOCAPIDX_DECIMALS_H

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

enum {
    EXACT_POWER = 22, /* 10**22 is the largest power of ten that a double holds exactly */
    MOST_DIGITS = 19, /* of a mantissa that fits 64 bits */
};

static const double float_powers[EXACT_POWER + 1] = {
    1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
    1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
};
static const double signs[2] = {1, -1};
static const uint64_t word_powers[9] = {
    1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000,
};

/* A place in a text, while the lock of the interpreter is released. */
typedef struct {
    const char *at, *end;
    Py_ssize_t lines; /* ends of lines passed so far */
    PyThreadState *thread;
} Scan;

/* White space; other control characters are taken for blanks in few places, all in Python. */
static int is_blank(char letter)
{
    return letter == ' ' || (letter >= '\t' && letter <= '\r');
}

/* Go to the next word of this line; 0 at its end. */
static int next_word(Scan *scan)
{
    while (scan->at < scan->end && is_blank(*scan->at) && *scan->at != '\n')
        scan->at++;
    return scan->at < scan->end && *scan->at != '\n';
}

/* Go to the next line that is not blank, or the end of the text; 0 if there are words before. */
static int next_line(Scan *scan)
{
    if (next_word(scan))
        return 0;
    while (scan->at < scan->end && is_blank(*scan->at)) {
        scan->lines += *scan->at == '\n';
        scan->at++;
    }
    return 1;
}

static int is_end_of_word(const char *at, const char *end)
{
    return at == end || is_blank(*at);
}

/* Eight letters as one word, the first one lowest; one load, where the processor stores so. */
static inline uint64_t joined(const unsigned char *l)
{
    return (uint64_t)l[0] | (uint64_t)l[1] << 8 | (uint64_t)l[2] << 16 | (uint64_t)l[3] << 24 |
           (uint64_t)l[4] << 32 | (uint64_t)l[5] << 40 | (uint64_t)l[6] << 48 |
           (uint64_t)l[7] << 56;
}

/* The next eight letters; blanks beyond the end of the text. */
static inline uint64_t eight_letters(const char *at, const char *end)
{
    if (end - at >= 8)
        return joined((const unsigned char *)at);
    unsigned char letters[8] = "        ";
    memcpy(letters, at, (size_t)(end - at));
    return joined(letters);
}

/* Read up to eight digits at once. Returns how many there were; `value` gets their number. */
static inline int read_digits(const char *at, const char *end, uint64_t *value)
{
    const uint64_t every = 0x0101010101010101u, pairs = 0x000000ff000000ffu;
    uint64_t word = eight_letters(at, end) ^ '0' * every;
    const uint64_t others = ((word + (0x7f - 9) * every) | word) & 0x80 * every;
    /* every letter below the first that is no digit leaves a one, and the ones are summed up */
    const uint64_t below = ((others & (0 - others)) >> 7) - 1;
    const int count = (int)((below & every) * every >> 56);
    const int shift = 4 * (8 - count);
    word = word << shift << shift; /* at once it might be by 64 bits, which is undefined */
    /* neighbours are joined: eight digits to four pairs, then pairs to fours, fours to eight */
    word = word * 10 + (word >> 8);
    const uint64_t high = (word & pairs) * (100 + ((uint64_t)1000000 << 32));
    const uint64_t low = (word >> 16 & pairs) * (1 + ((uint64_t)10000 << 32));
    *value = (high + low) >> 32;
    return count;
}

/* Read all digits on to a mantissa that has `before` of them.

   Returns how many there were; -1 if the mantissa might get too long for 64 bits. */
static inline int extend(const char *at, const char *end, uint64_t *mantissa, int before)
{
    uint64_t more;
    int digits = 0, count;
    do {
        if (before + digits > MOST_DIGITS - 8)
            return -1;
        count = read_digits(at + digits, end, &more);
        *mantissa = *mantissa * word_powers[count] + more;
        digits += count;
    } while (count == 8);
    return digits;
}

/* Convert one word as Python's float() does; 0 if it is no finite number. */
static int read_any_number(Scan *scan, double *number)
{
    const char *start = scan->at;
    char *stop = NULL;
    while (!is_end_of_word(scan->at, scan->end))
        scan->at++;
    PyEval_RestoreThread(scan->thread);
    *number = PyOS_string_to_double(start, &stop, NULL); /* the text ends in a NUL */
    PyErr_Clear();
    scan->thread = PyEval_SaveThread();
    return stop == scan->at && isfinite(*number);
}

/* Convert the word at this place, correctly rounded; 0 if it is no finite decimal number.

   The mantissa and the power of ten are both doubles without error, so the one operation on
   them is the only rounding. Whatever is longer goes the slow way. */
static inline int read_number(Scan *scan, double *number)
{
    const char *at = scan->at, *const end = scan->end;
    uint64_t mantissa = 0, exponent = 0;
    const int negative = *at == '-'; /* half of all are: nothing branches on it */
    at += negative | (*at == '+');
    int power = 0, digits = extend(at, end, &mantissa, 0);
    if (digits < 0)
        return read_any_number(scan, number);
    at += digits;
    if (at < end && *at == '.') {
        const int decimals = extend(++at, end, &mantissa, digits);
        if (decimals < 0)
            return read_any_number(scan, number);
        at += decimals;
        digits += decimals;
        power = -decimals;
    }
    if (digits == 0)
        return 0;
    if (at < end && (*at | 32) == 'e') {
        at++;
        const int below = at < end && *at == '-';
        at += below || (at < end && *at == '+');
        const int count = read_digits(at, end, &exponent);
        if (count == 8)
            return read_any_number(scan, number);
        if (count == 0)
            return 0;
        at += count;
        power += below ? -(int)exponent : (int)exponent;
    }
    if (!is_end_of_word(at, end))
        return 0;
    if (mantissa > (uint64_t)1 << DBL_MANT_DIG || power > EXACT_POWER || power < -EXACT_POWER ||
        FLT_EVAL_METHOD != 0)
        return read_any_number(scan, number);
    const double value = (double)(int64_t)mantissa;
    const double size = power < 0 ? value / float_powers[-power] : value * float_powers[power];
    *number = size * signs[negative];
    scan->at = at;
    return 1;
}

#endif
