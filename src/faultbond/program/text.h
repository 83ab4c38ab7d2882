/* Letters of a text in UTF-8, as Python reads them with errors="replace": what is no letter is U+FFFD, once for each run of
   bytes that could begin one. Texts end with a byte that is a letter of its own, as an end of line or 0. */
#ifndef WATCH_TEXT_H
#define WATCH_TEXT_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define TEXT_REPLACED 0xFFFDu

static inline int is_digit(char c) { return c >= '0' && c <= '9'; }

static inline int is_ascii_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/* Whether byte c may go on a letter that begins with `lead` as its next byte. Source: the Unicode standard, table 3-7. */
static inline int text_goes_on(unsigned lead, int n, unsigned c)
{
    const unsigned least = n > 1 ? 0x80u : lead == 0xE0u ? 0xA0u : lead == 0xF0u ? 0x90u : 0x80u;
    const unsigned most = n > 1 ? 0xBFu : lead == 0xEDu ? 0x9Fu : lead == 0xF4u ? 0x8Fu : 0xBFu;
    return c >= least && c <= most;
}

/* Give the letter at *at and go behind it. */
static inline uint32_t text_letter(const char **at)
{
    const unsigned lead = (unsigned char)*(*at)++;
    if (lead < 0x80u) return lead;
    const int more = lead >= 0xC2u && lead <= 0xDFu ? 1 : (lead & 0xF0u) == 0xE0u ? 2 : lead >= 0xF0u && lead <= 0xF4u ? 3 : 0;
    uint32_t letter = more == 1 ? lead & 0x1Fu : more == 2 ? lead & 0x0Fu : lead & 0x07u;
    if (more == 0) return TEXT_REPLACED;
    for (int n = 1; n <= more; n++) {
        const unsigned c = (unsigned char)**at;
        if (!text_goes_on(lead, n, c)) return TEXT_REPLACED;
        letter = letter << 6 | (c & 0x3Fu);
        (*at)++;
    }
    return letter;
}

/* Whether a letter is a blank one, as str.isspace. */
static inline int text_is_space(uint32_t c)
{
    return c == 0x20u || (c >= 0x09u && c <= 0x0Du) || (c >= 0x1Cu && c <= 0x1Fu) || c == 0x85u || c == 0xA0u ||
           c == 0x1680u || (c >= 0x2000u && c <= 0x200Au) || c == 0x2028u || c == 0x2029u || c == 0x202Fu || c == 0x205Fu ||
           c == 0x3000u;
}

/* The digit 0 of each script that writes decimal numbers; its others follow. Source: Unicode 14, category Nd. */
static const uint32_t TEXT_ZEROS[] = {
    0x30,    0x660,   0x6f0,   0x7c0,   0x966,   0x9e6,   0xa66,   0xae6,   0xb66,   0xbe6,   0xc66,   0xce6,   0xd66,   0xde6,
    0xe50,   0xed0,   0xf20,   0x1040,  0x1090,  0x17e0,  0x1810,  0x1946,  0x19d0,  0x1a80,  0x1a90,  0x1b50,  0x1bb0,  0x1c40,
    0x1c50,  0xa620,  0xa8d0,  0xa900,  0xa9d0,  0xa9f0,  0xaa50,  0xabf0,  0xff10,  0x104a0, 0x10d30, 0x11066, 0x110f0, 0x11136,
    0x111d0, 0x112f0, 0x11450, 0x114d0, 0x11650, 0x116c0, 0x11730, 0x118e0, 0x11950, 0x11c50, 0x11d50, 0x11da0, 0x16a60, 0x16ac0,
    0x16b50, 0x1d7ce, 0x1d7d8, 0x1d7e2, 0x1d7ec, 0x1d7f6, 0x1e140, 0x1e2f0, 0x1e950, 0x1fbf0};

/* The value of a letter as a decimal digit of any script; -1 if it is none. */
static inline int text_digit(uint32_t c)
{
    if (c < 0x80u) return c >= '0' && c <= '9' ? (int)(c - '0') : -1;
    for (size_t k = 1; k < sizeof TEXT_ZEROS / sizeof *TEXT_ZEROS; k++)
        if (c >= TEXT_ZEROS[k] && c < TEXT_ZEROS[k] + 10u) return (int)(c - TEXT_ZEROS[k]);
    return -1;
}

/* How many letters there are up to `stop`. */
static inline size_t text_length(const char *at, const char *stop)
{
    size_t n = 0;
    for (; at < stop; n++) (void)text_letter(&at);
    return n;
}

/* Whether a text has other letters than blanks. */
static inline int text_says(const char *at)
{
    while (*at != '\0')
        if (!text_is_space(text_letter(&at))) return 1;
    return 0;
}

/* Whether a text is a word of small ASCII letters, however written, between spaces. */
static inline int text_is(const char *at, const char *word)
{
    while (is_ascii_space(*at)) at++;
    for (; *word != '\0' && (*at >= 'A' && *at <= 'Z' ? *at + 'a' - 'A' : *at) == *word; at++) word++;
    return *word == '\0' && !text_says(at);
}

/* Take the blanks off both ends of a text that ends with 0; gives its new begin. */
static inline char *text_strip(char *text)
{
    const char *at = text, *begin = text, *end = text;
    int is_begun = 0;
    while (*at != '\0') {
        const char *const here = at;
        if (text_is_space(text_letter(&at))) continue;
        if (!is_begun) begin = here;
        is_begun = 1;
        end = at;
    }
    if (!is_begun) begin = end = text;
    text[end - text] = '\0';
    return text + (begin - text);
}

/* Append to a text of `room` bytes what fits of another one, at most so many letters of it. */
static inline void text_add(char *text, size_t room, const char *more, size_t letters)
{
    size_t n = strlen(text);
    for (; *more != '\0' && letters > 0; letters--) {
        const char *const here = more;
        const int is_replaced = text_letter(&more) == TEXT_REPLACED;
        const char *const shown = is_replaced ? "\xEF\xBF\xBD" : here;
        const size_t size = is_replaced ? 3 : (size_t)(more - here);
        if (n + size + 1 > room) break;
        memcpy(text + n, shown, size);
        n += size;
    }
    text[n] = '\0';
}

#endif
