/* Start on QEMU's mps2-an386: vector table and floating-point unit, then newlib's own over semihosting. */
#include <stdint.h>

extern uint32_t stack_top;
void _start(void);

static void reset(void)
{
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* CPACR */
    __asm volatile("dsb\n isb");
    _start();
}

/* QEMU ends on it. */
static void stuck(void)
{
    __asm volatile("mov r0, #0x18\n ldr r1, =0x20024\n bkpt 0xAB" ::: "r0", "r1");
}

static const struct {
    uint32_t *stack;
    void (*handlers[15])(void);
} vectors __attribute__((section(".vectors"), used)) = {
    &stack_top,
    { reset, stuck, stuck, stuck, stuck, stuck },
};
