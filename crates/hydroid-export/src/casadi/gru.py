def _gru(a, b, h):
    """h+ = (1 - z) n + z h with gates r, z, n; a = W_ih x + b_ih, b = W_hh h + b_hh."""
    reset_a, update_a, fresh_a = ca.vertsplit(a, h.shape[0])
    reset_b, update_b, fresh_b = ca.vertsplit(b, h.shape[0])
    fresh = ca.tanh(fresh_a + _logistic(reset_a + reset_b) * fresh_b)
    return fresh + _logistic(update_a + update_b) * (h - fresh)
