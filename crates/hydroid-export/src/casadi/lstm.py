def _lstm(a, b, c):
    """c+ = f c + i g and m = o tanh(c+) with gates i, f, g, o; a = W_ih x + b_ih, b = W_hh h + b_hh."""
    enter, forget, fresh, leave = ca.vertsplit(a + b, c.shape[0])
    c = _logistic(forget) * c + _logistic(enter) * ca.tanh(fresh)
    return ca.vertcat(c, _logistic(leave) * ca.tanh(c))
