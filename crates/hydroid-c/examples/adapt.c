/* Adapts a model along a log and predicts with bands.
 *
 *     adapt MODEL LOG.csv [LEARNED]
 *
 * The log is a table with a header, as `hydroid simulate` writes it: a column for each output and input of the model, by name,
 * with a row for each sample time of the model. An empty field is a missing value. The learned model is written to LEARNED.
 */
#include <hydroid.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Samples ahead of a prediction, and its interval. */
#define AHEAD 20
#define EVERY 100
#define MOST_COLUMNS 64
#define LINE 4096

static void check(hydroid_status status)
{
    if (status != HYDROID_STATUS_OK) {
        fprintf(stderr, "error: %s\n", hydroid_last_error());
        exit(1);
    }
}

static double *numbers(size_t count)
{
    double *made = (double *)calloc(count + 1, sizeof *made);
    if (made == NULL) {
        fprintf(stderr, "error: no memory\n");
        exit(1);
    }
    return made;
}

/* The end of a field, which ends with a comma or the line. */
static char *end_of(char *field)
{
    return field + strcspn(field, ",\r\n");
}

/* The place of a name in the header; a unit in brackets may follow it. */
static size_t column(const char *header, const char *name)
{
    char copy[LINE];
    char *field = copy;
    size_t place;
    memcpy(copy, header, sizeof copy);
    for (place = 0; place < MOST_COLUMNS; ++place) {
        char *end = end_of(field);
        size_t length = strcspn(field, " [,\r\n");
        if (length == strlen(name) && strncmp(field, name, length) == 0) {
            return place;
        }
        if (*end != ',') {
            break;
        }
        field = end + 1;
    }
    fprintf(stderr, "error: the log has no column '%s'\n", name);
    exit(1);
}

/* The fields of a row; NAN for one that is missing. */
static void read_row(char *line, double *fields)
{
    char *field = line;
    size_t place;
    for (place = 0; place < MOST_COLUMNS; ++place) {
        fields[place] = NAN;
    }
    for (place = 0; place < MOST_COLUMNS; ++place) {
        char *end = end_of(field), *read;
        double number = strtod(field, &read);
        if (read > field && read <= end) {
            fields[place] = number;
        }
        if (*end != ',') {
            break;
        }
        field = end + 1;
    }
}

/* Predictions with the present command held, and the bands of 80 % around them. */
static void predict(hydroid_session *session, const hydroid_model *model, double t, const double *c)
{
    size_t n = hydroid_model_outputs(model), m = hydroid_model_inputs(model), k, i;
    const size_t horizon = AHEAD;
    double *commands = numbers(AHEAD * m), *y = numbers(AHEAD * n), *deviations = numbers(n);
    for (k = 0; k < AHEAD; ++k) {
        memcpy(commands + k * m, c, m * sizeof *c);
    }
    check(hydroid_session_rollout(session, commands, AHEAD * m, y, AHEAD * n));
    check(hydroid_session_deviations(session, commands, AHEAD * m, &horizon, 1, deviations, n));
    printf("%8.1f s:", t + AHEAD * hydroid_model_dt(model));
    for (i = 0; i < n; ++i) {
        printf("  %s = %.3f +- %.3f %s", hydroid_model_output_name(model, i), y[(AHEAD - 1) * n + i],
               HYDROID_BAND_80 * deviations[i], hydroid_model_output_unit(model, i));
    }
    printf("\n");
    free(commands);
    free(y);
    free(deviations);
}

int main(int count, char **arguments)
{
    hydroid_model *model = NULL, *learned = NULL;
    hydroid_session *session = NULL;
    hydroid_sample_outcome outcome;
    size_t places[MOST_COLUMNS], n, m, i, sample, accepted = 0;
    double fields[MOST_COLUMNS], *y, *c;
    char line[LINE];
    FILE *log;
    if (count < 3) {
        fprintf(stderr, "usage: adapt MODEL LOG.csv [LEARNED]\n");
        return 2;
    }
    check(hydroid_model_read(arguments[1], &model));
    n = hydroid_model_outputs(model);
    m = hydroid_model_inputs(model);
    log = fopen(arguments[2], "r");
    if (log == NULL || fgets(line, sizeof line, log) == NULL || n + m > MOST_COLUMNS) {
        fprintf(stderr, "error: cannot read %s\n", arguments[2]);
        return 1;
    }
    for (i = 0; i < n; ++i) {
        places[i] = column(line, hydroid_model_output_name(model, i));
    }
    for (i = 0; i < m; ++i) {
        places[n + i] = column(line, hydroid_model_input_name(model, i));
    }
    /* With a guard, default options, and the noise of the model file. */
    check(hydroid_model_adapter(model, true, NULL, NULL, 0, &session));
    y = numbers(n);
    c = numbers(m);
    for (sample = 0; fgets(line, sizeof line, log) != NULL; ++sample) {
        read_row(line, fields);
        for (i = 0; i < n; ++i) {
            y[i] = fields[places[i]];
        }
        /* A missing command is the last one. */
        for (i = 0; i < m; ++i) {
            c[i] = isfinite(fields[places[n + i]]) ? fields[places[n + i]] : c[i];
        }
        check(hydroid_session_observe(session, y, n));
        check(hydroid_session_outcome(session, &outcome));
        accepted += outcome.kind == HYDROID_OUTCOME_ACCEPTED;
        if (sample % EVERY == EVERY - 1) {
            predict(session, model, (double)sample * hydroid_model_dt(model), c);
        }
        check(hydroid_session_advance(session, c, m));
    }
    printf("%lu samples, %lu of them accepted\n", (unsigned long)sample, (unsigned long)accepted);
    if (count > 3) {
        check(hydroid_session_learned(session, arguments[2], &learned));
        check(hydroid_model_write(learned, arguments[3]));
        hydroid_model_free(learned);
    }
    hydroid_session_free(session);
    hydroid_model_free(model);
    free(y);
    free(c);
    fclose(log);
    return 0;
}
