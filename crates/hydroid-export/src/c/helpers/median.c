/* Weighted median: half of the votes are below it, half above. What is not a number counts as infinite. */
static REAL NAME_median(REAL *values, unsigned long *votes, size_t count)
{
    unsigned long all = 0;
    unsigned long below = 0;
    size_t i;
    size_t j;
    for (i = 0; i < count; ++i) {
        const REAL value = isnan(values[i]) ? (REAL)HUGE_VAL : values[i];
        const unsigned long vote = votes[i];
        all += vote;
        for (j = i; j > 0 && values[j - 1] > value; --j) {
            values[j] = values[j - 1];
            votes[j] = votes[j - 1];
        }
        values[j] = value;
        votes[j] = vote;
    }
    for (i = 0; i + 1 < count; ++i) {
        below += votes[i];
        if (2 * below > all) {
            return values[i];
        }
        if (2 * below == all) {
            return (values[i] + values[i + 1]) / 2;
        }
    }
    return values[count - 1];
}
