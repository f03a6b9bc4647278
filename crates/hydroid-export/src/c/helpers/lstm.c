/* c+ = f c + i g and m = o tanh(c+) with gates i, f, g, o; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_lstm(const REAL *restrict a, const REAL *restrict b, const REAL *restrict c, size_t n,
                      REAL *restrict next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL input = NAME_logistic(a[i] + b[i]);
        const REAL forget = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = NAME_tanh(a[2 * n + i] + b[2 * n + i]);
        next[i] = forget * c[i] + input * fresh;
        next[n + i] = NAME_logistic(a[3 * n + i] + b[3 * n + i]) * NAME_tanh(next[i]);
    }
}
