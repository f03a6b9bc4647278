/* e^x = s (1 + q) with s = 2^n, n next to x / ln 2, and a polynomial for q = e^r - 1, |r| <= ln 2 / 2
 * (Cody and Waite 1980). n is read from the last bits of n + 1.5 2^52. */
static double NAME_exp(double x, double *s)
{
    const double rounded = x * 1.4426950408889634 + 6755399441055744.0;
    const double n = rounded - 6755399441055744.0;
    const double r = (x - n * 0.6931471804855391) - n * 7.440617110012397e-11;
    double p = 2.510038549551032e-08;
    uint64_t bits;
    p = p * r + 2.7620088445409746e-07;
    p = p * r + 2.7557268459997064e-06;
    p = p * r + 2.4801521295954376e-05;
    p = p * r + 0.00019841269863053618;
    p = p * r + 0.0013888888917213717;
    p = p * r + 0.008333333333330062;
    p = p * r + 0.04166666666662413;
    p = p * r + 0.16666666666666669;
    p = p * r + 0.5000000000000001;
    memcpy(&bits, &rounded, sizeof bits);
    bits = (bits << 52) + UINT64_C(0x3ff0000000000000);
    memcpy(s, &bits, sizeof bits);
    return p * r * r + r;
}
