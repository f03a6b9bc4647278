/* e^x = s (1 + q) with s = 2^n, n next to x / ln 2, and a polynomial for q = e^r - 1, |r| <= ln 2 / 2
 * (Cody and Waite 1980). n is read from the last bits of n + 1.5 2^23. */
static float NAME_exp(float x, float *s)
{
    const float rounded = x * 1.44269504F + 12582912.0F;
    const float n = rounded - 12582912.0F;
    const float r = (x - n * 0.69314575F) - n * 1.4286068e-6F;
    float p = 0.0013926184F;
    uint32_t bits;
    p = p * r + 0.008363179F;
    p = p * r + 0.041666555F;
    p = p * r + 0.16666577F;
    p = p * r + 0.5F;
    memcpy(&bits, &rounded, sizeof bits);
    bits = (bits << 23) + UINT32_C(0x3f800000);
    memcpy(s, &bits, sizeof bits);
    return p * r * r + r;
}
