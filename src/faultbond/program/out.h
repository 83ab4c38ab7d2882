/* Standard output, or who takes its place: bytes gather until a line is whole, and then all of them are written at once.
   Nothing is lost without a word: what could not be written is counted. */
#ifndef WATCH_OUT_H
#define WATCH_OUT_H

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define OUT_ROOM 8192 /* bytes; a longer line is written in parts */

typedef struct {
    FILE *stream;
    void (*hand)(const char *bytes, size_t n); /* takes the bytes instead; NULL: the stream does */
    size_t n;
    int is_lost;   /* whether a part of this line could not be written, */
    int error;     /* and why: a number of the system */
    int64_t lost;  /* lines that could not be written */
    char bytes[OUT_ROOM];
} Out;

static void out_begin(Out *out, FILE *stream)
{
    memset(out, 0, sizeof *out);
    out->stream = stream;
    if (stream) setvbuf(stream, NULL, _IONBF, 0); /* what is written is on its way, and no memory is asked for */
}

/* Write what has gathered; once a part of a line is lost, so is the rest of it. */
static void out_write(Out *out)
{
    errno = 0;
    if (out->hand) out->hand(out->bytes, out->n);
    else if (out->n > 0 && !out->is_lost && fwrite(out->bytes, 1, out->n, out->stream) != out->n) {
        out->is_lost = 1;
        out->error = errno ? errno : EIO;
        clearerr(out->stream);
    }
    out->n = 0;
}

static void out_byte(Out *out, char byte)
{
    if (out->n == OUT_ROOM) out_write(out);
    out->bytes[out->n++] = byte;
}

static void out_text(Out *out, const char *text)
{
    for (; *text; text++) out_byte(out, *text);
}

/* End a line, and write it. */
static void out_end_line(Out *out)
{
    out_byte(out, '\n');
    out_write(out);
    out->lost += out->is_lost;
    out->is_lost = 0;
}

#endif
