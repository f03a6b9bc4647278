/* Learns along the run in the file "run" and writes what happens to the standard output. */
#include "boat.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
typedef boat_real real;
#define N BOAT_OUTPUTS
#define M BOAT_INPUTS
static real first[N], held[M], given[SAMPLES * M], measured[SAMPLES * N], ahead[AHEAD * N], y[N];
static int taken(FILE *file, real *into, size_t count)
{
    size_t i;
    for (i = 0; i < count; ++i) {
        double number;
        if (fread(&number, sizeof number, 1, file) != 1) {
            return 0;
        }
        into[i] = (real)number;
    }
    return 1;
}
static void put(const real *from, size_t count)
{
    size_t i;
    for (i = 0; i < count; ++i) {
        const double number = (double)from[i];
        fwrite(&number, sizeof number, 1, stdout);
    }
}
int main(void)
{
    static boat_state state, other_state;
    static boat_adapter adapter, other;
    boat_adapter *a = &adapter;
    boat_state *s = &state;
    size_t k;
    const real size = (real)sizeof adapter;
    FILE *file = fopen("run", "rb");
    if (file == NULL || !taken(file, first, N) || !taken(file, held, M) || !taken(file, given, SAMPLES * M) ||
        !taken(file, measured, SAMPLES * N)) {
        return 2;
    }
    fclose(file);
    memset(a, 255, sizeof adapter);
    memset(s, 255, sizeof state);
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
            memcpy(&other, a, sizeof other);
            memcpy(&other_state, s, sizeof other_state);
            memset(a, 255, sizeof other);
            memset(s, 255, sizeof other_state);
            a = &other;
            s = &other_state;
        }
    }
    return 0;
}
