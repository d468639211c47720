
const piezo_limits piezo_default_limits = PIEZO_DEFAULT_LIMITS;

static int are_limits(const piezo_limits *limits)
{
    const real largest = (real)PIEZO_LARGEST_INPUT;
    return limits->minimum_v >= -largest && limits->maximum_v <= largest && limits->minimum_v < limits->maximum_v &&
           limits->safe_v >= limits->minimum_v && limits->safe_v <= limits->maximum_v && limits->slew_v_per_s > R(0.0) &&
           limits->safe_ramp_v_per_s > R(0.0);
}

/* The voltage within reach of the last one that is nearest to the goal. */
static real approached(real last_v, real goal_v, real reach_v)
{
    return least(most(goal_v, last_v - reach_v), last_v + reach_v);
}
@if limits_by_search

/* Move the state to where the actuator goes when it is given this voltage: the displacement for which the inverse
   answers with it, between two that enclose it, by secants and halving. Bounded: at most 120 trials, each on a copy.
   False where there is none, and the state is as it was. */
static int follow_voltage(piezo_inverse *state, const coefficients *k, real voltage_v, real step_s)
{
    real low = state->desired_um, high = low, low_error, high_error, reach;
    piezo_inverse trial = *state;
    low_error = high_error = inverse_value(&trial, k, low, step_s) - voltage_v;
    reach = most(most(low_error, -low_error) * GAIN_UM_PER_V, R(1e-9));
    for (int i = 0; i < 60; i++) {
        if (low_error > R(0.0)) {
            high = low;
            high_error = low_error;
            low -= reach;
            trial = *state;
            low_error = inverse_value(&trial, k, low, step_s) - voltage_v;
        } else if (high_error < R(0.0)) {
            low = high;
            low_error = high_error;
            high += reach;
            trial = *state;
            high_error = inverse_value(&trial, k, high, step_s) - voltage_v;
        } else {
            break;
        }
        reach *= R(2.0);
        if (reach > R(1e5)) {
            low = high = state->desired_um; /* an effect keeps the answer from following: stay */
            break;
        }
    }
    for (int i = 0; i < 60; i++) {
        real middle, error;
        if (high_error - low_error < ERROR_LEAST || high - low <= R(10.0) * WIDTH_LEAST * most(most(high, -high), R(1e-3))) break;
        middle = i % 4 == 3 ? R(0.5) * (low + high) : low - low_error * (high - low) / (high_error - low_error);
        trial = *state;
        error = inverse_value(&trial, k, middle, step_s) - voltage_v;
        if (most(error, -error) < ERROR_LEAST) {
            low = high = middle;
            break;
        }
        if (error > R(0.0)) {
            high = middle;
            high_error = error;
        } else {
            low = middle;
            low_error = error;
        }
    }
    low = -low_error < high_error ? low : high;
    trial = *state;
    if (!is_within(inverse_value(&trial, k, low, step_s), REAL_MAX)) return 0;
    *state = trial;
    state->voltage_v = voltage_v;
    return 1;
}
@end
@if not limits_by_search

/* Move the state to where the actuator goes when it is given this voltage. The voltage rises with the input of
   hysteresis in straight pieces, steep ones first on either way: Newton's method walks them in order, one element or
   more with each step, and ends when none is left (one step more for a stop that rounding put beside its end). */
static int follow_voltage(piezo_inverse *state, const coefficients *k, real voltage_v, real step_s)
{
    real input = state->previous;
    real error = voltage_v - sum_stops(state->plays, input);
    const int rises = error > R(0.0);
    for (size_t i = 0; i < N_PLAYS + 3 && error != R(0.0) && (error > R(0.0)) == rises; i++) {
        real slope = STOP_SLOPE;
        for (size_t j = 0; j < N_PLAYS; j++) {
            const real stop = input - state->plays[j];
            if (rises ? stop < STOP_THRESHOLD[j] : stop > -STOP_THRESHOLD[j]) slope += STOP_WEIGHT[j];
        }
        input += error / slope;
        error = voltage_v - sum_stops(state->plays, input);
    }
    (void)move_stops(state->plays, input);
    creep_undone_remember(state, k, input);
    (void)step_s;
    state->voltage_v = voltage_v;
    return 1;
}
@end

static real limited(
    piezo_inverse *state, const coefficients *k, const piezo_limits *limits, real desired_um, real step_s)
{
    const real last_v = state->voltage_v;
    piezo_inverse moved = *state;
    const real wanted_v = inverse_value(&moved, k, desired_um, step_s);
    const real clamped_v = least(most(wanted_v, limits->minimum_v), limits->maximum_v);
    const real voltage_v = approached(last_v, clamped_v, limits->slew_v_per_s * step_s);
    if (!is_within(wanted_v, REAL_MAX)) return NOT_A_NUMBER;
    if (voltage_v == wanted_v) {
        *state = moved;
        return voltage_v;
    }
    return follow_voltage(state, k, voltage_v, step_s) ? voltage_v : NOT_A_NUMBER;
}

static real ramped(piezo_inverse *state, const coefficients *k, const piezo_limits *limits, real step_s)
{
    const real reach_v = least(limits->safe_ramp_v_per_s, limits->slew_v_per_s) * step_s;
    const real voltage_v = approached(state->voltage_v, limits->safe_v, reach_v);
    return follow_voltage(state, k, voltage_v, step_s) ? voltage_v : NOT_A_NUMBER;
}

#ifndef PIEZO_FIXED_STEP_ONLY
piezo_real piezo_inverse_step_limited(
    piezo_inverse *state, const piezo_limits *limits, piezo_real desired_um, piezo_real step_s)
{
    coefficients k;
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT) || !is_step(step_s) || !are_limits(limits))
        return NOT_A_NUMBER;
    prepare(&k, step_s);
    return (piezo_real)limited(state, &k, limits, desired_um, step_s);
}

piezo_real piezo_inverse_ramp_to_safe(piezo_inverse *state, const piezo_limits *limits, piezo_real step_s)
{
    coefficients k;
    if (!is_step(step_s) || !are_limits(limits)) return NOT_A_NUMBER;
    prepare(&k, step_s);
    return (piezo_real)ramped(state, &k, limits, step_s);
}
#endif

piezo_real piezo_inverse_step_fixed_limited(
    piezo_inverse *state, const piezo_limits *limits, piezo_real desired_um)
{
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT) || !are_limits(limits)) return NOT_A_NUMBER;
    return (piezo_real)limited(state, &FIXED_1, limits, desired_um, (real)PIEZO_SAMPLE_TIME_S);
}

piezo_real piezo_inverse_ramp_to_safe_fixed(piezo_inverse *state, const piezo_limits *limits)
{
    if (!are_limits(limits)) return NOT_A_NUMBER;
    return (piezo_real)ramped(state, &FIXED_1, limits, (real)PIEZO_SAMPLE_TIME_S);
}
