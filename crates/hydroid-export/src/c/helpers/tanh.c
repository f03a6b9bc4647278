/* (e^2x - 1) / (e^2x - 1 + 2). */
static REAL NAME_tanh(REAL x)
{
    REAL s;
    const REAL size = FABS(x);
    const REAL y = (size > END) ? END : size;
    const REAL q = NAME_exp(y + y, &s);
    const REAL e = q * s + (s - (REAL)1);
    const REAL t = e / (e + (REAL)2);
    return (x < 0) ? -t : t;
}
