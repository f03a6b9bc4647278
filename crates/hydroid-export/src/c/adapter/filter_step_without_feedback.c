    F_INPUT(X_STATE, X_COMMAND, input);
    NAME_predict(adapter, state->x + UPPER_FIRST_ESTIMATE, input);
    if (NAME_waits(X_STATE)) {
        NAME_wait(state, X_COMMAND);
        (void)NAME_after_step(adapter, state->x + UPPER_FIRST_ESTIMATE);
        adapter->stepped = 0;
        return;
    }
    F_BASE(X_STATE, X_COMMAND, adapter->base);
    NAME_sample(state, command);
