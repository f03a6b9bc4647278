/* Follows a run with a session or an adapter, and writes all results as numbers. The test compares them with those of Rust.
 *
 * follow MODEL RUN RESULTS session|frozen
 * follow MODEL RUN RESULTS adapter|guarded OPTIONS MEMORY LEARNED
 */
#include <hydroid.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HORIZON 20
#define WINDOW 45

static FILE *results;

static void fail(const char *call)
{
    fprintf(stderr, "%s: %s\n", call, hydroid_last_error());
    exit(1);
}

#define DO(call)                           \
    do {                                   \
        if ((call) != HYDROID_STATUS_OK) { \
            fail(#call);                   \
        }                                  \
    } while (0)

static void record(const double *numbers, size_t count)
{
    if (fwrite(numbers, sizeof *numbers, count, results) != count) {
        fail("fwrite");
    }
}

static void record_one(double number)
{
    record(&number, 1);
}

static double *numbers(size_t count)
{
    double *made = (double *)malloc((count + 1) * sizeof *made);
    if (made == NULL) {
        fail("malloc");
    }
    return made;
}

/* A file of numbers, the first of which is their number. */
static double *read_numbers(const char *path, size_t *count)
{
    double head = 0.0;
    double *content;
    FILE *file = fopen(path, "rb");
    if (file == NULL || fread(&head, sizeof head, 1, file) != 1) {
        fail(path);
        exit(1);
    }
    *count = (size_t)head;
    content = numbers(*count);
    if (fread(content, sizeof *content, *count, file) != *count) {
        fail(path);
    }
    fclose(file);
    return content;
}

static void write_numbers(const char *path, const double *content, size_t count)
{
    double head = (double)count;
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(&head, sizeof head, 1, file) != 1 ||
        fwrite(content, sizeof *content, count, file) != count) {
        fail(path);
        exit(1);
    }
    fclose(file);
}

struct run {
    size_t samples;
    const double *noise, *headings, *y, *c;
};

/* A window of training data for the rehearsal. */
static void store_window(hydroid_session *session)
{
    size_t n = hydroid_session_outputs(session), m = hydroid_session_inputs(session), k;
    double *y = numbers(WINDOW * n), *c = numbers(WINDOW * m);
    for (k = 0; k < WINDOW * n; ++k) {
        y[k] = 0.3 + 0.01 * (double)(k % 5);
    }
    for (k = 0; k < WINDOW * m; ++k) {
        c[k] = 0.2 - 0.01 * (double)(k % 7);
    }
    DO(hydroid_session_store_window(session, y, WINDOW * n, c, WINDOW * m));
    free(y);
    free(c);
}

static hydroid_session *begin(const hydroid_model *model, const char *mode, const char *options, const double *noise)
{
    hydroid_session *session = NULL;
    if (strcmp(mode, "session") == 0) {
        DO(hydroid_model_session(model, &session));
    } else if (strcmp(mode, "frozen") == 0) {
        hydroid_model *frozen = NULL;
        DO(hydroid_model_frozen(model, &frozen));
        DO(hydroid_model_session(frozen, &session));
        hydroid_model_free(frozen);
    } else {
        DO(hydroid_model_adapter(model, strcmp(mode, "guarded") == 0, options, noise, hydroid_model_outputs(model), &session));
        if (strstr(options, "rehearsal") != NULL) {
            store_window(session);
        }
    }
    return session;
}

/* The session goes on in a new one. */
static hydroid_session *transfer(hydroid_session *old, const hydroid_model *model, char **arguments, const double *noise)
{
    hydroid_session *session = begin(model, arguments[4], arguments[5], noise);
    double *content;
    if (hydroid_session_is_adapter(old)) {
        size_t count = hydroid_session_memory_len(old);
        content = numbers(count);
        DO(hydroid_session_save(old, content, count));
        write_numbers(arguments[6], content, count);
        free(content);
        content = read_numbers(arguments[6], &count);
        DO(hydroid_session_load(session, content, count));
    } else {
        size_t count = hydroid_session_snapshot_len(old);
        content = numbers(count);
        DO(hydroid_session_snapshot(old, content, count));
        DO(hydroid_session_restore(session, content, count));
        record(content, count);
    }
    free(content);
    hydroid_session_free(old);
    return session;
}

static void record_sample(const hydroid_session *session, double *row)
{
    size_t n = hydroid_session_outputs(session);
    DO(hydroid_session_output(session, row, n));
    record(row, n);
    DO(hydroid_session_output_through_water(session, row, n));
    record(row, n);
    if (hydroid_session_is_adapter(session)) {
        hydroid_sample_outcome outcome;
        hydroid_expert expert;
        DO(hydroid_session_outcome(session, &outcome));
        record_one((double)outcome.kind);
        record_one(outcome.deviations);
        record_one(outcome.weight);
        DO(hydroid_session_innovations(session, row, n, row + n, n));
        record(row, 2 * n);
        DO(hydroid_session_active(session, &expert));
        record_one((double)expert);
        record_one(hydroid_session_is_sound(session) ? 1.0 : 0.0);
    }
}

static void record_predictions(hydroid_session *session, const double *commands)
{
    static const size_t horizons[] = {1, 5, HORIZON};
    size_t n = hydroid_session_outputs(session), m = hydroid_session_inputs(session);
    double *y = numbers(HORIZON * n);
    hydroid_session *fork = NULL;
    DO(hydroid_session_rollout(session, commands, HORIZON * m, y, HORIZON * n));
    record(y, HORIZON * n);
    DO(hydroid_session_fork(session, &fork));
    DO(hydroid_session_rollout_batch(fork, 2, commands, HORIZON * m, y, HORIZON * n));
    record(y, HORIZON * n);
    hydroid_session_free(fork);
    if (hydroid_session_is_adapter(session)) {
        DO(hydroid_session_deviations(session, commands, HORIZON * m, horizons, 3, y, 3 * n));
        record(y, 3 * n);
    }
    free(y);
}

static void record_end(hydroid_session *session, char **arguments)
{
    size_t count = hydroid_session_weights_len(session);
    double *weights = numbers(count);
    hydroid_health health;
    hydroid_model *learned = NULL;
    DO(hydroid_session_weights(session, weights, count));
    record(weights, count);
    free(weights);
    DO(hydroid_session_health(session, &health));
    record_one(health.least_variance);
    record_one(health.min_s_over_r);
    DO(hydroid_session_learned(session, "the run", &learned));
    DO(hydroid_model_write(learned, arguments[7]));
    hydroid_model_free(learned);
}

int main(int count, char **arguments)
{
    hydroid_model *model = NULL;
    hydroid_session *session;
    hydroid_current current;
    struct run run;
    size_t n, m, k, length;
    double *content, *row;
    if (count < 5) {
        return 2;
    }
    DO(hydroid_model_read(arguments[1], &model));
    n = hydroid_model_outputs(model);
    m = hydroid_model_inputs(model);
    content = read_numbers(arguments[2], &length);
    run.samples = (length - n) / (1 + n + m);
    run.noise = content;
    run.headings = content + n;
    run.y = run.headings + run.samples;
    run.c = run.y + run.samples * n;
    results = fopen(arguments[3], "wb");
    row = numbers(2 * n);
    session = begin(model, arguments[4], arguments[5], run.noise);
    record_one((double)hydroid_session_warm_up(session));
    DO(hydroid_session_observe_heading(session, run.headings[0]));
    DO(hydroid_session_observe(session, run.y, n));
    record_sample(session, row);
    for (k = 1; k < run.samples; ++k) {
        const double *y = run.y + k * n, *c = run.c + (k - 1) * m;
        DO(hydroid_session_observe_heading(session, run.headings[k]));
        if (k == run.samples / 4 && hydroid_session_is_adapter(session)) {
            DO(hydroid_session_scale_noise(session, 4.0));
        }
        if (k % 3 == 0) {
            DO(hydroid_session_advance_observe(session, c, m, y, n));
        } else {
            DO(hydroid_session_advance(session, c, m));
            DO(hydroid_session_observe(session, y, n));
        }
        record_sample(session, row);
        if (k % 40 == 10 && k + HORIZON <= run.samples) {
            record_predictions(session, run.c + k * m);
        }
        if (k == run.samples / 2) {
            session = transfer(session, model, arguments, run.noise);
        }
    }
    if (hydroid_session_current(session, &current) == HYDROID_STATUS_OK) {
        record_one(current.north);
        record_one(current.east);
        record_one(current.variance_north);
        record_one(current.covariance);
        record_one(current.variance_east);
    }
    if (hydroid_session_is_adapter(session)) {
        record_end(session, arguments);
        DO(hydroid_session_freeze(session, true));
        DO(hydroid_session_restart(session));
    }
    DO(hydroid_session_reset(session));
    DO(hydroid_session_observe(session, run.y, n));
    record_sample(session, row);
    hydroid_session_free(session);
    hydroid_model_free(model);
    free(row);
    free(content);
    fclose(results);
    return 0;
}
