/*
 * hydroid: prediction, adaptation and simulation of surface vessels.
 * Generated from the sources of hydroid-c by cbindgen; not to be edited.
 *
 * A session follows a run sample by sample, and predicts from any sample on:
 *
 *     observe(y_0)   advance(c_0)   observe(y_1)   advance(c_1)   observe(y_2) ...
 *                 |                              |
 *              rollout(c_0, c_1, ..)          rollout(c_1, c_2, ..)
 *
 * Sample k is the measurement y_k at t_k. The command c_k is held from t_k to t_{k+1}. An adapter is a session that learns
 * in observe.
 *
 * Arrays. Each array comes with its length in numbers, which is checked. A matrix is stored row by row. The arrays of a call do
 * not overlap. An empty array may be NULL. Numbers are in the units of the channels of the model; SI units and radians
 * elsewhere.
 *
 * Memory. A function that makes a handle stores it behind its last argument, and the caller frees it once, by the function
 * of its type. Other arrays belong to the caller. Texts end with a zero; those that functions return belong to the handle.
 * Only functions whose comment says so allocate, and an error allocates its message. A program that runs out of memory ends.
 *
 * Threads. Each function can be called by any thread. Calls on one session or one simulation wait for each other; those on a
 * model do not. A handle must not be freed while another call uses it.
 *
 * Errors. A function that can fail returns a status, and hydroid_last_error() of the same thread states cause, place and
 * remedy. Arguments are not changed by a call that fails, except where a comment says so. The content of arrays that a failed call
 * would have written is not defined.
 */


#ifndef HYDROID_H
#define HYDROID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * Half of the width of a band that contains a measurement with a probability of 80 %, in standard deviations.
 */
#define HYDROID_BAND_80 1.28155

/**
 * Half of the width of a band that contains a measurement with a probability of 95 %, in standard deviations.
 */
#define HYDROID_BAND_95 1.95996

/**
 * Result of a call. The message of hydroid_last_error() names the cause and a remedy.
 */
typedef enum {
    /**
     * The call succeeded.
     */
    HYDROID_STATUS_OK = 0,
    /**
     * A pointer is null, or not aligned for its type.
     */
    HYDROID_STATUS_POINTER = 1,
    /**
     * An array has another length than the one that is needed.
     */
    HYDROID_STATUS_LENGTH = 2,
    /**
     * A text is not UTF-8.
     */
    HYDROID_STATUS_TEXT = 3,
    /**
     * A number is outside its range.
     */
    HYDROID_STATUS_VALUE = 4,
    /**
     * A file cannot be read or written, or its content is not a model.
     */
    HYDROID_STATUS_FILE = 5,
    /**
     * The options of an adapter are invalid.
     */
    HYDROID_STATUS_OPTIONS = 6,
    /**
     * The kind of model has no such function.
     */
    HYDROID_STATUS_UNSUPPORTED = 7,
    /**
     * The session does not learn: it is not an adapter.
     */
    HYDROID_STATUS_NOT_ADAPTER = 8,
    /**
     * The memory is not one of an adapter of the same model, options and version, or it is damaged.
     */
    HYDROID_STATUS_MEMORY = 9,
    /**
     * A simulation has numbers that are not finite.
     */
    HYDROID_STATUS_DIVERGED = 10,
    /**
     * An internal error ended an earlier call of this handle, which can only be freed.
     */
    HYDROID_STATUS_FAILED = 11,
    /**
     * An internal error ended the call. The handle can only be freed.
     */
    HYDROID_STATUS_INTERNAL = 12,
} hydroid_status;

/**
 * Effect of a sample on the weights.
 */
typedef enum {
    /**
     * No update: a window is incomplete, a value is missing, or the adapter is frozen.
     */
    HYDROID_OUTCOME_WAITING = 0,
    /**
     * Update with full weight.
     */
    HYDROID_OUTCOME_ACCEPTED = 1,
    /**
     * Update with a reduced weight.
     */
    HYDROID_OUTCOME_INFLATED = 2,
    /**
     * No update: an innovation exceeds the upper threshold of the gate.
     */
    HYDROID_OUTCOME_OUTLIER = 3,
    /**
     * No update: a value is infinite, or its square overflows.
     */
    HYDROID_OUTCOME_NOT_FINITE = 4,
    /**
     * The weights were restored from an earlier snapshot.
     */
    HYDROID_OUTCOME_ROLLED_BACK = 5,
} hydroid_outcome;

/**
 * A model from which an adapter predicts.
 */
typedef enum {
    /**
     * The adapted model.
     */
    HYDROID_EXPERT_ADAPTED = 0,
    /**
     * The reference model: the weights of the file with a filter on the state.
     */
    HYDROID_EXPERT_REFERENCE = 1,
    /**
     * The adapted model as it would be without a guard.
     */
    HYDROID_EXPERT_UNGUARDED = 2,
} hydroid_expert;

/**
 * A model: constant after it was read, so that any number of threads can use it.
 */
typedef struct hydroid_model hydroid_model;

/**
 * A session of a model on one run. It follows the run sample by sample and predicts from any sample on. An adapter also
 * learns from the measurements.
 */
typedef struct hydroid_session hydroid_session;

/**
 * A model that runs freely, without measurements: the motion from the model, the pose by kinematics.
 */
typedef struct hydroid_simulation hydroid_simulation;

/**
 * An estimate of the current.
 */
typedef struct {
    /**
     * Component north [m/s].
     */
    double north;
    /**
     * Component east [m/s].
     */
    double east;
    /**
     * Variance of the component north [m^2/s^2].
     */
    double variance_north;
    /**
     * Covariance of both components [m^2/s^2].
     */
    double covariance;
    /**
     * Variance of the component east [m^2/s^2].
     */
    double variance_east;
} hydroid_current;

/**
 * Effect of a sample on the weights, with its numbers.
 */
typedef struct {
    /**
     * What the sample did.
     */
    hydroid_outcome kind;
    /**
     * The largest innovation [standard deviations], for HYDROID_OUTCOME_INFLATED and HYDROID_OUTCOME_OUTLIER; else NaN.
     */
    double deviations;
    /**
     * Weight relative to an accepted sample: 1 if accepted, between 0 and 1 if inflated, else 0.
     */
    double weight;
} hydroid_sample_outcome;

/**
 * Indicators of the covariance that precede prediction errors; NaN if unknown or correct by construction.
 */
typedef struct {
    /**
     * The smallest variance of a weight or a hidden state, in its scaled unit. A negative one is a fault.
     */
    double least_variance;
    /**
     * The smallest ratio of innovation variance and noise variance at the last measurement; at least 1 up to rounding.
     */
    double min_s_over_r;
} hydroid_health;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The message of the last error in this thread: cause, place and remedy. An empty text before the first error.
 * Valid until the next error in this thread.
 */
const char *hydroid_last_error(void);

/**
 * The version of the library, such as "0.2.0". It belongs to the library.
 */
const char *hydroid_version(void);

/**
 * Reads a model file (.safetensors), a vessel file (.toml), or a built-in vessel by its name. Allocates.
 *
 * path: text in UTF-8.
 * model: receives the model; NULL after an error. Freed by hydroid_model_free().
 */
hydroid_status hydroid_model_read(const char *path, hydroid_model **model);

/**
 * Reads a model from the content of its file. Allocates.
 *
 * bytes, bytes_len: the content of a model file or a vessel file.
 * name: a name for messages, or NULL.
 * model: receives the model; NULL after an error. Freed by hydroid_model_free().
 */
hydroid_status hydroid_model_decode(const uint8_t *bytes,
                                    size_t bytes_len,
                                    const char *name,
                                    hydroid_model **model);

/**
 * Writes a model file; a vessel as its vessel file. The file is written completely or not at all. Allocates.
 */
hydroid_status hydroid_model_write(const hydroid_model *model, const char *path);

/**
 * Frees a model. Sessions and simulations of it stay valid. NULL is ignored.
 */
void hydroid_model_free(hydroid_model *model);

/**
 * A vessel at another sample time dt [s]. The sample time of an identified model is fixed. Allocates.
 *
 * changed: receives the model; NULL after an error. Freed by hydroid_model_free().
 */
hydroid_status hydroid_model_at_step(const hydroid_model *model, double dt, hydroid_model **changed);

/**
 * The model with constant weights: sessions of a committee, and of a model that was identified with online learning,
 * adapt coefficients inside; those of the frozen model do not. Allocates.
 *
 * frozen: receives the model; NULL after an error. Freed by hydroid_model_free().
 */
hydroid_status hydroid_model_frozen(const hydroid_model *model,
                                    hydroid_model **frozen);

/**
 * Number of outputs; 0 after an error.
 */
size_t hydroid_model_outputs(const hydroid_model *model);

/**
 * Number of inputs; 0 after an error.
 */
size_t hydroid_model_inputs(const hydroid_model *model);

/**
 * Sample time [s]; NaN after an error.
 */
double hydroid_model_dt(const hydroid_model *model);

/**
 * Whether the model predicts the motion through the water and estimates the current: its sessions need the heading of
 * each sample, by hydroid_session_observe_heading(). False after an error.
 */
bool hydroid_model_needs_heading(const hydroid_model *model);

/**
 * Name of the model, such as "gru". It belongs to the model; NULL after an error.
 */
const char *hydroid_model_name(const hydroid_model *model);

/**
 * Kind of the model, as in its file. It belongs to the model; NULL after an error.
 */
const char *hydroid_model_kind(const hydroid_model *model);

/**
 * Name of an output, from 0 on. It belongs to the model; NULL after an error.
 */
const char *hydroid_model_output_name(const hydroid_model *model, size_t index);

/**
 * Unit of an output, such as "m/s"; empty if unknown. It belongs to the model; NULL after an error.
 */
const char *hydroid_model_output_unit(const hydroid_model *model, size_t index);

/**
 * Name of an input, from 0 on. It belongs to the model; NULL after an error.
 */
const char *hydroid_model_input_name(const hydroid_model *model, size_t index);

/**
 * Unit of an input; empty if unknown. It belongs to the model; NULL after an error.
 */
const char *hydroid_model_input_unit(const hydroid_model *model, size_t index);

/**
 * A session of the model at the start of a run. Allocates.
 *
 * session: receives the session; NULL after an error. Freed by hydroid_session_free().
 */
hydroid_status hydroid_model_session(const hydroid_model *model, hydroid_session **session);

/**
 * A session that learns from the measurements, at the start of a run. Allocates.
 *
 * guarded: with a guard, which detects faults of sensors and bounds the error of the adapted model by that of the
 *     model as it was read.
 * options: lines of the section [adapt] of a configuration file (TOML), such as "leak = 600\nhuber = inf", or NULL for the
 *     defaults. With the option estimate_current, the session needs the heading of each sample.
 * noise, noise_len: standard deviation of the measurement noise of each output, in its unit; or NULL and 0 for those of
 *     the model file. Kalman filters need one of the two.
 * adapter: receives the session; NULL after an error. Freed by hydroid_session_free().
 */
hydroid_status hydroid_model_adapter(const hydroid_model *model,
                                     bool guarded,
                                     const char *options,
                                     const double *noise,
                                     size_t noise_len,
                                     hydroid_session **adapter);

/**
 * Frees a session or an adapter. NULL is ignored.
 */
void hydroid_session_free(hydroid_session *session);

/**
 * Number of outputs; 0 after an error.
 */
size_t hydroid_session_outputs(const hydroid_session *session);

/**
 * Number of inputs; 0 after an error.
 */
size_t hydroid_session_inputs(const hydroid_session *session);

/**
 * Number of samples that a session must observe before its predictions are valid; 0 after an error.
 */
size_t hydroid_session_warm_up(const hydroid_session *session);

/**
 * Whether the session learns, so that the functions of adapters can be called. False after an error.
 */
bool hydroid_session_is_adapter(const hydroid_session *session);

/**
 * Returns to the start of a run: outputs, hidden states and lags are cleared. Learned weights stay.
 */
hydroid_status hydroid_session_reset(hydroid_session *session);

/**
 * Takes the heading [rad] of the sample that is observed next, clockwise from north; NaN if it is missing. Models of
 * the motion over ground ignore it. See hydroid_model_needs_heading().
 */
hydroid_status hydroid_session_observe_heading(hydroid_session *session,
                                               double heading);

/**
 * Takes the measurement of the present sample. An adapter learns from it. Allocates in the first test of a guard, and in
 * the first window of an estimate of the current.
 *
 * y, y_len: the outputs in their units. NaN is a missing value, for which the session keeps its own prediction. An
 *     adapter rejects infinite values; a session that does not learn believes them.
 */
hydroid_status hydroid_session_observe(hydroid_session *session,
                                       const double *y,
                                       size_t y_len);

/**
 * Steps to the next sample.
 *
 * c, c_len: the command that is held from the present sample to the next, one finite number for each input, in its unit.
 */
hydroid_status hydroid_session_advance(hydroid_session *session,
                                       const double *c,
                                       size_t c_len);

/**
 * hydroid_session_advance() and hydroid_session_observe() in one. A model may omit the prediction where a complete
 * measurement replaces it. Allocates as hydroid_session_observe().
 */
hydroid_status hydroid_session_advance_observe(hydroid_session *session,
                                               const double *c,
                                               size_t c_len,
                                               const double *y,
                                               size_t y_len);

/**
 * The estimate of the present outputs; NaN where there is none yet.
 *
 * y, y_len: receives a number for each output, in its unit.
 */
hydroid_status hydroid_session_output(const hydroid_session *session, double *y, size_t y_len);

/**
 * As hydroid_session_output(), with the motion through the water.
 */
hydroid_status hydroid_session_output_through_water(const hydroid_session *session, double *y, size_t y_len);

/**
 * The estimate of the current. HYDROID_STATUS_UNSUPPORTED for a model of the motion over ground.
 */
hydroid_status hydroid_session_current(const hydroid_session *session, hydroid_current *current);

/**
 * Predicts the next samples under given commands, and does not change the session. Allocates while its memory grows:
 * in the first call of a size, and in the first calls of a guarded adapter.
 *
 * commands, commands_len: samples x inputs numbers, sample by sample; the first command acts from the present sample on.
 * y, y_len: receives samples x outputs numbers, sample by sample; the first row is the next sample. y_len determines the
 *     number of samples. A prediction that diverges is not finite, and no error.
 */
hydroid_status hydroid_session_rollout(const hydroid_session *session,
                                       const double *commands,
                                       size_t commands_len,
                                       double *y,
                                       size_t y_len);

/**
 * Predicts under count sequences of commands from the present sample, side by side where the model can: for planners.
 * Results differ from those of hydroid_session_rollout() in the last digits. Allocates as
 * that function.
 *
 * commands, commands_len: count x samples x inputs numbers, sequence by sequence.
 * y, y_len: receives count x samples x outputs numbers.
 */
hydroid_status hydroid_session_rollout_batch(const hydroid_session *session,
                                             size_t count,
                                             const double *commands,
                                             size_t commands_len,
                                             double *y,
                                             size_t y_len);

/**
 * Length of a snapshot, constant over the life of a session; 0 after an error.
 */
size_t hydroid_session_snapshot_len(const hydroid_session *session);

/**
 * Copies the numbers on which predictions depend: outputs, lags, hidden states, and learned weights.
 *
 * numbers, numbers_len: receives hydroid_session_snapshot_len() numbers.
 */
hydroid_status hydroid_session_snapshot(const hydroid_session *session, double *numbers, size_t numbers_len);

/**
 * Restores a snapshot of a session of the same model. The memory that serves learning alone stays.
 */
hydroid_status hydroid_session_restore(hydroid_session *session, const double *numbers, size_t numbers_len);

/**
 * A new session with the same predictions. That of an adapter does not learn. Allocates.
 *
 * fork: receives the session; NULL after an error. Freed by hydroid_session_free().
 */
hydroid_status hydroid_session_fork(const hydroid_session *session, hydroid_session **fork);

/**
 * Effect of the last observed sample on the weights.
 */
hydroid_status hydroid_session_outcome(const hydroid_session *session, hydroid_sample_outcome *outcome);

/**
 * Innovation (measurement minus prediction) of each output at the last sample before the update, and its standard
 * deviation, in the unit of the output. NaN if the outcome is HYDROID_OUTCOME_WAITING.
 *
 * values, values_len: receives a number for each output.
 * deviations, deviations_len: receives a number for each output.
 */
hydroid_status hydroid_session_innovations(const hydroid_session *session,
                                           double *values,
                                           size_t values_len,
                                           double *deviations,
                                           size_t deviations_len);

/**
 * Number of learned weights, constant over the life of a session; 0 for one that does not learn.
 */
size_t hydroid_session_weights_len(const hydroid_session *session);

/**
 * The learned weights, in the units and order of the model.
 *
 * weights, weights_len: receives hydroid_session_weights_len() numbers.
 */
hydroid_status hydroid_session_weights(const hydroid_session *session, double *weights, size_t weights_len);

/**
 * Stops or resumes learning. A frozen adapter predicts with its present weights.
 */
hydroid_status hydroid_session_freeze(hydroid_session *session, bool frozen);

/**
 * Multiplies the noise variance of the next measurement by a positive factor.
 */
hydroid_status hydroid_session_scale_noise(hydroid_session *session, double factor);

/**
 * Resets the covariance of the weights to its initial value. The weights stay.
 */
hydroid_status hydroid_session_restart(hydroid_session *session);

/**
 * Indicators of the covariance.
 */
hydroid_status hydroid_session_health(const hydroid_session *session, hydroid_health *health);

/**
 * The model from which a guarded adapter predicts. HYDROID_EXPERT_ADAPTED without a guard.
 */
hydroid_status hydroid_session_active(const hydroid_session *session, hydroid_expert *expert);

/**
 * Standard deviations of the measurements around the predictions of hydroid_session_rollout(), from the uncertainty of
 * weights and state and from the measurement noise. A band of HYDROID_BAND_80 standard deviations contains the
 * measurement with a probability of 80 %. Allocates while its memory grows, with the size and with the first updates.
 *
 * commands, commands_len: samples x inputs numbers, as many samples as the last horizon.
 * horizons, horizons_len: samples ahead, ascending, from 1 on.
 * deviations, deviations_len: receives horizons x outputs numbers, in the units of the outputs; NaN where the adapter has
 *     no estimate.
 */
hydroid_status hydroid_session_deviations(hydroid_session *session,
                                          const double *commands,
                                          size_t commands_len,
                                          const size_t *horizons,
                                          size_t horizons_len,
                                          double *deviations,
                                          size_t deviations_len);

/**
 * Stores a window of training data for an adapter with the option rehearsal, while there is room. Allocates.
 *
 * outputs, outputs_len: samples x outputs finite numbers. The last samples are stored, as many as a window has and one more;
 *     the samples before them settle the state.
 * commands, commands_len: samples x inputs finite numbers.
 */
hydroid_status hydroid_session_store_window(hydroid_session *session,
                                            const double *outputs,
                                            size_t outputs_len,
                                            const double *commands,
                                            size_t commands_len);

/**
 * Length of the memory of an adapter, constant over its life; 0 for a session that does not learn.
 */
size_t hydroid_session_memory_len(const hydroid_session *session);

/**
 * Copies the numbers on which predictions and further learning depend, as for a restart of the program. They begin with a
 * fingerprint of model, options and version.
 *
 * numbers, numbers_len: receives hydroid_session_memory_len() numbers.
 */
hydroid_status hydroid_session_save(const hydroid_session *session,
                                    double *numbers,
                                    size_t numbers_len);

/**
 * Loads what hydroid_session_save() of an adapter of the same model, options and version copied: both continue
 * identically to the last bit. HYDROID_STATUS_MEMORY if it is another one or damaged; the adapter is then as before.
 * Windows of hydroid_session_store_window() are stored again before. Allocates.
 */
hydroid_status hydroid_session_load(hydroid_session *session,
                                    const double *numbers,
                                    size_t numbers_len);

/**
 * Whether the memory can be that of an adapter: weights and states are finite, variances finite and not negative.
 * hydroid_session_load() of a sound memory repairs it. False after an error.
 */
bool hydroid_session_is_sound(const hydroid_session *session);

/**
 * The model with the learned weights, which hydroid_model_write() writes. Allocates.
 *
 * run: name of the run, for the provenance of the model; or NULL.
 * model: receives the model; NULL after an error. Freed by hydroid_model_free().
 */
hydroid_status hydroid_session_learned(const hydroid_session *session,
                                       const char *run,
                                       hydroid_model **model);

/**
 * A simulation of a model with the outputs u and r, and v if it has one: the motion from the model with constant weights,
 * without measurements, and the pose by kinematics. hydroid_simulation_start() begins it. Allocates.
 *
 * current_north, current_east: constant velocity of the water [m/s].
 * simulation: receives the simulation; NULL after an error. Freed by hydroid_simulation_free().
 */
hydroid_status hydroid_simulation_new(const hydroid_model *model,
                                      double current_north,
                                      double current_east,
                                      hydroid_simulation **simulation);

/**
 * Frees a simulation. NULL is ignored.
 */
void hydroid_simulation_free(hydroid_simulation *simulation);

/**
 * Number of outputs; 0 after an error.
 */
size_t hydroid_simulation_outputs_len(const hydroid_simulation *simulation);

/**
 * Number of inputs; 0 after an error.
 */
size_t hydroid_simulation_inputs_len(const hydroid_simulation *simulation);

/**
 * Starts at a pose in a steady motion: outputs and command have been constant for a long time. Allocates.
 *
 * eta, eta_len: 3 numbers: position north and east [m], heading [rad] clockwise from north.
 * y, y_len: outputs, with the motion through the water.
 * c, c_len: the command before the start.
 */
hydroid_status hydroid_simulation_start(hydroid_simulation *simulation,
                                        const double *eta,
                                        size_t eta_len,
                                        const double *y,
                                        size_t y_len,
                                        const double *c,
                                        size_t c_len);

/**
 * Steps to the next sample, with the command c held up to it.
 */
hydroid_status hydroid_simulation_advance(hydroid_simulation *simulation, const double *c, size_t c_len);

/**
 * The outputs of the model, with the motion through the water; NaN before the start.
 */
hydroid_status hydroid_simulation_outputs(const hydroid_simulation *simulation, double *y, size_t y_len);

/**
 * The pose: position north and east [m], heading [rad], clockwise from north and not wrapped.
 *
 * eta, eta_len: receives 3 numbers.
 */
hydroid_status hydroid_simulation_eta(const hydroid_simulation *simulation, double *eta, size_t eta_len);

/**
 * Surge and sway [m/s] and yaw rate [rad/s] over ground.
 *
 * nu, nu_len: receives 3 numbers.
 */
hydroid_status hydroid_simulation_nu_over_ground(const hydroid_simulation *simulation,
                                                 double *nu,
                                                 size_t nu_len);

/**
 * HYDROID_STATUS_DIVERGED if the motion is not finite.
 */
hydroid_status hydroid_simulation_check(const hydroid_simulation *simulation);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HYDROID_H */
