/* h+ = (1 - z) n + z h with gates r, z, n; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_gru(const REAL *restrict a, const REAL *restrict b, const REAL *restrict h, size_t n,
                     REAL *restrict next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL reset = NAME_logistic(a[i] + b[i]);
        const REAL update = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = NAME_tanh(a[2 * n + i] + reset * b[2 * n + i]);
        next[i] = fresh + update * (h[i] - fresh);
    }
}
