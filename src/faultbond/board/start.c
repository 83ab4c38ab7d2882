/* From reset to `main` on a Cortex-M7: the stack is marked, so that it can be told how deep it went, data and zeros are laid
   out, and the numbers' unit is switched on. ARMv7-M Architecture Reference Manual, B1.5 and B3.2. */
#include <stdint.h>

#include "host.h"
#include "stack.h"

#define ACCESS (*(volatile uint32_t *)0xE000ED88u) /* CPACR: who may use coprocessors, */
#define ALL_NUMBERS (0xFu << 20)                   /* those of floating point */

extern uint32_t data_from[], data_begin[], data_end[], zero_begin[], zero_end[]; /* of the linker script */
int main(void);
void reset(void);

static void run(void)
{
    for (uint32_t *at = stack_begin; at < (uint32_t *)__builtin_frame_address(0) - STACK_LEFT; at++) *at = STACK_MARK;
    for (uint32_t *to = data_begin, *from = data_from; to < data_end; to++, from++) *to = *from;
    for (uint32_t *to = zero_begin; to < zero_end; to++) *to = 0;
    host_exit((uint32_t)main());
}

void reset(void)
{
    ACCESS |= ALL_NUMBERS;
    __asm__ volatile("dsb\n isb" ::: "memory");
    run();
}

/* A fault of the processor; nothing here asks for interrupts. */
static void fault(void)
{
    host_text("the processor stopped: a fault\n");
    host_exit(3);
}

typedef void (*Vector)(void);

__attribute__((section(".vectors"), used)) static const Vector vectors[] = {
    (Vector)stack_end, reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault,
};
