@insert banner
#include "piezo.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "input that is not a number could not be told: compile without -ffast-math"
#endif

@if wide
/* What comes in and goes out is float, what is computed between is double: where an effect jumps, float would jump a
   sample earlier or later. */
typedef double real;
@end
@if not wide
typedef piezo_real real;
@end

@if float
#define R(number) number##f
#define EXP expf
#define POW powf
@end
@if not float
#define R(number) number
#define EXP exp
#define POW pow
@end
@if float_answers
#define REAL_MAX FLT_MAX
@end
@if not float_answers
#define REAL_MAX DBL_MAX
@end
#define NOT_A_NUMBER ((piezo_real)NAN)
@if searches

/* Where a search ends: what the precision can tell apart. */
@if float
#define REACH_LEAST 1.0e-6f
#define WIDTH_LEAST 1.0e-7f
#define ERROR_LEAST 1.0e-6f
@end
@if not float
#define REACH_LEAST 1.0e-12
#define WIDTH_LEAST 1.0e-14
#define ERROR_LEAST 1.0e-12
@end
@end

@insert constants

@insert coefficient_types

/* What a step length makes of the model. */
typedef struct coefficients {
    real decay[N_MODES]; /* double: what is left of a mode after the step; float: what is gone of it */
    real weighted_decay[N_MODES]; /* its weight in what the past alone gives */
    real from_previous[N_MODES]; /* what the input before the step adds to the mode */
    real from_current[N_MODES]; /* what the input at its end adds */
    real current_weight; /* weight of the present input in the output */
    real held_weight; /* weight of the input before */
@insert coefficient_fields
} coefficients;

@insert fixed_coefficients

static real least(real a, real b)
{
    return a < b ? a : b;
}

static real most(real a, real b)
{
    return a > b ? a : b;
}

/* False for what is not a number as well. */
static int is_within(real value, real limit)
{
    return value >= -limit && value <= limit;
}

@insert effects

#ifndef PIEZO_FIXED_STEP_ONLY
static int is_step(piezo_real step_s)
{
    return step_s >= (piezo_real)PIEZO_SHORTEST_STEP_S && step_s <= (piezo_real)PIEZO_LONGEST_STEP_S;
}

/* Coefficients of any step: the modes are integrated exactly for an input that is linear over it. */
static void prepare(coefficients *k, real step_s)
{
    real held = R(0.0);
    for (size_t j = 0; j < N_MODES; j++) {
        const real a = RATE[j] * step_s;
        real gone, mean, ramp;
        if (a < R(0.5)) {
            /* series of (1 - (1 - e^-a)/a)/a, sum of (-a)^k / (k + 2)!: the closed form cancels for small a */
            ramp = R(1.0) / R(87178291200.0) - a / R(1307674368000.0);
            ramp = R(1.0) / R(479001600.0) - a * (R(1.0) / R(6227020800.0) - a * ramp);
            ramp = R(1.0) / R(3628800.0) - a * (R(1.0) / R(39916800.0) - a * ramp);
            ramp = R(1.0) / R(40320.0) - a * (R(1.0) / R(362880.0) - a * ramp);
            ramp = R(1.0) / R(720.0) - a * (R(1.0) / R(5040.0) - a * ramp);
            ramp = R(1.0) / R(24.0) - a * (R(1.0) / R(120.0) - a * ramp);
            ramp = R(0.5) - a * (R(1.0) / R(6.0) - a * ramp);
            mean = R(1.0) - a * ramp;
            gone = a * mean;
        } else {
            gone = R(1.0) - EXP(-a);
            mean = gone / a;
            ramp = (R(1.0) - mean) / a;
        }
@if float
        k->decay[j] = gone;
@end
@if not float
        k->decay[j] = R(1.0) - gone;
@end
        k->weighted_decay[j] = WEIGHT[j] * (R(1.0) - gone);
        k->from_previous[j] = step_s * (mean - ramp);
        k->from_current[j] = step_s * ramp;
        held += WEIGHT[j] * (k->from_previous[j] + k->from_current[j]);
    }
    k->current_weight = POW(step_s, CREEP_ORDER) * INVERSE_GAMMA;
    k->held_weight = FEEDTHROUGH - k->current_weight + held;
@insert prepare_effects
}
#endif
@if plays

/* Hysteresis from voltage to displacement: a sum of play operators. Two sums: the processor need not wait for one. */
@if plain_plays
static real move_plays(real *plays, real value)
{
    real even = PLAY_SLOPE * value, odd = R(0.0);
    for (size_t j = 0; j < N_PLAYS; j += 2) {
        plays[j] = least(most(plays[j], value - PLAY_THRESHOLD[j]), value + PLAY_THRESHOLD[j]);
        plays[j + 1] = least(most(plays[j + 1], value - PLAY_THRESHOLD[j + 1]), value + PLAY_THRESHOLD[j + 1]);
        even += PLAY_WEIGHT[j] * plays[j];
        odd += PLAY_WEIGHT[j + 1] * plays[j + 1];
    }
    return even + odd;
}
@end
@end
@if widened

/* The same with all thresholds wider by a factor. */
static real move_widened_plays(real *plays, real value, real factor)
{
    real even = PLAY_SLOPE * value, odd = R(0.0);
    for (size_t j = 0; j < N_PLAYS; j += 2) {
        const real first = factor * PLAY_THRESHOLD[j], second = factor * PLAY_THRESHOLD[j + 1];
        plays[j] = least(most(plays[j], value - first), value + first);
        plays[j + 1] = least(most(plays[j + 1], value - second), value + second);
        even += PLAY_WEIGHT[j] * plays[j];
        odd += PLAY_WEIGHT[j + 1] * plays[j + 1];
    }
    return even + odd;
}
@end
@if sum_plays

/* The same at an input the plays are not moved to. */
static real sum_plays(const real *plays, real value)
{
    real even = PLAY_SLOPE * value, odd = R(0.0);
    for (size_t j = 0; j < N_PLAYS; j += 2) {
        even += PLAY_WEIGHT[j] * least(most(plays[j], value - PLAY_THRESHOLD[j]), value + PLAY_THRESHOLD[j]);
        odd += PLAY_WEIGHT[j + 1] *
               least(most(plays[j + 1], value - PLAY_THRESHOLD[j + 1]), value + PLAY_THRESHOLD[j + 1]);
    }
    return even + odd;
}
@end
@if stops

/* Hysteresis from displacement, creep taken out, to voltage: a sum of stop operators, each its input less a play. */
@if sum_stops
static real sum_stops(const real *plays, real value)
{
    real even = STOP_SLOPE * value, odd = R(0.0);
    for (size_t j = 0; j < N_PLAYS; j += 2) {
        even += STOP_WEIGHT[j] * least(most(value - plays[j], -STOP_THRESHOLD[j]), STOP_THRESHOLD[j]);
        odd += STOP_WEIGHT[j + 1] * least(most(value - plays[j + 1], -STOP_THRESHOLD[j + 1]), STOP_THRESHOLD[j + 1]);
    }
    return even + odd;
}

@end
static real move_stops(real *plays, real value)
{
    real even = STOP_SLOPE * value, odd = R(0.0);
    for (size_t j = 0; j < N_PLAYS; j += 2) {
        const real first = least(most(value - plays[j], -STOP_THRESHOLD[j]), STOP_THRESHOLD[j]);
        const real second = least(most(value - plays[j + 1], -STOP_THRESHOLD[j + 1]), STOP_THRESHOLD[j + 1]);
        plays[j] = value - first;
        plays[j + 1] = value - second;
        even += STOP_WEIGHT[j] * first;
        odd += STOP_WEIGHT[j + 1] * second;
    }
    return even + odd;
}
@end

/* What the past alone gives at the end of the step. */
static real creep_history(const coefficients *k, const real *modes, real previous)
{
    real even = k->held_weight * previous, odd = R(0.0);
    for (size_t j = 0; j < N_MODES; j += 2) {
        even += k->weighted_decay[j] * modes[j];
        odd += k->weighted_decay[j + 1] * modes[j + 1];
    }
    return even + odd;
}

@if float
/* Move the modes to the end of the step. What a slow mode gains in one step is less than the last digit of the mode:
   what was lost of it is kept and added the next time. */
static void creep_remember(const coefficients *k, real *modes, real *lost, real previous, real current)
{
    for (size_t j = 0; j < N_MODES; j++) {
        const real gained = k->from_previous[j] * previous + k->from_current[j] * current - k->decay[j] * modes[j];
        const real owed = gained - lost[j];
        const real mode = modes[j] + owed;
        lost[j] = (mode - modes[j]) - owed;
        modes[j] = mode;
    }
}
@end
@if not float
/* Move the modes to the end of the step. */
static void creep_remember(const coefficients *k, real *modes, real previous, real current)
{
    for (size_t j = 0; j < N_MODES; j++)
        modes[j] = k->decay[j] * modes[j] + (k->from_previous[j] * previous + k->from_current[j] * current);
}
@end
