/* What all programs have in common that learn along the run in the file "run" and write numbers to the standard output. */
#include "boat.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
typedef boat_real real;
#define N BOAT_OUTPUTS
#define M BOAT_INPUTS
/* A steady motion, and a run: commands and measurements. */
static real first[N], held[M], given[SAMPLES * M], measured[SAMPLES * N], ahead[AHEAD * N];
static boat_state state, other_state;
static boat_adapter adapter, other;
static boat_adapter *a = &adapter;
static boat_state *s = &state;
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
/* Reads the run, and fills the memory with what no adapter has. */
static int begin(void)
{
    FILE *file = fopen("run", "rb");
    if (file == NULL || !taken(file, first, N) || !taken(file, held, M) || !taken(file, given, SAMPLES * M) ||
        !taken(file, measured, SAMPLES * N)) {
        return 0;
    }
    fclose(file);
    memset(a, 255, sizeof adapter);
    memset(s, 255, sizeof state);
    return 1;
}
/* The run goes on in a copy of the memory. */
static void move(void)
{
    memcpy(&other, a, sizeof other);
    memcpy(&other_state, s, sizeof other_state);
    memset(a, 255, sizeof other);
    memset(s, 255, sizeof other_state);
    a = &other;
    s = &other_state;
}
