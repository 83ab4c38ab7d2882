/* What an image says to who runs it, by semihosting: a debugger or an emulator does it. "Semihosting for AArch32 and AArch64",
   Arm, 2024: operations by number, in r0, with an argument in r1, at the instruction BKPT 0xAB. */
#ifndef BOARD_HOST_H
#define BOARD_HOST_H

#include <stdint.h>

#define HOST_WRITE 0x04 /* a text that ends with 0 */
#define HOST_EXIT 0x20  /* two words: why, and an exit code */
#define HOST_EXITED 0x20026u

static inline void host_call(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static inline void host_text(const char *text) { host_call(HOST_WRITE, text); }

static inline void host_exit(uint32_t code)
{
    const uint32_t why[2] = {HOST_EXITED, code};
    for (;;) host_call(HOST_EXIT, why);
}

#endif
