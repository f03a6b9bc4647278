/* Wrong calls: each gives its status and a message. The arguments are files that the test wrote. */
#include <hydroid.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures;

static void expect(int line, hydroid_status found, hydroid_status expected, const char *part)
{
    if (found != expected || strstr(hydroid_last_error(), part) == NULL) {
        fprintf(stderr, "line %d: status %d, not %d: %s\n", line, (int)found, (int)expected, hydroid_last_error());
        ++failures;
    }
}

static void hold(int line, bool holds)
{
    if (!holds) {
        fprintf(stderr, "line %d: %s\n", line, hydroid_last_error());
        ++failures;
    }
}

#define EXPECT(call, status, part) expect(__LINE__, call, HYDROID_STATUS_##status, part)
#define HOLD(condition) hold(__LINE__, condition)
#define DO(call) expect(__LINE__, call, HYDROID_STATUS_OK, "")

static double y[3], c[2], numbers[4096];

static void models(char **files)
{
    hydroid_model *model = NULL, *other = NULL;
    char path[1000];
    static const unsigned char text[] = "[vessel]\nname = 3\n";
    EXPECT(hydroid_model_read(NULL, &model), POINTER, "path is null");
    EXPECT(hydroid_model_read(files[1], NULL), POINTER, "model is null");
    EXPECT(hydroid_model_read("\xff\xfe", &model), TEXT, "path is not UTF-8");
    EXPECT(hydroid_model_read("/nowhere/boat.safetensors", &model), FILE, "/nowhere/boat.safetensors");
    HOLD(model == NULL);
    EXPECT(hydroid_model_read(files[2], &model), FILE, "hydroid identify");
    EXPECT(hydroid_model_decode(NULL, 5, "mine", &model), POINTER, "bytes is null");
    EXPECT(hydroid_model_decode(NULL, 0, "mine", &model), FILE, "mine");
    EXPECT(hydroid_model_decode(text, sizeof text - 1, NULL, &model), FILE, "the model in memory");
    EXPECT(hydroid_model_decode(text, (size_t)-1, NULL, &model), LENGTH, "no memory is so large");
    HOLD(hydroid_model_outputs(NULL) == 0 && hydroid_model_inputs(NULL) == 0 && isnan(hydroid_model_dt(NULL)));
    HOLD(hydroid_model_name(NULL) == NULL && hydroid_model_kind(NULL) == NULL && !hydroid_model_needs_heading(NULL));
    DO(hydroid_model_read(files[1], &model));
    HOLD(hydroid_model_outputs(model) == 3 && hydroid_model_inputs(model) == 2);
    HOLD(fabs(hydroid_model_dt(model) - 0.1) < 1e-12 && !hydroid_model_needs_heading(model));
    HOLD(strcmp(hydroid_model_output_name(model, 2), "r") == 0 && strcmp(hydroid_model_output_unit(model, 2), "rad/s") == 0);
    HOLD(strcmp(hydroid_model_input_name(model, 1), "delta") == 0 && strcmp(hydroid_model_input_unit(model, 0), "1/s") == 0);
    HOLD(strcmp(hydroid_model_name(model), "equations") == 0 && strcmp(hydroid_model_kind(model), "sparse_equations") == 0);
    HOLD(hydroid_model_input_name(model, 2) == NULL && strstr(hydroid_last_error(), "no channel 2") != NULL);
    EXPECT(hydroid_model_at_step(model, 0.05, &other), VALUE, "sample time");
    /* A file is no folder. */
    snprintf(path, sizeof path, "%s/model", files[1]);
    EXPECT(hydroid_model_write(model, path), FILE, files[1]);
    EXPECT(hydroid_model_write(model, NULL), POINTER, "path is null");
    EXPECT(hydroid_model_frozen(NULL, &other), POINTER, "model is null");
    hydroid_model_free(model);
    hydroid_model_free(NULL);
    DO(hydroid_model_read("hydrofoil", &model));
    EXPECT(hydroid_model_at_step(model, -1.0, &other), VALUE, "");
    EXPECT(hydroid_model_at_step(model, NAN, &other), VALUE, "");
    DO(hydroid_model_at_step(model, 0.05, &other));
    HOLD(fabs(hydroid_model_dt(other) - 0.05) < 1e-12);
    hydroid_model_free(other);
    hydroid_model_free(model);
}

static void sessions(char **files)
{
    hydroid_model *model = NULL;
    hydroid_session *session = NULL, *other = NULL;
    hydroid_current current;
    hydroid_sample_outcome outcome;
    hydroid_health health;
    hydroid_expert expert;
    size_t horizon = 1, length;
    DO(hydroid_model_read(files[1], &model));
    EXPECT(hydroid_model_session(NULL, &session), POINTER, "model is null");
    EXPECT(hydroid_model_session(model, NULL), POINTER, "session is null");
    DO(hydroid_model_session(model, &session));
    EXPECT(hydroid_session_reset(NULL), POINTER, "session is null");
    HOLD(hydroid_session_outputs(NULL) == 0 && hydroid_session_warm_up(NULL) == 0 && hydroid_session_memory_len(NULL) == 0);
    EXPECT(hydroid_session_observe(session, y, 2), LENGTH, "y has 2 numbers: 3 are needed");
    EXPECT(hydroid_session_observe(session, NULL, 3), POINTER, "y is null");
    EXPECT(hydroid_session_observe(session, (const double *)((const char *)numbers + 1), 3), POINTER, "not aligned");
    EXPECT(hydroid_session_observe_heading(session, INFINITY), VALUE, "NaN");
    EXPECT(hydroid_session_advance(session, c, 3), LENGTH, "c has 3 numbers: 2 are needed");
    c[1] = NAN;
    EXPECT(hydroid_session_advance(session, c, 2), VALUE, "number 1 of c is NaN");
    EXPECT(hydroid_session_advance_observe(session, c, 2, y, 3), VALUE, "number 1 of c is NaN");
    c[1] = 0.0;
    EXPECT(hydroid_session_output(session, y, 4), LENGTH, "y has 4");
    EXPECT(hydroid_session_rollout(session, c, 2, numbers, 4), LENGTH, "a multiple of 3");
    EXPECT(hydroid_session_rollout(session, c, 2, numbers, 6), LENGTH, "commands has 2 numbers: 4 are needed");
    EXPECT(hydroid_session_rollout_batch(session, 0, c, 2, numbers, 3), VALUE, "count");
    EXPECT(hydroid_session_rollout_batch(session, (size_t)-1, c, 2, numbers, 3), VALUE, "count");
    EXPECT(hydroid_session_rollout_batch(session, 2, c, 2, numbers, 3), LENGTH, "a multiple of 6");
    DO(hydroid_session_rollout(session, NULL, 0, NULL, 0));
    EXPECT(hydroid_session_current(session, &current), UNSUPPORTED, "over ground");
    length = hydroid_session_snapshot_len(session);
    EXPECT(hydroid_session_snapshot(session, numbers, length + 1), LENGTH, "the snapshot");
    EXPECT(hydroid_session_restore(session, numbers, length - 1), LENGTH, "the snapshot");
    EXPECT(hydroid_session_fork(session, NULL), POINTER, "fork is null");
    /* A session that does not learn. */
    HOLD(!hydroid_session_is_adapter(session) && hydroid_session_weights_len(session) == 0);
    EXPECT(hydroid_session_outcome(session, &outcome), NOT_ADAPTER, "hydroid_model_adapter");
    EXPECT(hydroid_session_innovations(session, y, 3, numbers, 3), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_weights(session, NULL, 0), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_freeze(session, true), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_scale_noise(session, 2.0), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_restart(session), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_health(session, &health), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_active(session, &expert), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_deviations(session, c, 2, &horizon, 1, y, 3), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_store_window(session, y, 3, c, 2), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_save(session, numbers, 5), NOT_ADAPTER, "does not learn");
    EXPECT(hydroid_session_load(session, numbers, 5), NOT_ADAPTER, "does not learn");
    /* A session outlives its model. A call that makes no handle gives NULL. */
    hydroid_model_free(model);
    EXPECT(hydroid_session_learned(session, NULL, &model), NOT_ADAPTER, "does not learn");
    HOLD(!hydroid_session_is_sound(session) && model == NULL);
    DO(hydroid_session_observe(session, y, 3));
    DO(hydroid_session_fork(session, &other));
    hydroid_session_free(other);
    hydroid_session_free(session);
    hydroid_session_free(NULL);
}

static void options(const hydroid_model *model)
{
    static const char *const wrong[][2] = {
        {"{", "options, line 1"},
        {"metod = \"kalman\"", "line 1: unknown key metod"},
        {"huber = 3\nleek = 3", "line 2: unknown key leek, did you mean leak?"},
        {"learner = \"magic\"", "line 1: 'magic' is not a value of this key"},
        {"learner = \"kalman\"\nleak = \"long\"", "line 2: invalid type"},
        {"leak = 3", "leak is an option of the extended Kalman filter"},
        {"learner = \"kalman\"\nwindow = 3", "window is an option of recursive least squares"},
        {"learner = \"kalman\"\nrehearsal = { windows = 1e9 }", "line 2"},
        {"forgetting = 0.001", "the forgetting time is too short"},
        {"forgetting = -1", ""},
        {"window = 1e300", "window"},
        {"learner = \"kalman\"", "`noise` of hydroid_model_adapter"},
        {"learner = \"kalman\"\nnoise = { u = 0.1, v = 0.1 }", "the output 'r' is missing"},
        {"learner = \"kalman\"\nnoise = { u = 0.1, v = 0.1, r = 0 }", "the noise of 'r'"},
        {"estimate_current = -1", ""},
    };
    hydroid_session *session = NULL;
    static const double noise[3] = {0.1, 0.1, -0.1};
    size_t i;
    for (i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        hydroid_status status = hydroid_model_adapter(model, false, wrong[i][0], NULL, 0, &session);
        expect((int)i, status, HYDROID_STATUS_OPTIONS, wrong[i][1]);
        HOLD(session == NULL);
    }
    EXPECT(hydroid_model_adapter(model, false, "\xff", NULL, 0, &session), TEXT, "options is not UTF-8");
    EXPECT(hydroid_model_adapter(model, false, "learner = \"kalman\"", noise, 3, &session), OPTIONS, "the noise of 'r'");
    EXPECT(hydroid_model_adapter(model, false, "learner = \"kalman\"", noise, 2, &session), OPTIONS, "3 positive");
    EXPECT(hydroid_model_adapter(model, false, NULL, NULL, 3, &session), POINTER, "noise is null");
    EXPECT(hydroid_model_adapter(NULL, false, NULL, NULL, 0, &session), POINTER, "model is null");
    EXPECT(hydroid_model_adapter(model, false, NULL, NULL, 0, NULL), POINTER, "adapter is null");
    DO(hydroid_model_adapter(model, true, "no_guard = true", NULL, 0, &session));
    hydroid_session_free(session);
}

static void adapters(const hydroid_model *model)
{
    hydroid_session *session = NULL, *other = NULL;
    size_t horizons[2] = {1, 2}, length;
    bool sound;
    DO(hydroid_model_adapter(model, false, NULL, NULL, 0, &session));
    HOLD(hydroid_session_is_adapter(session) && hydroid_session_weights_len(session) > 0);
    DO(hydroid_session_observe(session, y, 3));
    EXPECT(hydroid_session_outcome(session, NULL), POINTER, "outcome is null");
    EXPECT(hydroid_session_innovations(session, y, 3, numbers, 2), LENGTH, "deviations");
    EXPECT(hydroid_session_weights(session, numbers, 1), LENGTH, "weights");
    EXPECT(hydroid_session_scale_noise(session, 0.0), VALUE, "factor");
    EXPECT(hydroid_session_scale_noise(session, NAN), VALUE, "factor");
    EXPECT(hydroid_session_deviations(session, numbers, 4, horizons, 2, numbers, 5), LENGTH, "deviations has 5 numbers: 6");
    EXPECT(hydroid_session_deviations(session, numbers, 3, horizons, 2, numbers + 9, 6), LENGTH, "commands has 3 numbers: 4");
    EXPECT(hydroid_session_deviations(session, NULL, 0, NULL, 0, NULL, 0), VALUE, "ascending");
    horizons[0] = 2;
    EXPECT(hydroid_session_deviations(session, numbers, 4, horizons, 2, numbers + 9, 6), VALUE, "[2, 2]");
    horizons[0] = 0;
    EXPECT(hydroid_session_deviations(session, numbers, 4, horizons, 2, numbers + 9, 6), VALUE, "from 1 on");
    horizons[1] = (size_t)-1;
    EXPECT(hydroid_session_deviations(session, numbers, 4, horizons + 1, 1, numbers + 9, 3), LENGTH, "commands");
    EXPECT(hydroid_session_store_window(session, y, 3, c, 2), UNSUPPORTED, "rehearsal");
    EXPECT(hydroid_session_learned(session, "\xff", NULL), POINTER, "model is null");
    length = hydroid_session_memory_len(session);
    HOLD(length > 2 && length < sizeof numbers / sizeof numbers[0]);
    EXPECT(hydroid_session_save(session, numbers, length - 1), LENGTH, "the memory");
    DO(hydroid_session_save(session, numbers, length));
    DO(hydroid_session_load(session, numbers, length));
    /* Memory of other options. */
    DO(hydroid_model_adapter(model, false, "forgetting = 50", NULL, 0, &other));
    HOLD(hydroid_session_memory_len(other) == length);
    EXPECT(hydroid_session_load(other, numbers, length), MEMORY, "of other options");
    hydroid_session_free(other);
    /* Damaged memory: the adapter is as before. */
    DO(hydroid_session_output(session, y, 3));
    {
        double before[3];
        size_t at;
        memcpy(before, y, sizeof y);
        for (at = 2; at < length; ++at) {
            numbers[at] = -INFINITY;
        }
        EXPECT(hydroid_session_load(session, numbers, length), MEMORY, "damaged");
        DO(hydroid_session_output(session, y, 3));
        HOLD(memcmp(before, y, sizeof y) == 0);
    }
    sound = hydroid_session_is_sound(session);
    HOLD(sound);
    hydroid_session_free(session);
}

static void simulations(char **files, const hydroid_model *model)
{
    hydroid_simulation *simulation = NULL;
    hydroid_model *other = NULL;
    hydroid_session *session = NULL;
    const double eta[3] = {0.0, 0.0, 0.0};
    DO(hydroid_model_read(files[3], &other));
    EXPECT(hydroid_simulation_new(other, 0.0, 0.0, &simulation), UNSUPPORTED, "u");
    hydroid_model_free(other);
    DO(hydroid_model_read("hydrofoil", &other));
    DO(hydroid_model_adapter(other, true, NULL, NULL, 0, &session));
    hydroid_session_free(session);
    hydroid_model_free(other);
    DO(hydroid_model_read(files[4], &other));
    EXPECT(hydroid_model_adapter(other, true, NULL, NULL, 0, &session), UNSUPPORTED, "hydroid_model_session");
    hydroid_model_free(other);
    EXPECT(hydroid_simulation_new(model, NAN, 0.0, &simulation), VALUE, "the current");
    DO(hydroid_simulation_new(model, 0.1, 0.0, &simulation));
    HOLD(hydroid_simulation_outputs_len(simulation) == 3 && hydroid_simulation_inputs_len(simulation) == 2);
    HOLD(hydroid_simulation_outputs_len(NULL) == 0 && hydroid_simulation_inputs_len(NULL) == 0);
    EXPECT(hydroid_simulation_start(simulation, eta, 2, y, 3, c, 2), LENGTH, "eta has 2");
    EXPECT(hydroid_simulation_start(simulation, eta, 3, y, 3, c, 1), LENGTH, "c has 1");
    EXPECT(hydroid_simulation_check(simulation), DIVERGED, "");
    DO(hydroid_simulation_start(simulation, eta, 3, y, 3, c, 2));
    DO(hydroid_simulation_advance(simulation, c, 2));
    DO(hydroid_simulation_check(simulation));
    EXPECT(hydroid_simulation_advance(simulation, c, 1), LENGTH, "c has 1");
    EXPECT(hydroid_simulation_eta(simulation, numbers, 2), LENGTH, "eta has 2");
    EXPECT(hydroid_simulation_nu_over_ground(simulation, numbers, 2), LENGTH, "nu has 2");
    EXPECT(hydroid_simulation_outputs(NULL, y, 3), POINTER, "simulation is null");
    hydroid_simulation_free(simulation);
    hydroid_simulation_free(NULL);
}

int main(int count, char **files)
{
    hydroid_model *model = NULL;
    if (count != 5 || strcmp(hydroid_last_error(), "") != 0 || strlen(hydroid_version()) < 5) {
        return 2;
    }
    models(files);
    sessions(files);
    DO(hydroid_model_read(files[1], &model));
    options(model);
    adapters(model);
    simulations(files, model);
    hydroid_model_free(model);
    return failures == 0 ? 0 : 1;
}
