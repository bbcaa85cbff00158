/* The cube root, correctly rounded as on the host: one step of Newton's method with the residual in two words. */
static real cube_root(real x)
{
    const double y = cbrt(x);
    double square, square_low, cube, residual;
    if (y == 0.0 || y - y != 0.0) {
        return y;
    }
    square = y * y;
    square_low = fma(y, y, -square);
    cube = square * y;
    residual = (cube - x) + (fma(y, square, -cube) + y * square_low);
    return y - residual / (3.0 * square);
}
