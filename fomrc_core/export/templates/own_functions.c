@if least_of
static double least_of(double a, double b)
{
    return a < b ? a : b;
}

@end
@if most_of
static double most_of(double a, double b)
{
    return a > b ? a : b;
}

@end
@if size_of
static double size_of(double a)
{
    return a < 0.0 ? -a : a;
}

@end
@if rounded
/* The nearest whole number, the even one of two. */
static double rounded(double x)
{
    const double shift = 6755399441055744.0; /* 1.5 * 2^52: what is added to it has no digits behind the point */
    volatile double shifted;
    if (!(x > -2251799813685248.0 && x < 2251799813685248.0)) return x;
    shifted = x + shift;
    return shifted - shift;
}

@end
@if exponential
/* e^x of what is not positive: a power of two, and a series for the rest, which is at most ln(2) / 2. */
static double exponential(double x)
{
    double power, rest, sum = 1.0, term = 1.0, scale = 1.0;
    if (!(x <= 0.0)) return (double)NAN;
    if (x < -700.0) return 0.0;
    power = rounded(x * 1.4426950408889634);
    rest = (x - power * 6.93147180369123816490e-01) - power * 1.90821492927058770002e-10;
    for (int n = 1; n <= 14; n++) {
        term *= rest / (double)n;
        sum += term;
    }
    for (uint32_t bits = (uint32_t)(-power), n = 0; n < 10; n++) {
        static const double HALVINGS[10] = {0.5, 0.25, 0.0625, 0.00390625, 1.52587890625e-05, 2.3283064365386963e-10,
            5.421010862427522e-20, 2.938735877055719e-39, 8.636168555094445e-78, 7.458340731200207e-155};
        if ((bits >> n) & 1u) scale *= HALVINGS[n];
    }
    return sum * scale;
}

@end
@if wave
/* The sine of an angle more quarter turns: whole quarter turns taken off in three pieces, then a series for what is at
   most pi / 4. */
static double wave(double x, double quarters)
{
    const double turns = rounded(x * 0.63661977236758134);
    double rest = ((x - turns * 1.57079632673412561417e+00) - turns * 6.07710050630396597660e-11) -
                  turns * 2.02226624879595063154e-21;
    double quarter = turns + quarters, square, sum;
    quarter -= 4.0 * rounded(quarter * 0.25 - 0.375);
    if (!(rest > -1.0 && rest < 1.0)) rest = 0.0; /* so far out that a double has no angle any more */
    square = rest * rest;
    if (quarter == 0.0 || quarter == 2.0) {
        sum = 1.58969099521155010221e-10;
        sum = -2.50507602534068634195e-08 + square * sum;
        sum = 2.75573137070700676789e-06 + square * sum;
        sum = -1.98412698298579493134e-04 + square * sum;
        sum = 8.33333333332248946124e-03 + square * sum;
        sum = -1.66666666666666324348e-01 + square * sum;
        sum = rest + rest * square * sum;
    } else {
        sum = -1.13596475577881948265e-11;
        sum = 2.08757232129817482790e-09 + square * sum;
        sum = -2.75573143513906633035e-07 + square * sum;
        sum = 2.48015872894767294178e-05 + square * sum;
        sum = -1.38888888888741095749e-03 + square * sum;
        sum = 4.16666666666666019037e-02 + square * sum;
        sum = 1.0 - 0.5 * square + square * square * sum;
    }
    return quarter >= 2.0 ? -sum : sum;
}

@end
@if sine
static double sine(double x)
{
    return wave(x, 0.0);
}

@end
@if cosine
static double cosine(double x)
{
    return wave(x, 1.0);
}

@end
@if logarithm
/* The natural logarithm of 1 + x of what is not negative: a power of two taken off, then twice the area tangent. */
static double logarithm(double x)
{
    double share, square, sum = 0.0, power = 0.0;
    if (!(x >= 0.0)) return (double)NAN;
    if (x > 1.0e300) x = 1.0e300;
    if (x < 0.4) {
        share = x / (2.0 + x);
    } else {
        double number = 1.0 + x;
        for (int n = 9; n >= 0; n--) {
            static const double POWERS[10] = {2.0, 4.0, 16.0, 256.0, 65536.0, 4294967296.0, 18446744073709551616.0,
                3.402823669209385e+38, 1.157920892373162e+77, 1.3407807929942597e+154};
            if (number >= POWERS[n]) {
                number /= POWERS[n];
                power += (double)(1 << n);
            }
        }
        if (number > 1.4142135623730951) {
            number *= 0.5;
            power += 1.0;
        }
        share = (number - 1.0) / (number + 1.0);
    }
    square = share * share;
    for (int n = 12; n >= 0; n--) sum = 1.0 / (double)(2 * n + 1) + square * sum;
    return power * 6.93147180369123816490e-01 + (power * 1.90821492927058770002e-10 + 2.0 * share * sum);
}
@end
