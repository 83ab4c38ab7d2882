/* What C alone does not say: waiting for bytes while a person may stop the run, and files that are replaced as a whole. On
   systems with POSIX signals a run that is stopped ends in order; on others plain C serves. To be included first. */
#ifndef WATCH_SYSTEM_H
#define WATCH_SYSTEM_H

#if !defined(_WIN32) && !defined(__wasi__)
#define WATCH_POSIX
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#endif

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>

#define SYSTEM_FAILED (-1)  /* errno says why */
#define SYSTEM_STOPPED (-2) /* by a signal */
#define INPUT_ROOM 65536    /* bytes of standard input that are read at a time */

/* What changes where a file is replaced. */
typedef struct {
    long long time, number, size;
} Stamp;

/* The stamp of a file; zeros where there is none. */
static Stamp system_stamp(const char *path)
{
    struct stat about;
    Stamp stamp = {0, 0, 0};
    if (stat(path, &about) != 0) return stamp;
    stamp.time = (long long)about.st_mtime;
    stamp.number = (long long)about.st_ino;
    stamp.size = (long long)about.st_size;
    return stamp;
}

#ifdef WATCH_POSIX

#include <signal.h>
#include <sys/select.h>
#include <unistd.h>

static volatile sig_atomic_t the_signal; /* that asked to stop; 0: none */

#ifdef __cplusplus
extern "C" {
#endif
static void note_signal(int number)
{
    if (number == SIGINT && the_signal == SIGINT) { /* somebody insists */
        (void)signal(SIGINT, SIG_DFL);
        (void)raise(SIGINT);
    }
    if (!the_signal) the_signal = number;
}
#ifdef __cplusplus
}
#endif

/* Take the signals that stop a program, but those that are ignored, as by nohup. A pipe that nobody reads is an error of
   writing. */
static void system_begin(void)
{
    static const int stopping[] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction before, now;
    memset(&now, 0, sizeof now);
    sigemptyset(&now.sa_mask);
    now.sa_handler = note_signal;
    now.sa_flags = SA_NODEFER;
    for (size_t k = 0; k < sizeof stopping / sizeof stopping[0]; k++)
        if (sigaction(stopping[k], NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(stopping[k], &now, NULL);
    signal(SIGPIPE, SIG_IGN);
}

static int system_signal(void) { return (int)the_signal; }

/* Wait for bytes of standard input, and give how many came; 0: the end. A signal that comes before or while it waits is seen:
   only the wait itself lets it through. */
static long system_read(char *bytes, size_t room)
{
    sigset_t stopping, usual;
    fd_set awaited;
    sigemptyset(&stopping);
    sigaddset(&stopping, SIGINT);
    sigaddset(&stopping, SIGTERM);
    sigaddset(&stopping, SIGHUP);
    sigprocmask(SIG_BLOCK, &stopping, &usual);
    FD_ZERO(&awaited);
    FD_SET(0, &awaited);
    const int ready = the_signal ? -1 : pselect(1, &awaited, NULL, NULL, NULL, &usual);
    const int why = errno;
    sigprocmask(SIG_SETMASK, &usual, NULL);
    if (the_signal) return SYSTEM_STOPPED;
    if (ready < 0 && why != EINTR) {
        errno = why;
        return SYSTEM_FAILED;
    }
    for (;;) {
        const long n = (long)read(0, bytes, room);
        if (n >= 0) return n;
        if (the_signal) return SYSTEM_STOPPED;
        if (errno != EINTR) return SYSTEM_FAILED;
    }
}

/* Put what was written on the disk; 0, or SYSTEM_FAILED. */
static int system_settle(FILE *file) { return fflush(file) == 0 && fsync(fileno(file)) == 0 ? 0 : SYSTEM_FAILED; }

static int system_replace(const char *from, const char *to) { return rename(from, to) == 0 ? 0 : SYSTEM_FAILED; }

#else

#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#ifdef __cplusplus
extern "C"
#endif
__declspec(dllimport) int __stdcall MoveFileExA(const char *from, const char *to, unsigned long how);

static void system_begin(void)
{
    _setmode(_fileno(stdin), _O_BINARY);
    _setmode(_fileno(stdout), _O_BINARY);
}

static int system_replace(const char *from, const char *to)
{
    errno = EACCES;
    return MoveFileExA(from, to, 1 | 8) ? 0 : SYSTEM_FAILED; /* replace what is there, and wait until it is on the disk */
}
#else
static void system_begin(void) {}

static int system_replace(const char *from, const char *to) { return rename(from, to) == 0 ? 0 : SYSTEM_FAILED; }
#endif

static int system_signal(void) { return 0; }

/* A line of standard input, or what there is room for: who writes line by line is heard line by line. */
static long system_read(char *bytes, size_t room)
{
    size_t n = 0;
    while (n < room) {
        const int byte = getc(stdin);
        if (byte == EOF) break;
        bytes[n++] = (char)byte;
        if (byte == '\n') break;
    }
    return n == 0 && ferror(stdin) ? SYSTEM_FAILED : (long)n;
}

static int system_settle(FILE *file) { return fflush(file) == 0 ? 0 : SYSTEM_FAILED; }

#endif

#endif
