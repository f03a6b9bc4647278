/* Runs a network that learns on the board, and counts the instructions of a sample; see main.c. */
#include <stdint.h>

void board_print(const char *text);
void board_timer(void);
uint32_t board_ticks(void);

void *learner_new(uint32_t cells, uint32_t group);
void learner_step(void *learner);
uint32_t learner_weights(const void *learner);
double learner_check(const void *learner);
uint32_t learner_memory(void);

#define SAMPLES 20u

static void print_number(uint64_t number)
{
    char text[24];
    char *at = text + sizeof text - 1;
    *at = '\0';
    do {
        *--at = (char)('0' + number % 10);
        number /= 10;
    } while (number > 0);
    board_print(at);
    board_print(" ");
}

int main(void)
{
    void *const learner = learner_new(CELLS, GROUP);
    uint32_t k;
    if (learner == 0) {
        return 4;
    }
    for (k = 0; k < SAMPLES; ++k) {
        learner_step(learner);
    }
    board_timer();
    for (k = 0; k < SAMPLES; ++k) {
        learner_step(learner);
    }
    print_number((uint64_t)board_ticks() * 40u / SAMPLES);
    print_number(learner_weights(learner));
    print_number(learner_memory());
    print_number((uint64_t)(learner_check(learner) * 1e15 + 0.5));
    return 0;
}
