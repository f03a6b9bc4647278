    if (NAME_waits(X_STATE)) {
        NAME_wait(state, X_COMMAND);
        adapter->stepped = 0;
        return;
    }
    F_INPUT(X_STATE, X_COMMAND, input);
    F_BASE(X_STATE, X_COMMAND, adapter->base);
    NAME_predict(adapter, state->x + UPPER_FIRST_ESTIMATE, input);
    NAME_sample(state, command);
