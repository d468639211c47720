
void piezo_forward_init(piezo_forward *state)
{
    static const piezo_forward relaxed = PIEZO_FORWARD_RELAXED;
    *state = relaxed;
}

@if substeps
@insert parts_of_step

@end
/* One step, or a part of one, in which the drive is linear. */
static real forward_part(piezo_forward *state, const coefficients *k, real value, real step_s)
{
    real moved;
@insert forward_drive
    moved = move_plays(state->plays, value);
@insert forward_beside
    {
        const real history = creep_history(k, state->modes, state->previous);
@if float
        creep_remember(k, state->modes, state->lost, state->previous, moved);
@end
@if not float
        creep_remember(k, state->modes, state->previous, moved);
@end
        state->previous = moved;
        moved = k->current_weight * moved + history;
    }
@insert forward_mechanical
    (void)step_s;
    return moved;
}
@if substeps

/* The whole step: the drive at its end, and the parts it is divided into. */
static real forward_parts(piezo_forward *state, const coefficients *k, real drive_v, real step_s, int n_parts)
{
    const real n = (real)n_parts, before_v = state->voltage_v, part_v = (drive_v - before_v) / n, part_s = step_s / n;
    real moved = R(0.0);
    for (int i = 1; i < n_parts; i++) moved = forward_part(state, k, before_v + part_v * (real)i, part_s);
    moved = forward_part(state, k, drive_v, part_s);
    state->voltage_v = drive_v;
    (void)moved;
    return moved;
}
@end

#ifndef PIEZO_FIXED_STEP_ONLY
real piezo_forward_step(piezo_forward *state, real voltage_v, real step_s)
{
    coefficients k;
    real value = voltage_v;
    if (!is_within(voltage_v, (real)PIEZO_LARGEST_INPUT) || !is_step(step_s)) return NOT_A_NUMBER;
    if (step_s == (real)PIEZO_SAMPLE_TIME_S) return piezo_forward_step_fixed(state, voltage_v);
@insert forward_sampled
@if substeps
    {
        const int n_parts = parts_of_step(state, value);
        prepare(&k, step_s / (real)n_parts);
        value = forward_parts(state, &k, value, step_s, n_parts);
    }
@end
@if not substeps
    prepare(&k, step_s);
    value = forward_part(state, &k, value, step_s);
    state->voltage_v = voltage_v;
@end
@insert forward_sensed
    return value;
}
#endif

real piezo_forward_step_fixed(piezo_forward *state, real voltage_v)
{
    real value = voltage_v;
    if (!is_within(voltage_v, (real)PIEZO_LARGEST_INPUT)) return NOT_A_NUMBER;
@insert forward_sampled_fixed
@if substeps
    {
        const int n_parts = parts_of_step(state, value);
        value = forward_parts(state, fixed_for(n_parts), value, (real)PIEZO_SAMPLE_TIME_S, n_parts);
    }
@end
@if not substeps
    value = forward_part(state, &FIXED, value, (real)PIEZO_SAMPLE_TIME_S);
    state->voltage_v = voltage_v;
@end
@insert forward_sensed_fixed
    return value;
}
