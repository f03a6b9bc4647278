
/* Whether an output is not known, since a divergence. */
static int NAME_waits(const REAL *outputs)
{
    size_t i;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        if (isnan(outputs[i])) {
            return 1;
        }
    }
    return 0;
}

/* A sample that begins with unknown outputs. */
static void NAME_wait(NAME_state *state, const REAL command[UPPER_INPUTS])
{
    REAL next[UPPER_STATES - UPPER_POSITIONS];
    size_t i;
    F_WAIT(X_STATE, command, next);
    for (i = 0; i < UPPER_STATES - UPPER_POSITIONS; ++i) {
        state->x[UPPER_POSITIONS + i] = next[i];
    }
WORD_POSITIONS}

void NAME_adapter_step(NAME_adapter *adapter, NAME_state *state, const REAL command[UPPER_INPUTS])
{
    REAL input[UPPER_NETWORK_INPUTS];
WORD_LIMITEDWORD_STEP    (void)NAME_after_step(adapter, state->x + UPPER_FIRST_ESTIMATE);
}

int NAME_adapter_observe(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    const int result = NAME_update(adapter, state->x + UPPER_FIRST_ESTIMATE, outputs);
    NAME_observe(state, outputs);
    return NAME_outcome(adapter, result, outputs);
}
