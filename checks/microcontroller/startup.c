/* Start of a program on an Arm MPS2 board (Cortex-M4F: AN386, Cortex-M7: AN500), as QEMU emulates it. */
#include <stdint.h>

extern uint32_t __data_load, __data_start, __data_end, __bss_start, __bss_end, __stack_end;

int main(void);
void board_exit(int status);

void reset(void)
{
    uint32_t *from = &__data_load;
    uint32_t *to = &__data_start;
    /* Full access to the coprocessors 10 and 11: the floating-point unit. */
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20;
    __asm volatile("dsb\n isb" ::: "memory");
    while (to < &__data_end) {
        *to++ = *from++;
    }
    for (to = &__bss_start; to < &__bss_end; ++to) {
        *to = 0;
    }
    board_exit(main());
}

static void fault(void)
{
    board_exit(99);
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &__stack_end, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};

static uint32_t host(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* Prints a text by semihosting. */
void board_print(const char *text)
{
    host(0x04, text);
}

/* Ends the emulator. */
void board_exit(int status)
{
    const uint32_t block[2] = { 0x20026u, (uint32_t)status };
    host(0x20, block);
    for (;;) {
    }
}

/* Starts the timer of the board, 25 MHz, which counts down. */
void board_timer(void)
{
    volatile uint32_t *const timer = (volatile uint32_t *)0x40000000u;
    timer[0] = 0;
    timer[2] = 0xFFFFFFFFu;
    timer[1] = 0xFFFFFFFFu;
    timer[0] = 1;
}

/* Ticks of the timer since its start. */
uint32_t board_ticks(void)
{
    return 0xFFFFFFFFu - ((volatile uint32_t *)0x40000000u)[1];
}
