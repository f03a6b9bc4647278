/* Counts the rows that are learned, and writes what is learned; see learning.c. */
int main(void)
{
    real counts[3] = { 0, 0, 0 };
    const real size = (real)sizeof adapter;
    size_t k;
    if (!begin()) {
        return 2;
    }
    boat_adapter_init(a, s, first, held);
    put(s->x + BOAT_FIRST_WEIGHT, BOAT_WEIGHTS);
    for (k = 1; k < WARM_UP; ++k) {
        boat_adapter_step(a, s, held);
        boat_adapter_observe(a, s, first);
    }
    for (k = 0; k < SAMPLES; ++k) {
        boat_adapter_step(a, s, given + k * M);
        counts[boat_adapter_observe(a, s, measured + k * N)] += 1;
        if (k % 10 == 0) {
            put(s->x + BOAT_FIRST_WEIGHT, BOAT_WEIGHTS);
        }
        if (k % EVERY == 0) {
            boat_rollout(s, given, AHEAD, ahead);
            put(ahead, AHEAD * N);
        }
        if (k == SAMPLES / 2 + 1) {
            move();
        }
    }
    put(counts, 3);
    put(&size, 1);
    /* Another run keeps what was learned, and a new beginning forgets it. */
    boat_adapter_start(a, s, first, held);
    put(s->x + BOAT_FIRST_WEIGHT, BOAT_WEIGHTS);
    boat_adapter_init(a, s, first, held);
    put(s->x + BOAT_FIRST_WEIGHT, BOAT_WEIGHTS);
    return 0;
}
