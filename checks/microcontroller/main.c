/* Runs an exported model on the board: compares its predictions with those of hydroid, and counts instructions. With
 * `-icount shift=0`, an instruction takes 1 ns of the emulated time, and a tick of the timer is 40 instructions. */
#include "run.h"
#include "vessel.h"

#include <stdint.h>

void board_print(const char *text);
void board_timer(void);
uint32_t board_ticks(void);

#define INSTRUCTIONS_PER_TICK 40u

static vessel_real predicted[RUN_SAMPLES * VESSEL_OUTPUTS];

static void print_number(uint32_t number)
{
    char text[12];
    char *at = text + sizeof text - 1;
    *at = '\0';
    do {
        *--at = (char)('0' + number % 10);
        number /= 10;
    } while (number > 0);
    board_print(at);
}

/* The stack below this function, filled before and searched after a call. */
#define STACK 65536
#define MARK 0xA5A5A5A5u

static uint32_t *stack_bottom(void)
{
    uint32_t *here;
    __asm volatile("mov %0, sp" : "=r"(here));
    return here - STACK / 4;
}

static void mark_stack(void)
{
    uint32_t *at = stack_bottom();
    uint32_t i;
    for (i = 0; i < STACK / 4 - 64; ++i) {
        at[i] = MARK;
    }
}

static uint32_t used_stack(void)
{
    const uint32_t *at = stack_bottom();
    uint32_t i = 0;
    while (i < STACK / 4 && at[i] == MARK) {
        ++i;
    }
    return STACK - 4 * i;
}

static vessel_state state;

/* What is measured, and the size of its memory. */
#ifdef RUN_LEARNS
static vessel_adapter adapter;

static void start(void)
{
    vessel_adapter_init(&adapter, &state, run_first, run_held);
}

static void run(void)
{
    uint32_t k;
    for (k = 0; k < RUN_SAMPLES; ++k) {
        vessel_adapter_step(&adapter, &state, run_ahead + k * VESSEL_INPUTS);
        vessel_adapter_observe(&adapter, &state, run_first);
    }
}

#define MEMORY (sizeof state + sizeof adapter)
#else
static void start(void)
{
    vessel_init(&state, run_first, run_held);
}

static void run(void)
{
    vessel_rollout(&state, run_ahead, RUN_SAMPLES, predicted);
}

#define MEMORY (sizeof state)
#endif

int main(void)
{
    uint32_t begin, ticks, stack, k, wrong = 0;
    start();
    mark_stack();
    run();
    stack = used_stack();
    start();
    board_timer();
    begin = board_ticks();
    run();
    ticks = board_ticks() - begin;
    vessel_rollout(&state, run_ahead, RUN_SAMPLES, predicted);
    for (k = 0; k < RUN_SAMPLES * VESSEL_OUTPUTS; ++k) {
        const vessel_real difference = predicted[k] - run_predicted[k];
        const vessel_real size = difference < 0 ? -difference : difference;
        if (!(size <= RUN_TOLERANCE)) {
            ++wrong;
        }
    }
    board_print("instructions ");
    print_number((uint32_t)((uint64_t)ticks * INSTRUCTIONS_PER_TICK / RUN_SAMPLES));
    board_print(" stack ");
    print_number(stack);
    board_print(" state ");
    print_number((uint32_t)MEMORY);
    board_print(wrong == 0 ? " agrees\n" : " DIFFERS\n");
    return wrong == 0 ? 0 : 1;
}
