/* y = W x; W row by row. */
static void NAME_product(const REAL *restrict w, const REAL *restrict x, size_t rows, size_t columns, REAL *restrict y)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        REAL sum = 0;
        for (j = 0; j < columns; ++j) {
            sum += w[i * columns + j] * x[j];
        }
        y[i] = sum;
    }
}
