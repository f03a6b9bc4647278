
/* Begins the present block of the window with the outputs y. */
static void NAME_begin_block(NAME_adapter *adapter, const REAL *y)
{
    size_t i;
    adapter->filled = 0;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        adapter->starts[adapter->current * UPPER_OUTPUTS + i] = y[i];
    }
    for (i = 0; i < TERMS; ++i) {
        adapter->sums[adapter->current * TERMS + i] = 0;
    }
}

/* Adds an interval with the terms theta and the outputs y at its end. Returns whether a row is complete, and writes it. */
static int NAME_push(NAME_adapter *adapter, const REAL *theta, const REAL *y, REAL *phi, REAL *z)
{
    size_t i;
    size_t k;
    int ready;
    for (i = 0; i < TERMS; ++i) {
        adapter->sums[adapter->current * TERMS + i] += theta[i];
    }
    ++adapter->filled;
    if (adapter->filled < STRIDE) {
        return 0;
    }
    adapter->full += (adapter->full < BLOCKS) ? 1U : 0U;
    ready = adapter->full == BLOCKS;
    adapter->current = (adapter->current + 1U) % BLOCKS;
    if (ready) {
        for (i = 0; i < UPPER_OUTPUTS; ++i) {
            z[i] = (y[i] - adapter->starts[adapter->current * UPPER_OUTPUTS + i]) / WINDOW;
        }
        for (i = 0; i < TERMS; ++i) {
            phi[i] = 0;
            for (k = 0; k < BLOCKS; ++k) {
                phi[i] += adapter->sums[k * TERMS + i] / SAMPLES;
            }
        }
    }
    NAME_begin_block(adapter, y);
    return ready;
}

/* Learns from a row. */
static int NAME_learn(NAME_adapter *adapter, REAL *weights, const REAL *phi, const REAL *z)
{
    REAL e[UPPER_OUTPUTS] = { 0 };
    REAL leverage[UPPER_OUTPUTS] = { 0 };
    REAL share;
    size_t i;
LOCALS    if (!NAME_finite(phi, TERMS) || !NAME_finite(z, UPPER_OUTPUTS)) {
        adapter->known = 0;
        return UPPER_REJECTED;
    }
PREDICT    share = NAME_judge(&adapter->noise, e, leverage, LONGEST, RATE);
    if (!(share > 0)) {
        return UPPER_REJECTED;
    }
CORRECT    return UPPER_LEARNED;
}

static void NAME_adapter_forget(NAME_adapter *adapter)
{
    size_t i;
FORGET_ALL    NAME_forget_noise(&adapter->noise);
}

/* Whether the sample is complete and after the warm-up. */
static int NAME_complete(NAME_adapter *adapter, const REAL *outputs)
{
    int complete;
    size_t i;
    adapter->seen += (adapter->seen < UINT32_MAX) ? 1U : 0U;
    complete = adapter->seen >= WARM_UP;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        complete = complete && !isnan(outputs[i]);
    }
    return complete;
}

static void NAME_restart(NAME_adapter *adapter, const REAL *outputs)
{
    adapter->full = 0;
    NAME_begin_block(adapter, outputs);
}

static void NAME_adapter_begin(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    size_t i;
    (void)state;
    for (i = 0; i < VARIABLES; ++i) {
        adapter->start[i] = 0;
    }
    adapter->current = 0;
    adapter->seen = 0;
    adapter->held = 0;
    adapter->known = NAME_complete(adapter, outputs) ? 1U : 0U;
    NAME_restart(adapter, outputs);
}

void NAME_adapter_step(NAME_adapter *adapter, NAME_state *state, const REAL command[UPPER_INPUTS])
{
    /* An interval with two commands is not part of a row. */
    adapter->known = (adapter->held == 0U) ? adapter->known : 0U;
    adapter->held = 1;
VARIABLES_NOW    NAME_sample(state, command);
}

int NAME_adapter_observe(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    REAL end[VARIABLES];
    REAL theta[TERMS];
    REAL phi[TERMS];
    REAL z[UPPER_OUTPUTS];
    int ready = 0;
    int complete;
    NAME_observe(state, outputs);
    complete = NAME_complete(adapter, outputs);
    if (complete && adapter->known != 0U && adapter->held != 0U) {
        VARIABLES_OF(STATE, adapter->start + UPPER_OUTPUTS, end);
        LIBRARY(adapter->start, end, theta);
        ready = NAME_push(adapter, theta, outputs, phi, z);
    } else if (complete) {
        NAME_restart(adapter, outputs);
    }
    adapter->known = complete ? 1U : 0U;
    adapter->held = 0;
    if (!ready || adapter->frozen != 0U) {
        return UPPER_WAITING;
    }
    return NAME_learn(adapter, state->x + UPPER_FIRST_WEIGHT, phi, z);
}
