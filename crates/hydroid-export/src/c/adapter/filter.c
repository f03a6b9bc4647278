/* The extended Kalman filter of s = [h; theta], the hidden state and the weights of the network, in its scaled units.
 * P, the covariance of s, is symmetric: its lower triangle is stored, row by row. */
#define UPPER_HIDDEN WORD_HIDDEN
#define UPPER_ESTIMATES (UPPER_HIDDEN + UPPER_WEIGHTS)
#define UPPER_FIRST_ESTIMATE WORD_FIRST
#define UPPER_NETWORK_INPUTS WORD_INPUTS
#define UPPER_POSITIONS WORD_BEHIND
#define UPPER_ROW(i) ((i) * ((i) + 1) / 2)

WORD_TABLES
/* Y = P X; X and Y row by row, with a number of columns. */
static void NAME_covariance_times(const REAL *restrict p, const REAL *restrict x, size_t columns, REAL *restrict y)
{
    size_t i;
    size_t j;
    size_t k;
    for (i = 0; i < UPPER_ESTIMATES; ++i) {
        const REAL *const row = p + UPPER_ROW(i);
        for (k = 0; k < columns; ++k) {
            y[i * columns + k] = row[i] * x[i * columns + k];
        }
        for (j = 0; j < i; ++j) {
            for (k = 0; k < columns; ++k) {
                y[i * columns + k] += row[j] * x[j * columns + k];
                y[j * columns + k] += row[j] * x[i * columns + k];
            }
        }
    }
}

/* Sum over i of A(i, a) B(i, b); A and B row by row, with a number of columns. */
static REAL NAME_columns_product(const REAL *a, const REAL *b, size_t columns)
{
    REAL sum = 0;
    size_t i;
    for (i = 0; i < UPPER_ESTIMATES; ++i) {
        sum += a[i * columns] * b[i * columns];
    }
    return sum;
}

/* The hidden state has its variance at the start of a run, without correlation with the weights. */
static void NAME_forget_hidden(NAME_adapter *adapter)
{
    size_t i;
    size_t j;
    for (i = 0; i < UPPER_ESTIMATES; ++i) {
        REAL *const row = adapter->p + UPPER_ROW(i);
        for (j = 0; j <= i && j < UPPER_HIDDEN; ++j) {
            row[j] = (i == j) ? WORD_INITIAL_STATE : 0;
        }
    }
    adapter->stepped = 0;
}

static void NAME_adapter_forget(NAME_adapter *adapter)
{
    size_t i;
    size_t j;
    for (i = UPPER_HIDDEN; i < UPPER_ESTIMATES; ++i) {
        REAL *const row = adapter->p + UPPER_ROW(i);
        for (j = UPPER_HIDDEN; j < i; ++j) {
            row[j] = 0;
        }
        row[i] = NAME_initial_variance[i - UPPER_HIDDEN];
    }
    NAME_forget_hidden(adapter);
}

static void NAME_adapter_begin(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS])
{
    size_t i;
    (void)outputs;
    for (i = 0; i < UPPER_HIDDEN; ++i) {
        state->x[UPPER_FIRST_ESTIMATE + i] = 0;
    }
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        adapter->base[i] = 0;
    }
    NAME_forget_hidden(adapter);
}

/* After a divergence, the estimation starts again, with the present weights. */
static void NAME_restart(NAME_adapter *adapter, REAL *s)
{
    size_t i;
    for (i = 0; i < UPPER_HIDDEN; ++i) {
        s[i] = 0;
    }
    NAME_adapter_forget(adapter);
}

/* Time update of P, with G = [df/dh df/dtheta] at s and the input x of the network:
 *     P_hh <- G P G' + Q_h        P_ht <- a (G P)_t        P_tt <- a^2 P_tt + Q_theta
 * a = (1 - leak) / sqrt(forgetting factor). */
static void NAME_predict(NAME_adapter *adapter, const REAL *s, const REAL *x)
{
    const REAL growth = (adapter->frozen != 0U) ? 1 : WORD_GROWTH;
    REAL *const g = adapter->jacobian;
    REAL *const gp = adapter->product;
    REAL unit[UPPER_HIDDEN] = {0};
    REAL row[UPPER_ESTIMATES];
    size_t i;
    size_t j;
    for (i = 0; i < UPPER_HIDDEN; ++i) {
        unit[i] = 1;
        F_TRANSITION_JACOBIAN(s, x, s + UPPER_HIDDEN, unit, row);
        unit[i] = 0;
        for (j = 0; j < UPPER_ESTIMATES; ++j) {
            g[j * UPPER_HIDDEN + i] = row[j];
        }
    }
    NAME_covariance_times(adapter->p, g, UPPER_HIDDEN, gp);
    for (i = 0; i < UPPER_HIDDEN; ++i) {
        REAL *const p = adapter->p + UPPER_ROW(i);
        for (j = 0; j <= i; ++j) {
            p[j] = NAME_columns_product(g + i, gp + j, UPPER_HIDDEN);
        }
        p[i] += WORD_STATE_NOISE;
    }
    for (i = UPPER_HIDDEN; i < UPPER_ESTIMATES; ++i) {
        REAL *const p = adapter->p + UPPER_ROW(i);
        for (j = 0; j < UPPER_HIDDEN; ++j) {
            p[j] = growth * gp[i * UPPER_HIDDEN + j];
        }
        for (j = UPPER_HIDDEN; j <= i; ++j) {
            p[j] *= growth * growth;
        }
        p[i] += NAME_weight_noise[i - UPPER_HIDDEN];
    }
}

/* Factors the lower triangle of S = L L' in place; 0 if S is not positive definite. */
static int NAME_cholesky(REAL s[UPPER_OUTPUTS * UPPER_OUTPUTS], size_t count)
{
    size_t i;
    size_t j;
    size_t k;
    for (i = 0; i < count; ++i) {
        for (j = 0; j <= i; ++j) {
            REAL rest = s[i * UPPER_OUTPUTS + j];
            for (k = 0; k < j; ++k) {
                rest -= s[i * UPPER_OUTPUTS + k] * s[j * UPPER_OUTPUTS + k];
            }
            if (i > j) {
                s[i * UPPER_OUTPUTS + j] = rest / s[j * UPPER_OUTPUTS + j];
            } else if (rest > 0 && isfinite(rest)) {
                s[i * UPPER_OUTPUTS + i] = WORD_SQRT(rest);
            } else {
                return 0;
            }
        }
    }
    return 1;
}

/* L^-1 y in place, of the elements of y at the places measured. */
static void NAME_whiten(const REAL l[UPPER_OUTPUTS * UPPER_OUTPUTS], const size_t *measured, size_t count, REAL *y)
{
    size_t i;
    size_t k;
    for (i = 0; i < count; ++i) {
        REAL rest = y[measured[i]];
        for (k = 0; k < i; ++k) {
            rest -= l[i * UPPER_OUTPUTS + k] * y[k];
        }
        y[i] = rest / l[i * UPPER_OUTPUTS + i];
    }
}

/* Measurement update by z, in which a missing value is not finite, with H = [dg/dh dg/dtheta] at s:
 *     S = H P H' + R = L L'        W = P H' L'^-1        s <- s + W L^-1 (z - g(h, theta))        P <- P - W W'
 * Returns 0 if the filter has diverged: S is not positive definite, or a number is not finite. */
static int NAME_correct(NAME_adapter *adapter, REAL *s, const REAL z[UPPER_OUTPUTS])
{
    REAL *const h = adapter->jacobian;
    REAL *const ph = adapter->product;
    REAL unit[UPPER_OUTPUTS] = {0};
    REAL row[UPPER_ESTIMATES];
    REAL e[UPPER_OUTPUTS];
    REAL l[UPPER_OUTPUTS * UPPER_OUTPUTS] = {0};
WORD_DEVIATIONS    size_t measured[UPPER_OUTPUTS];
    size_t count = 0;
    size_t i;
    size_t j;
    size_t k;
    F_OBSERVATION(s, s + UPPER_HIDDEN, e);
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        e[i] = z[i] - e[i];
        if (isfinite(z[i])) {
            measured[count] = i;
            ++count;
        }
        unit[i] = 1;
        F_OBSERVATION_JACOBIAN(s, s + UPPER_HIDDEN, unit, row);
        unit[i] = 0;
        for (j = 0; j < UPPER_ESTIMATES; ++j) {
            h[j * UPPER_OUTPUTS + i] = row[j];
        }
    }
    NAME_covariance_times(adapter->p, h, UPPER_OUTPUTS, ph);
    for (i = 0; i < count; ++i) {
        for (j = 0; j <= i; ++j) {
            l[i * UPPER_OUTPUTS + j] = NAME_columns_product(h + measured[i], ph + measured[j], UPPER_OUTPUTS);
        }
        l[i * UPPER_OUTPUTS + i] += NAME_noise[measured[i]];
WORD_HUBER    }
    if (!NAME_cholesky(l, count)) {
        return 0;
    }
    NAME_whiten(l, measured, count, e);
    for (i = 0; i < count; ++i) {
        if (!isfinite(e[i])) {
            return 0;
        }
    }
    for (i = 0; i < UPPER_ESTIMATES; ++i) {
        /* Frozen weights keep their covariance (Schmidt-Kalman filter). */
        const int fixed = adapter->frozen != 0U && i >= UPPER_HIDDEN;
        const size_t columns = fixed ? UPPER_HIDDEN : i + 1;
        REAL *const p = adapter->p + UPPER_ROW(i);
        REAL *const w = ph + i * UPPER_OUTPUTS;
        NAME_whiten(l, measured, count, w);
        for (j = 0; j < columns; ++j) {
            for (k = 0; k < count; ++k) {
                p[j] -= w[k] * ph[j * UPPER_OUTPUTS + k];
            }
        }
        for (k = 0; k < count && !fixed; ++k) {
            s[i] += w[k] * e[k];
        }
    }
    return 1;
}

/* After the step of the model: the leak of the weights. Returns whether the hidden state is finite; it would not become so
 * again, and starts at zero. */
static int NAME_after_step(NAME_adapter *adapter, REAL *s)
{
    size_t i;
    adapter->stepped = 1;
WORD_LEAK    for (i = 0; i < UPPER_HIDDEN; ++i) {
        if (!isfinite(s[i])) {
            NAME_restart(adapter, s);
            return 0;
        }
    }
    return 1;
}

/* Learns from outputs after a step. Without a measured output, or without a step before it, it does nothing. */
static int NAME_update(NAME_adapter *adapter, REAL *s, const REAL outputs[UPPER_OUTPUTS])
{
    REAL z[UPPER_OUTPUTS];
    size_t count = 0;
    size_t i;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        z[i] = (outputs[i] - adapter->base[i]) / NAME_correction_scale[i];
        count += isfinite(z[i]) ? 1U : 0U;
    }
    if (adapter->stepped == 0U || count == 0) {
        return UPPER_WAITING;
    }
    adapter->stepped = 0;
    if (!NAME_correct(adapter, s, z)) {
        NAME_restart(adapter, s);
        return UPPER_REJECTED;
    }
    return UPPER_LEARNED;
}

static int NAME_outcome(const NAME_adapter *adapter, int result, const REAL outputs[UPPER_OUTPUTS])
{
    size_t i;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        if (isinf(outputs[i])) {
            return UPPER_REJECTED;
        }
    }
    return (result == UPPER_LEARNED && adapter->frozen != 0U) ? UPPER_WAITING : result;
}
