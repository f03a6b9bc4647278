/* y = W' x; W row by row. */
static void NAME_transposed_product(const REAL *restrict w, const REAL *restrict x, size_t rows, size_t columns,
                                    REAL *restrict y)
{
    size_t i;
    size_t j;
    for (j = 0; j < columns; ++j) {
        y[j] = 0;
    }
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            y[j] += w[i * columns + j] * x[i];
        }
    }
}
