/* Counts allocations along a run: allocations MODEL... The linker passes the calls of the library on to these functions. */
#include <hydroid.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
int __real_posix_memalign(void **place, size_t alignment, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);
int __wrap_posix_memalign(void **place, size_t alignment, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);

void *__wrap_malloc(size_t size)
{
    ++allocations;
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    ++allocations;
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *old, size_t size)
{
    ++allocations;
    return __real_realloc(old, size);
}

int __wrap_posix_memalign(void **place, size_t alignment, size_t size)
{
    ++allocations;
    return __real_posix_memalign(place, alignment, size);
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
    ++allocations;
    return __real_aligned_alloc(alignment, size);
}

#define SAMPLES 600
#define HORIZON 20
/* The memory of predictions grows until the first update of the weights, and the first test of the guard. */
#define SETTLED 100
#define ROOM 100000

static double y[8], row[16], c[8], commands[HORIZON * 8], ahead[HORIZON * 8], memory[ROOM];

static void check(hydroid_status status)
{
    if (status != HYDROID_STATUS_OK) {
        fprintf(stderr, "%s\n", hydroid_last_error());
        exit(1);
    }
}

/* Allocations along a run, after the first predictions. */
static size_t along(hydroid_session *session)
{
    static const size_t horizons[2] = {5, HORIZON};
    size_t n = hydroid_session_outputs(session), m = hydroid_session_inputs(session), k, i, before = 0, at;
    bool learns = hydroid_session_is_adapter(session);
    hydroid_sample_outcome outcome;
    hydroid_health health;
    hydroid_expert expert;
    if (hydroid_session_memory_len(session) > ROOM || hydroid_session_snapshot_len(session) > ROOM) {
        exit(3);
    }
    for (k = 0; k < SAMPLES; ++k) {
        if (k == SETTLED) {
            before = allocations;
        }
        for (i = 0; i < n; ++i) {
            y[i] = 0.3 + 0.01 * (double)((k * (i + 3)) % 7);
        }
        for (i = 0; i < m; ++i) {
            c[i] = 0.02 * (double)((k * (i + 1)) % 13);
        }
        check(hydroid_session_observe_heading(session, 0.01 * (double)k));
        check(hydroid_session_observe(session, y, n));
        check(hydroid_session_output(session, row, n));
        check(hydroid_session_output_through_water(session, row, n));
        check(hydroid_session_rollout(session, commands, HORIZON * m, ahead, HORIZON * n));
        check(hydroid_session_rollout_batch(session, 2, commands, HORIZON * m, ahead, HORIZON * n));
        check(hydroid_session_snapshot(session, memory, hydroid_session_snapshot_len(session)));
        if (learns) {
            check(hydroid_session_outcome(session, &outcome));
            check(hydroid_session_innovations(session, row, n, row + n, n));
            check(hydroid_session_health(session, &health));
            check(hydroid_session_active(session, &expert));
            /* Their memory grows with what was learned. */
            at = allocations;
            check(hydroid_session_deviations(session, commands, HORIZON * m, horizons, 2, ahead, 2 * n));
            allocations = k < SAMPLES * 2 / 3 ? at : allocations;
            check(hydroid_session_save(session, memory, hydroid_session_memory_len(session)));
            check(hydroid_session_scale_noise(session, 1.5));
            if (k == SAMPLES / 2) {
                check(hydroid_session_restart(session));
            }
        } else {
            check(hydroid_session_restore(session, memory, hydroid_session_snapshot_len(session)));
        }
        check(hydroid_session_advance(session, c, m));
        if (k == SAMPLES / 3) {
            check(hydroid_session_reset(session));
        }
    }
    return allocations - before;
}

static size_t simulated(const hydroid_model *model)
{
    hydroid_simulation *simulation = NULL;
    size_t n = hydroid_model_outputs(model), m = hydroid_model_inputs(model), k, before;
    double eta[3] = {0.0, 0.0, 0.0};
    check(hydroid_simulation_new(model, 0.1, 0.1, &simulation));
    check(hydroid_simulation_start(simulation, eta, 3, y, n, c, m));
    before = allocations;
    for (k = 0; k < SAMPLES; ++k) {
        check(hydroid_simulation_advance(simulation, c, m));
        check(hydroid_simulation_outputs(simulation, row, n));
        check(hydroid_simulation_eta(simulation, eta, 3));
        check(hydroid_simulation_nu_over_ground(simulation, eta, 3));
    }
    before = allocations - before;
    hydroid_simulation_free(simulation);
    return before;
}

int main(int count, char **arguments)
{
    const double noise[3] = {0.01, 0.01, 0.01};
    int argument, failures = 0;
    for (argument = 1; argument < count; ++argument) {
        hydroid_model *model = NULL;
        hydroid_session *session = NULL;
        size_t found[4] = {0, 0, 0, 0}, before = allocations;
        int guarded;
        check(hydroid_model_read(arguments[argument], &model));
        check(hydroid_model_session(model, &session));
        if (allocations == before) {
            fprintf(stderr, "allocations are not counted\n");
            return 2;
        }
        found[0] = along(session);
        hydroid_session_free(session);
        for (guarded = 0; guarded < 2; ++guarded) {
            hydroid_status status = hydroid_model_adapter(model, guarded == 1, NULL, noise, 3, &session);
            if (status == HYDROID_STATUS_UNSUPPORTED) {
                continue;
            }
            check(status);
            found[1 + guarded] = along(session);
            hydroid_session_free(session);
        }
        found[3] = simulated(model);
        if (found[0] + found[1] + found[2] + found[3] > 0) {
            fprintf(stderr, "%s: %u %u %u %u allocations\n", arguments[argument], (unsigned)found[0], (unsigned)found[1],
                    (unsigned)found[2], (unsigned)found[3]);
            ++failures;
        }
        hydroid_model_free(model);
    }
    return failures;
}
