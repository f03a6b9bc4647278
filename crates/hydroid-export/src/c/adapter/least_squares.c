/* P = U D U' with U unit upper triangular and D diagonal (Bierman 1977). The part of column j of U above the diagonal
 * begins at u[j (j - 1) / 2].
 *
 * f = U' phi; returns phi' P phi. */
static REAL NAME_project(const REAL *u, const REAL *d, const REAL *phi, REAL *f, size_t n)
{
    REAL variance = 0;
    size_t i;
    size_t j;
    for (j = 0; j < n; ++j) {
        REAL sum = phi[j];
        for (i = 0; i < j; ++i) {
            sum += phi[i] * u[i];
        }
        u += j;
        f[j] = sum;
        variance += d[j] * sum * sum;
    }
    return variance;
}

/* A measurement with the projected regressor f and the noise variance: gain = P phi / (noise + phi' P phi), and
 * P -= gain phi' P. */
static void NAME_absorb(REAL *u, REAL *d, const REAL *f, REAL *gain, REAL noise, size_t n)
{
    REAL alpha = noise;
    size_t i;
    size_t j;
    for (j = 0; j < n; ++j) {
        const REAL v = d[j] * f[j];
        const REAL before = alpha;
        if (v != 0) {
            const REAL slope = -f[j] / before;
            alpha += v * f[j];
            d[j] *= before / alpha;
            for (i = 0; i < j; ++i) {
                const REAL old = u[i];
                u[i] = old + slope * gain[i];
                gain[i] += v * old;
            }
        }
        u += j;
        gain[j] = v;
    }
    for (j = 0; j < n; ++j) {
        gain[j] /= alpha;
    }
}

/* phi' theta with theta = scale * weights. */
static REAL NAME_expected(const REAL *phi, const REAL *weights, const REAL *scale, size_t n)
{
    REAL sum = 0;
    size_t i;
    for (i = 0; i < n; ++i) {
        sum += phi[i] * (weights[i] * scale[i]);
    }
    return sum;
}

/* theta += gain e with theta = scale * weights. */
static void NAME_correct(REAL *weights, const REAL *gain, const REAL *scale, REAL e, size_t n)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        weights[i] += e * gain[i] / scale[i];
    }
}

/* Whether numbers and their squares are finite. */
static int NAME_finite(const REAL *x, size_t n)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        if (!(x[i] < LARGE && x[i] > -LARGE)) {
            return 0;
        }
    }
    return 1;
}

/* The gate: weight of a row with the innovations e, whose variances are noise (1 + leverage). With d the largest of
 * |e| / sqrt(noise (1 + min(leverage, MOST))): 1 up to d = INFLATE, then INFLATE / d, and 0 beyond d = REJECT. A longer
 * series of outliers than one faulty sample explains is a change of the vessel. The noise follows the innovations. */
static REAL NAME_judge(NAME_noise *noise, const REAL *e, const REAL *leverage, uint32_t longest, REAL rate)
{
    const int known = noise->rows >= FEWEST;
    const REAL inverse = (REAL)1 / ((REAL)noise->rows + (REAL)1);
    const REAL share = (rate > inverse) ? rate : inverse;
    REAL farthest = 0;
    int outlier;
    size_t i;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        if (e[i] != 0) {
            const REAL bounded = (leverage[i] < MOST) ? leverage[i] : MOST;
            const REAL deviations = FABS(e[i]) / SQRT(noise->variance[i] * ((REAL)1 + bounded));
            farthest = (deviations > farthest) ? deviations : farthest;
        }
    }
    outlier = known && farthest > INFLATE;
    noise->streak = outlier ? noise->streak + 1U : 0U;
    outlier = outlier && noise->streak <= longest;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        const REAL most = INFLATE * INFLATE * noise->variance[i];
        REAL square = e[i] * e[i] / ((REAL)1 + leverage[i]);
        if (outlier && square > most) {
            square = most;
        }
        noise->variance[i] += share * (square - noise->variance[i]);
    }
    noise->rows += (noise->rows < UINT32_MAX) ? 1U : 0U;
    if (!outlier) {
        return (REAL)1;
    }
    return (farthest > REJECT) ? (REAL)0 : INFLATE / farthest;
}

static void NAME_forget_noise(NAME_noise *noise)
{
    size_t i;
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        noise->variance[i] = 0;
    }
    noise->rows = 0;
    noise->streak = 0;
}
