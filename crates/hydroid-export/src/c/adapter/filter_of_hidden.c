
static void NAME_show(NAME_state *state)
{
    REAL outputs[UPPER_OUTPUTS];
    F_SHOWN(X_STATE, outputs);
    NAME_observe(state, outputs);
}

void NAME_adapter_step(NAME_adapter *adapter, NAME_state *state, const REAL command[UPPER_INPUTS])
{
    REAL input[UPPER_NETWORK_INPUTS];
WORD_LIMITED    F_INPUT(X_STATE, X_COMMAND, input);
    F_BASE(X_STATE, X_COMMAND, adapter->base);
    NAME_predict(adapter, state->x + UPPER_FIRST_ESTIMATE, input);
    NAME_sample(state, command);
    if (NAME_after_step(adapter, state->x + UPPER_FIRST_ESTIMATE)) {
        NAME_show(state);
    }
}

int NAME_adapter_observe(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    int result;
    if (adapter->stepped == 0U) {
        /* Without a step since the last measurement, the outputs do not follow from the hidden state. */
        NAME_observe(state, outputs);
    }
    result = NAME_update(adapter, state->x + UPPER_FIRST_ESTIMATE, outputs);
    if (result != UPPER_WAITING) {
        NAME_show(state);
    }
    return NAME_outcome(adapter, result, outputs);
}
