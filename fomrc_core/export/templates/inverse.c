
void piezo_inverse_init(piezo_inverse *state)
{
    static const piezo_inverse relaxed = PIEZO_INVERSE_RELAXED;
    *state = relaxed;
}

/* What hysteresis must be given for the desired displacement: creep taken out of it. */
static real creep_undone(const piezo_inverse *state, const coefficients *k, real desired_um)
{
    return (desired_um - creep_history(k, state->modes, state->previous)) / k->current_weight;
}

static void creep_undone_remember(piezo_inverse *state, const coefficients *k, real moved)
{
@if float
    creep_remember(k, state->modes, state->lost, state->previous, moved);
@end
@if not float
    creep_remember(k, state->modes, state->previous, moved);
@end
    state->previous = moved;
}

/* The voltage [V] for a desired displacement [um]; the state moves on. */
static real inverse_value(piezo_inverse *state, const coefficients *k, real desired_um, real step_s)
{
    real value = desired_um;
@insert inverse_before
    value = creep_undone(state, k, value);
    creep_undone_remember(state, k, value);
@if beside
@insert inverse_beside
@end
@if not beside
    value = move_stops(state->plays, value);
@end
@insert inverse_after
    (void)step_s;
@if limits_by_search
    state->desired_um = desired_um;
@end
    state->voltage_v = value;
    return value;
}

#ifndef PIEZO_FIXED_STEP_ONLY
real piezo_inverse_step(piezo_inverse *state, real desired_um, real step_s)
{
    coefficients k;
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT) || !is_step(step_s)) return NOT_A_NUMBER;
    if (step_s == (real)PIEZO_SAMPLE_TIME_S) return piezo_inverse_step_fixed(state, desired_um);
    prepare(&k, step_s);
    return inverse_value(state, &k, desired_um, step_s);
}
#endif

real piezo_inverse_step_fixed(piezo_inverse *state, real desired_um)
{
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT)) return NOT_A_NUMBER;
    return inverse_value(state, &FIXED, desired_um, (real)PIEZO_SAMPLE_TIME_S);
}
