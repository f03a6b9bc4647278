static REAL NAME_sign(REAL x)
{
    return (REAL)((x > 0) - (x < 0));
}
