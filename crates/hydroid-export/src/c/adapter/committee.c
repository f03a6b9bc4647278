
static void NAME_adapter_forget(NAME_adapter *adapter)
{
FORGET_ALL}

static void NAME_adapter_begin(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    (void)state;
    (void)outputs;
BEGIN_ALL    adapter->measured = 1;
    adapter->observed = 1;
}

void NAME_adapter_step(NAME_adapter *adapter, NAME_state *state, const REAL command[UPPER_INPUTS])
{
    if (adapter->observed == 0U) {
        adapter->measured = 0;
    }
    adapter->observed = 0;
    NAME_sample(state, command);
}

int NAME_adapter_observe(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    int result = UPPER_WAITING;
    int complete = 1;
    size_t i;
    NAME_observe(state, outputs);
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        complete = complete && !isnan(outputs[i]);
    }
    adapter->measured = complete ? adapter->measured + 1U : 0U;
    adapter->observed = 1;
    if (adapter->frozen == 0U) {
        int outcome;
LEARN_ALL    }
    return result;
}
