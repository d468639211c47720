
void piezo_forward_init(piezo_forward *state)
{
    static const piezo_forward relaxed = PIEZO_FORWARD_RELAXED;
    *state = relaxed;
}

@if substeps
/* Into how many parts the step is divided: within it the drive is linear, but hysteresis bends it. */
static int parts_of_step(const piezo_forward *state, real drive_v)
{
    real size = most(drive_v - state->voltage_v, state->voltage_v - drive_v);
    int n_parts = 1;
@if bends
    size = most(size, state->bend);
    if (size > SMALL_CHANGE) n_parts = N_PARTS_SMALL;
@end
    if (size > LARGE_CHANGE) n_parts = N_PARTS_LARGE;
    return n_parts > N_PARTS_LEAST ? n_parts : N_PARTS_LEAST;
}

@end
/* One step, or a part of one, in which the drive is linear. */
static real forward_part(piezo_forward *state, const coefficients *k, real value, real step_s)
{
@insert forward_drive
    real moved, history;
@if widened
    real widening = R(1.0);
@end
@if heard
    real heard_v;
@end
@insert forward_hysteresis
@if heard
    heard_v = value;
@end
    history = creep_history(k, state->modes, state->previous);
@if float
    creep_remember(k, state->modes, state->lost, state->previous, moved);
@end
@if not float
    creep_remember(k, state->modes, state->previous, moved);
@end
    state->previous = moved;
    value = k->current_weight * moved + history;
@insert forward_mechanical
    (void)step_s;
    return value;
}
@if substeps

/* The whole step, part by part. */
static real forward_parts(piezo_forward *state, const coefficients *k, real drive_v, real step_s, int n_parts)
{
    const real n = (real)n_parts, before_v = state->voltage_v, part_v = (drive_v - before_v) / n, part_s = step_s / n;
@if bends
    const real size = most(drive_v - before_v, before_v - drive_v);
    state->bend = most(BEND_AFTER * size, BEND_FADES * state->bend);
@end
@if held
    real sum = R(0.0); /* a sample reads the mean over its parts, with the jump in their middle */
    (void)part_v;
    for (int i = 1; i <= n_parts; i++) {
        const int beyond = 2 * i - n_parts - 1;
        const real held_v = beyond < 0 ? before_v : beyond > 0 ? drive_v : R(0.5) * (before_v + drive_v);
        sum += forward_part(state, k, held_v, part_s);
    }
    return sum / n;
@end
@if not held
    for (int i = 1; i < n_parts; i++) (void)forward_part(state, k, before_v + part_v * (real)i, part_s);
    return forward_part(state, k, drive_v, part_s);
@end
}
@end

#ifndef PIEZO_FIXED_STEP_ONLY
piezo_real piezo_forward_step(piezo_forward *state, piezo_real voltage_v, piezo_real step_s)
{
    coefficients k;
    real value = voltage_v;
    if (!is_within(voltage_v, (real)PIEZO_LARGEST_INPUT) || !is_step(step_s)) return NOT_A_NUMBER;
    if (step_s == (piezo_real)PIEZO_SAMPLE_TIME_S) return piezo_forward_step_fixed(state, voltage_v);
@insert forward_sampled
    {
        const real drive_v = value;
@if substeps
        const int n_parts = parts_of_step(state, drive_v);
        prepare(&k, step_s / (real)n_parts);
        value = forward_parts(state, &k, drive_v, step_s, n_parts);
@end
@if not substeps
        prepare(&k, step_s);
@if held
        value = forward_part(state, &k, R(0.5) * (state->voltage_v + drive_v), step_s);
@end
@if not held
        value = forward_part(state, &k, drive_v, step_s);
@end
@end
        state->voltage_v = drive_v;
    }
@if forward_can_fail
    if (!is_within(value, REAL_MAX)) return NOT_A_NUMBER;
@end
@insert forward_sensed
    return (piezo_real)value;
}
#endif

piezo_real piezo_forward_step_fixed(piezo_forward *state, piezo_real voltage_v)
{
    real value = voltage_v;
    if (!is_within(voltage_v, (real)PIEZO_LARGEST_INPUT)) return NOT_A_NUMBER;
@insert forward_sampled_fixed
    {
        const real drive_v = value, step_s = (real)PIEZO_SAMPLE_TIME_S;
@if substeps
        const int n_parts = parts_of_step(state, drive_v);
        value = forward_parts(state, fixed_for(n_parts), drive_v, step_s, n_parts);
@end
@if not substeps
@if held
        value = forward_part(state, &FIXED_1, R(0.5) * (state->voltage_v + drive_v), step_s);
@end
@if not held
        value = forward_part(state, &FIXED_1, drive_v, step_s);
@end
@end
        state->voltage_v = drive_v;
    }
@if forward_can_fail
    if (!is_within(value, REAL_MAX)) return NOT_A_NUMBER;
@end
@insert forward_sensed_fixed
    return (piezo_real)value;
}
@insert forward_setters
