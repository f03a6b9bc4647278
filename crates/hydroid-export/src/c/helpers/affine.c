/* y = W x + b; W column by column. */
static void NAME_affine(const REAL *restrict w, const REAL *restrict b, const REAL *restrict x, size_t rows,
                        size_t columns, REAL *restrict y)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        y[i] = b[i];
    }
    for (j = 0; j < columns; ++j) {
        for (i = 0; i < rows; ++i) {
            y[i] += w[j * rows + i] * x[j];
        }
    }
}
