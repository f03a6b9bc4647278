/* Simulates a model from the bytes of its file: simulate MODEL DT RESULTS. The sample time is changed where DT is positive. */
#include <hydroid.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define SAMPLES 300

static void check(hydroid_status status)
{
    if (status != HYDROID_STATUS_OK) {
        fprintf(stderr, "%s\n", hydroid_last_error());
        exit(1);
    }
}

int main(int count, char **arguments)
{
    hydroid_model *model = NULL, *changed = NULL;
    hydroid_simulation *simulation = NULL;
    unsigned char *bytes;
    size_t length, n, m, k, i;
    double dt, *y, *c, pose[3] = {10.0, -20.0, 1.0};
    FILE *file, *results;
    if (count != 4 || (file = fopen(arguments[1], "rb")) == NULL || (results = fopen(arguments[3], "wb")) == NULL) {
        return 2;
    }
    bytes = (unsigned char *)malloc(10000000);
    length = fread(bytes, 1, 10000000, file);
    fclose(file);
    check(hydroid_model_decode(bytes, length, arguments[1], &model));
    free(bytes);
    dt = atof(arguments[2]);
    if (dt > 0.0) {
        check(hydroid_model_at_step(model, dt, &changed));
        hydroid_model_free(model);
        model = changed;
    }
    n = hydroid_model_outputs(model);
    m = hydroid_model_inputs(model);
    y = (double *)calloc(n, sizeof *y);
    c = (double *)calloc(m + 1, sizeof *c);
    check(hydroid_simulation_new(model, 0.2, -0.1, &simulation));
    hydroid_model_free(model);
    for (i = 0; i < n; ++i) {
        y[i] = 0.1 * (double)i + 0.2;
    }
    check(hydroid_simulation_start(simulation, pose, 3, y, n, c, m));
    for (k = 0; k < SAMPLES; ++k) {
        for (i = 0; i < m; ++i) {
            c[i] = 0.01 * (double)((k * (i + 1)) % 37);
        }
        check(hydroid_simulation_advance(simulation, c, m));
        check(hydroid_simulation_outputs(simulation, y, n));
        fwrite(y, sizeof *y, n, results);
        check(hydroid_simulation_eta(simulation, pose, 3));
        fwrite(pose, sizeof *pose, 3, results);
        check(hydroid_simulation_nu_over_ground(simulation, pose, 3));
        fwrite(pose, sizeof *pose, 3, results);
    }
    check(hydroid_simulation_check(simulation));
    hydroid_simulation_free(simulation);
    free(y);
    free(c);
    fclose(results);
    return 0;
}
