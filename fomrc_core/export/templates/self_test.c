@insert banner
/* Self-test: exits with 0 where the model answers as it did in Python when it was exported. With a number as argument
   it goes on for that many random steps, good input and bad, and checks that bad input does no harm. */
#include "piezo.h"
#include "piezo_golden.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef piezo_real real;

@if float_answers
#define TOLERANCE 1e-5
#define TINY 1.0e-30f
@end
@if not float_answers
#define TOLERANCE 1e-12
#define TINY 1.0e-300
@end

static int n_failed;

static void check(int holds, const char *what)
{
    if (holds) return;
    n_failed++;
    printf("FAILED: %s\n", what);
}

static double size_of(double value)
{
    return value < 0.0 ? -value : value;
}

/* Random numbers that are the same everywhere (Knuth's MMIX constants). */
static unsigned long long random_state = 1;

static double random_share(void)
{
    random_state = random_state * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(random_state >> 11) / 9007199254740992.0;
}

static int is_number(real value)
{
    return value == value;
}

static int is_same(real a, real b)
{
    return a == b || (!is_number(a) && !is_number(b));
}

static real largest_of(const real *values, size_t n_values)
{
    real largest = (real)0;
    for (size_t k = 0; k < n_values; k++)
        if (size_of((double)values[k]) > size_of((double)largest)) largest = (real)size_of((double)values[k]);
    return largest;
}

/* Made at run time: a compiler may refuse the constants. */
static real not_a_number(void)
{
    volatile real zero = (real)0;
    return zero / zero;
}

static real infinite(void)
{
    volatile real zero = (real)0;
    return (real)1 / zero;
}
@if forward
@insert forward_test
@end
@if inverse
@insert inverse_test
@end
@if inverse

static void test_limits(void)
{
    const piezo_limits limits = piezo_default_limits;
    const double reach = (double)limits.slew_v_per_s * PIEZO_SAMPLE_TIME_S;
    const double slack = 1e-6 * ((double)limits.maximum_v - (double)limits.minimum_v);
    piezo_inverse state;
    const real further = (real)4 * largest_of(INVERSE_INPUT, INVERSE_N_GOLDEN);
    double last = 0.0;
    int stays = 1, arrives = 0;
    piezo_inverse_init(&state);
    for (int k = 0; k < 400; k++) {
        const real far_um = k < 200 ? further : -further;
        const double voltage = (double)piezo_inverse_step_fixed_limited(&state, &limits, far_um);
@if can_fail
        if (!(voltage == voltage)) continue; /* further than this model answers */
@end
        stays = stays && voltage >= (double)limits.minimum_v && voltage <= (double)limits.maximum_v &&
                size_of(voltage - last) <= reach + slack;
        last = voltage;
    }
    check(stays, "a limited voltage stays within its limits");
    for (long k = 0; k < 10000000L && !arrives; k++) {
        const double voltage = (double)piezo_inverse_ramp_to_safe_fixed(&state, &limits);
        stays = stays && size_of(voltage - last) <= (double)limits.safe_ramp_v_per_s * PIEZO_SAMPLE_TIME_S + slack;
        last = voltage;
        arrives = voltage == (double)limits.safe_v;
    }
    check(stays && arrives, "the ramp to the safe voltage arrives");
}
@end

int main(int n_arguments, char **arguments)
{
    const long n_random = n_arguments > 1 ? strtol(arguments[1], NULL, 10) : 2000;
@if forward
    test_forward();
    fuzz_forward(n_random);
@end
@if inverse
    test_inverse();
    test_limits();
    fuzz_inverse(n_random);
@end
    printf(n_failed ? "%d checks failed\n" : "self-test passed\n", n_failed);
    return n_failed ? EXIT_FAILURE : EXIT_SUCCESS;
}
