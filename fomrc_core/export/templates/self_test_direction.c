
/* The largest error of a run over the golden data, relative to the largest answer. */
static double DIRECTION_error(piezo_DIRECTION *state, int is_fixed, size_t first, size_t last)
{
    double worst = 0.0, largest = (double)TINY;
    for (size_t k = 0; k < DIRECTION_N_GOLDEN; k++)
        if (size_of(DIRECTION_OUTPUT[k]) > largest) largest = size_of(DIRECTION_OUTPUT[k]);
    for (size_t k = first; k < last; k++) {
        double answer, error;
@insert set_covariates
        answer = (double)(is_fixed ? piezo_DIRECTION_step_fixed(state, DIRECTION_INPUT[k])
                                   : piezo_DIRECTION_step(state, DIRECTION_INPUT[k], DIRECTION_STEP_S[k]));
        error = size_of(answer - DIRECTION_OUTPUT[k]) / largest;
        if (!(error <= worst)) worst = error;
    }
    return worst;
}

static void test_DIRECTION(void)
{
    static unsigned char bytes[PIEZO_DIRECTION_UPPER_N_BYTES], other[PIEZO_DIRECTION_UPPER_N_BYTES];
    static piezo_DIRECTION state, beside, restored;
    const size_t half = DIRECTION_N_FIXED / 2;
    double fixed, any;
    piezo_DIRECTION_init(&state);
    piezo_DIRECTION_init(&beside);
    /* two instances in turns: neither knows of the other */
    fixed = DIRECTION_error(&state, 1, 0, half);
    any = DIRECTION_error(&beside, 0, 0, DIRECTION_N_FIXED);
    piezo_DIRECTION_save(&state, bytes);
    check(piezo_DIRECTION_restore(&restored, bytes, sizeof bytes) == PIEZO_RESTORED, "a saved state is restored");
    fixed += DIRECTION_error(&restored, 1, half, DIRECTION_N_FIXED);
    any += DIRECTION_error(&beside, 0, DIRECTION_N_FIXED, DIRECTION_N_GOLDEN);
    check(fixed <= TOLERANCE, "DIRECTION, fixed step: as in Python");
    check(any <= TOLERANCE, "DIRECTION, any step: as in Python");
    printf("DIRECTION: %.2g fixed step, %.2g any step (at most %.2g); state of %lu bytes\n", fixed, any, TOLERANCE,
           (unsigned long)sizeof state);

    memcpy(other, bytes, sizeof bytes);
    other[sizeof other - 1] ^= 1;
    check(piezo_DIRECTION_restore(&restored, other, sizeof other) == PIEZO_DAMAGED, "damage is told");
    memcpy(other, bytes, sizeof bytes);
    other[5]++;
    check(piezo_DIRECTION_restore(&restored, other, sizeof other) == PIEZO_OTHER_VERSION, "another version is told");
    memcpy(other, bytes, sizeof bytes);
    other[8] ^= 1;
    check(piezo_DIRECTION_restore(&restored, other, sizeof other) == PIEZO_OTHER_MODEL, "another model is told");
    check(piezo_DIRECTION_restore(&restored, bytes, 3) == PIEZO_NOT_A_STATE, "too few bytes are told");
}

/* Whether a step that cannot be taken answers with NaN and leaves the state alone. */
static int DIRECTION_refuses(piezo_DIRECTION *state, real input, real step_s, int is_fixed)
{
    static unsigned char before[PIEZO_DIRECTION_UPPER_N_BYTES], after[PIEZO_DIRECTION_UPPER_N_BYTES];
    real answer;
    piezo_DIRECTION_save(state, before);
    answer = is_fixed ? piezo_DIRECTION_step_fixed(state, input) : piezo_DIRECTION_step(state, input, step_s);
    piezo_DIRECTION_save(state, after);
    return !is_number(answer) && memcmp(before, after, sizeof before) == 0;
}

/* Whether an answer is as good input may be answered. */
static int DIRECTION_answers(real answer)
{
@if may_be_nan
    (void)answer;
    return 1; /* an effect of this model has no answer for some input */
@end
@if not may_be_nan
    return is_number(answer);
@end
}

static void fuzz_DIRECTION(long n_random)
{
    static unsigned char bytes[PIEZO_DIRECTION_UPPER_N_BYTES];
    static piezo_DIRECTION state, copy;
    const real good = (real)PIEZO_SAMPLE_TIME_S;
    int refuses = 1, answers = 1, repeats = 1;
    const double largest = (double)largest_of(DIRECTION_INPUT, DIRECTION_N_GOLDEN);
    piezo_DIRECTION_init(&state);
    for (long k = 0; k < n_random; k++) {
        const double kind = random_share();
        const real input = (real)(largest * (2.0 * random_share() - 1.0));
        real step_s = (real)(PIEZO_SAMPLE_TIME_S * random_share() * 10.0) + good / (real)100;
        if (kind < 0.02) refuses = refuses && DIRECTION_refuses(&state, not_a_number(), step_s, kind < 0.01);
        else if (kind < 0.04) refuses = refuses && DIRECTION_refuses(&state, infinite(), step_s, kind < 0.03);
        else if (kind < 0.06) refuses = refuses && DIRECTION_refuses(&state, -infinite(), step_s, kind < 0.05);
        else if (kind < 0.07) refuses = refuses && DIRECTION_refuses(&state, input, (real)0, 0);
        else if (kind < 0.08) refuses = refuses && DIRECTION_refuses(&state, input, -step_s, 0);
        else if (kind < 0.09) refuses = refuses && DIRECTION_refuses(&state, input, not_a_number(), 0);
        else if (kind < 0.10) refuses = refuses && DIRECTION_refuses(&state, input, infinite(), 0);
        else if (kind < 0.11) refuses = refuses && DIRECTION_refuses(&state, (real)1.0e7, step_s, kind < 0.105);
        else if (kind < 0.12) {
            /* as far as input goes, and a long rest behind it */
            step_s *= (real)1.0e5;
            const real far = (real)(kind < 0.115 ? 1.0e3 : -1.0e3);
            answers = answers && DIRECTION_answers(piezo_DIRECTION_step(&state, far, good));
            answers = answers && DIRECTION_answers(piezo_DIRECTION_step(&state, input, step_s));
        } else if (kind < 0.13) {
            piezo_DIRECTION_save(&state, bytes);
            repeats = repeats && piezo_DIRECTION_restore(&copy, bytes, sizeof bytes) == PIEZO_RESTORED;
            repeats = repeats && is_same(
                piezo_DIRECTION_step(&copy, input, step_s), piezo_DIRECTION_step(&state, input, step_s));
        } else if (kind < 0.5) {
            answers = answers && DIRECTION_answers(piezo_DIRECTION_step(&state, input, step_s));
        } else {
            answers = answers && DIRECTION_answers(piezo_DIRECTION_step_fixed(&state, input));
        }
    }
    check(refuses, "DIRECTION: bad input is refused and leaves the state as it was");
    check(answers, "DIRECTION: good input is answered with a number");
    check(repeats, "DIRECTION: a restored state goes on as the one it was saved from");
}
