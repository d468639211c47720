
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

@if beside
/* What hysteresis gives at a voltage, effects beside the elements with it; nothing moves. */
static real sum_at(piezo_inverse *state, real voltage_v)
{
    real moved = sum_plays(state->plays, voltage_v);
@insert beside_sum
    return moved;
}

/* The voltage [V] at which hysteresis gives what is wanted: between two that enclose it, by secants and halving, from
   the last one on. Bounded: at most 160 trials. */
static real voltage_for(piezo_inverse *state, real wanted)
{
    real low = state->elements_v, high = low, low_error = sum_at(state, low) - wanted, high_error = low_error;
    real reach = most(most(low_error, -low_error) / PLAY_SLOPE, REACH_LEAST);
    for (int i = 0; i < 60; i++) {
        if (low_error > R(0.0)) {
            low -= reach;
            low_error = sum_at(state, low) - wanted;
        } else if (high_error < R(0.0)) {
            high += reach;
            high_error = sum_at(state, high) - wanted;
        } else {
            break;
        }
        reach *= R(2.0);
    }
    for (int i = 0; i < 100; i++) {
        real middle, error;
        if (high - low <= WIDTH_LEAST * (most(high, -high) + most(low, -low)) || high_error == low_error) break;
        middle = i % 3 == 2 ? R(0.5) * (low + high) : low - low_error * (high - low) / (high_error - low_error);
        error = sum_at(state, middle) - wanted;
        if (error >= R(0.0)) {
            high = middle;
            high_error = error;
        }
        if (error <= R(0.0)) {
            low = middle;
            low_error = error;
        }
    }
    return most(low_error, -low_error) <= most(high_error, -high_error) ? low : high;
}

@end
/* The voltage [V] for a desired displacement [um]; the state moves on. */
static real inverse_value(piezo_inverse *state, const coefficients *k, real desired_um, real step_s)
{
    real value = desired_um;
@insert inverse_before
    value = creep_undone(state, k, value);
    creep_undone_remember(state, k, value);
@if beside
    value = voltage_for(state, value);
    state->elements_v = value;
    (void)move_plays(state->plays, value);
@insert beside_moves
@insert inverse_unwarp
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

/* The same, where there is such a voltage; where there is none the state stays as it was. */
static real taken(piezo_inverse *state, const coefficients *k, real desired_um, real step_s)
{
@if can_fail
    piezo_inverse moved = *state;
    const real answer = inverse_value(&moved, k, desired_um, step_s);
    if (is_within(answer, REAL_MAX)) *state = moved;
    return answer;
@end
@if not can_fail
    return inverse_value(state, k, desired_um, step_s);
@end
}

#ifndef PIEZO_FIXED_STEP_ONLY
piezo_real piezo_inverse_step(piezo_inverse *state, piezo_real desired_um, piezo_real step_s)
{
    coefficients k;
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT) || !is_step(step_s)) return NOT_A_NUMBER;
    if (step_s == (piezo_real)PIEZO_SAMPLE_TIME_S) return piezo_inverse_step_fixed(state, desired_um);
    prepare(&k, step_s);
    return (piezo_real)taken(state, &k, desired_um, step_s);
}
#endif

piezo_real piezo_inverse_step_fixed(piezo_inverse *state, piezo_real desired_um)
{
    if (!is_within(desired_um, (real)PIEZO_LARGEST_INPUT)) return NOT_A_NUMBER;
    return (piezo_real)taken(state, &FIXED_1, desired_um, (real)PIEZO_SAMPLE_TIME_S);
}
@insert inverse_setters
