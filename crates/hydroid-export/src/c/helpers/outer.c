/* W = a b', row by row. */
static void NAME_outer(const REAL *restrict a, const REAL *restrict b, size_t rows, size_t columns, REAL *restrict w)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            w[i * columns + j] = a[i] * b[j];
        }
    }
}
