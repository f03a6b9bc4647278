/* 1 / (1 + exp(-x)). */
static REAL NAME_logistic(REAL x)
{
    REAL s;
    const REAL y = (x > NORMAL) ? NORMAL : x;
    const REAL q = NAME_exp((y < -NORMAL) ? NORMAL : -y, &s);
    return (REAL)1 / ((REAL)1 + (q * s + s));
}
