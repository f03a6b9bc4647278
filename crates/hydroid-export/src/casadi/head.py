
    x_0     = start(y, c)          in motion with the outputs y under the command c since long
    x_{k+1} = step(x_k, c_k)       the command is held over a sample of DT seconds
    x_k     = observe(x_k, y_k)    measured outputs; NaN is a missing value
    y_k     = output(x_k)
    dx/dt   = rates(x, c)          None for a model in discrete time

All are casadi.Function objects with exact derivatives. Velocities are those that the model predicts.
"""

import casadi as ca


def _is_number(x):
    return ca.logic_or(x <= 0, x > 0)


def _select(test, then, otherwise, size):
    """Element by element, `then` where the test holds; the other value has no effect there, also if it is not finite."""
    wide = [part if part.numel() == size else ca.repmat(part, size, 1) for part in map(_matrix, (test, then, otherwise))]
    chosen = [ca.if_else(wide[0][i], wide[1][i], wide[2][i]) for i in range(size)]
    return ca.vertcat(*chosen)


def _matrix(x):
    return ca.DM(x) if isinstance(x, (int, float)) else x


def _logistic(x):
    return 1 / (1 + ca.exp(-x))


def _gru(weight_ih, bias_ih, weight_hh, bias_hh, x, h):
    """r, z = s(a + b), n = tanh(a_n + r b_n), h+ = (1 - z) n + z h."""
    a = ca.mtimes(weight_ih, x) + bias_ih
    b = ca.mtimes(weight_hh, h) + bias_hh
    n = h.numel()
    reset, update = _logistic(a[:n] + b[:n]), _logistic(a[n : 2 * n] + b[n : 2 * n])
    new = ca.tanh(a[2 * n :] + reset * b[2 * n :])
    return new + update * (h - new)


def _lstm(weight_ih, bias_ih, weight_hh, bias_hh, x, c, h):
    """i, f, o = s(a), g = tanh(a_g), c+ = f c + i g, m = o tanh(c+)."""
    a = ca.mtimes(weight_ih, x) + bias_ih + ca.mtimes(weight_hh, h) + bias_hh
    n = c.numel()
    c = _logistic(a[n : 2 * n]) * c + _logistic(a[:n]) * ca.tanh(a[2 * n : 3 * n])
    return ca.vertcat(c, _logistic(a[3 * n :]) * ca.tanh(c))


def _median(values, votes):
    """Weighted median, element by element: half of the votes are below it, half above. NaN counts as infinite."""
    rows = []
    for i in range(values[0].numel()):
        pairs = [(_select(_is_number(v[i]), v[i], ca.inf, 1), ca.DM(w)) for v, w in zip(values, votes)]
        for end in range(len(pairs) - 1, 0, -1):
            for k in range(end):
                (a, p), (b, q) = pairs[k], pairs[k + 1]
                swap = a > b
                pairs[k] = (ca.if_else(swap, b, a), ca.if_else(swap, q, p))
                pairs[k + 1] = (ca.if_else(swap, a, b), ca.if_else(swap, p, q))
        below = [pairs[0][1]]
        for _, vote in pairs[1:]:
            below.append(below[-1] + vote)
        median = pairs[-1][0]
        for k in range(len(pairs) - 2, -1, -1):
            middle = ca.if_else(2 * below[k] == sum(votes), 0.5 * (pairs[k][0] + pairs[k + 1][0]), median)
            median = ca.if_else(2 * below[k] > sum(votes), pairs[k][0], middle)
        rows.append(median)
    return ca.vertcat(*rows)


def _repeat(function, times, state, *others):
    for _ in range(times):
        state = function(state, *others)
    return state


def _fold(function, times, state, *others):
    return function.fold(times)(state, *[ca.repmat(other, 1, times) for other in others])

