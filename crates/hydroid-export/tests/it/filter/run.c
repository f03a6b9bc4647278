/* Writes what happens at each sample; see learning.c. */
int main(void)
{
    const real size = (real)sizeof adapter;
    real y[N];
    size_t k;
    if (!begin()) {
        return 2;
    }
    put(&size, 1);
    boat_adapter_init(a, s, first, held);
    for (k = 0; k < SAMPLES; ++k) {
        real result;
        if (k == ANEW) {
            boat_adapter_start(a, s, first, held);
        }
        a->frozen = (k >= FROZEN && k < LEARNING) ? 1U : 0U;
        boat_adapter_step(a, s, given + k * M);
        boat_output(s, y);
        put(y, N);
        result = (real)boat_adapter_observe(a, s, measured + k * N);
        boat_output(s, y);
        put(y, N);
        put(&result, 1);
        if (k % EVERY == 0) {
            put(s->x + BOAT_FIRST_WEIGHT, BOAT_WEIGHTS);
            boat_rollout(s, given, AHEAD, ahead);
            put(ahead, AHEAD * N);
        }
        if (k == COPIED) {
            move();
        }
    }
    return 0;
}
