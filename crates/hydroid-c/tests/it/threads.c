/* Several threads: each with a session of its own, and all with one session. */
#include <hydroid.h>

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define THREADS 4
#define SAMPLES 500

static hydroid_model *model;
static hydroid_session *shared;

struct result {
    pthread_t thread;
    double output[3];
    char message[200];
    /* Number of the thread, then of its failures. */
    int failed;
};

static void *work(void *argument)
{
    struct result *result = (struct result *)argument;
    hydroid_session *session = NULL;
    double c[2], y[3], ahead[60], commands[40];
    size_t k, i;
    int failed = 0;
    const double noise[3] = {0.01, 0.01, 0.01};
    failed += hydroid_model_adapter(model, true, NULL, noise, 3, &session) != HYDROID_STATUS_OK;
    memset(commands, 0, sizeof commands);
    for (k = 0; k < SAMPLES; ++k) {
        for (i = 0; i < 3; ++i) {
            y[i] = 0.3 + 0.01 * (double)((k * (i + 3)) % 7);
        }
        c[0] = 0.1 * (double)(k % 11);
        c[1] = 0.02 * (double)(k % 13) - 0.1;
        failed += hydroid_session_observe(session, y, 3) != HYDROID_STATUS_OK;
        failed += hydroid_session_output(session, result->output, 3) != HYDROID_STATUS_OK;
        failed += hydroid_session_advance(session, c, 2) != HYDROID_STATUS_OK;
        /* The session of all. */
        failed += hydroid_session_advance_observe(shared, c, 2, y, 3) != HYDROID_STATUS_OK;
        failed += hydroid_session_rollout(shared, commands, 40, ahead, 60) != HYDROID_STATUS_OK;
    }
    /* Each thread has a message of its own. */
    failed += hydroid_session_observe(session, y, (size_t)(result->failed + 100)) != HYDROID_STATUS_LENGTH;
    strncpy(result->message, hydroid_last_error(), sizeof result->message - 1);
    hydroid_session_free(session);
    result->failed = failed;
    return NULL;
}

int main(int count, char **arguments)
{
    static struct result results[THREADS];
    int k, failed = 0;
    char expected[200];
    if (count != 2 || hydroid_model_read(arguments[1], &model) != HYDROID_STATUS_OK ||
        hydroid_model_adapter(model, false, NULL, NULL, 0, &shared) != HYDROID_STATUS_OK) {
        fprintf(stderr, "%s\n", hydroid_last_error());
        return 1;
    }
    for (k = 0; k < THREADS; ++k) {
        results[k].failed = k;
        failed += pthread_create(&results[k].thread, NULL, work, &results[k]) != 0;
    }
    for (k = 0; k < THREADS; ++k) {
        failed += pthread_join(results[k].thread, NULL) != 0;
        failed += results[k].failed;
        failed += memcmp(results[k].output, results[0].output, sizeof results[0].output) != 0;
        sprintf(expected, "y has %d numbers: 3 are needed", 100 + k);
        if (strcmp(results[k].message, expected) != 0) {
            fprintf(stderr, "%s\n", results[k].message);
            ++failed;
        }
    }
    failed += strcmp(hydroid_last_error(), "") != 0;
    hydroid_session_free(shared);
    hydroid_model_free(model);
    return failed;
}
