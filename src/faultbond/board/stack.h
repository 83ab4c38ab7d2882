/* The stack of an image: where it lies, and the mark of what was never used of it. */
#ifndef BOARD_STACK_H
#define BOARD_STACK_H

#include <stdint.h>

#define STACK_MARK 0x5A5A5A5Au
#define STACK_LEFT 64 /* words under the frame that marks the others */

extern uint32_t stack_begin[], stack_end[]; /* of the linker script; it grows from its end to its beginning */

/* Bytes that were used, at the most so far. */
static inline uint32_t stack_used(void)
{
    const uint32_t *at = stack_begin;
    while (at < stack_end && *at == STACK_MARK) at++;
    return (uint32_t)((const char *)stack_end - (const char *)at);
}

#endif
