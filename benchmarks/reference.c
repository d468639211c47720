/* The same algorithm in plain C: play or stop sum, then creep by modes, one sample after the other, equal steps.
   Written as one would write it first; the compiler's flags are the only tuning. */
#include <stddef.h>

typedef struct {
    size_t n_plays, n_modes;
    double slope, current, held, previous;
    const double *thresholds, *weights, *decays, *from_previous, *from_current, *weighted_decays;
    double *plays, *modes;
} chain;

static double history(const chain *c) {
    double sum = c->held * c->previous;
    for (size_t j = 0; j < c->n_modes; j++) sum += c->weighted_decays[j] * c->modes[j];
    return sum;
}

static void remember(chain *c, double value) {
    double *restrict modes = c->modes;
    const double *restrict decays = c->decays, *restrict a = c->from_previous, *restrict b = c->from_current;
    const double previous = c->previous;
    for (size_t j = 0; j < c->n_modes; j++) modes[j] = decays[j] * modes[j] + a[j] * previous + b[j] * value;
    c->previous = value;
}

static double move_plays(chain *c, double value) {
    double *restrict plays = c->plays;
    const double *restrict thresholds = c->thresholds, *restrict weights = c->weights;
    double sum = c->slope * value;
    for (size_t j = 0; j < c->n_plays; j++) {
        double low = value - thresholds[j], high = value + thresholds[j], play = plays[j];
        play = play > low ? play : low;
        play = play < high ? play : high;
        plays[j] = play;
        sum += weights[j] * play;
    }
    return sum;
}

static double move_stops(chain *c, double value) {
    double *restrict plays = c->plays;
    const double *restrict thresholds = c->thresholds, *restrict weights = c->weights;
    double sum = c->slope * value;
    for (size_t j = 0; j < c->n_plays; j++) {
        double stop = value - plays[j];
        stop = stop > -thresholds[j] ? stop : -thresholds[j];
        stop = stop < thresholds[j] ? stop : thresholds[j];
        plays[j] = value - stop;
        sum += weights[j] * stop;
    }
    return sum;
}

void forward(chain *c, size_t n, const double *voltage, double *out) {
    for (size_t k = 0; k < n; k++) {
        double moved = move_plays(c, voltage[k]);
        out[k] = c->current * moved + history(c);
        remember(c, moved);
    }
}

void inverse(chain *c, size_t n, const double *desired, double *out) {
    for (size_t k = 0; k < n; k++) {
        double moved = (desired[k] - history(c)) / c->current;
        remember(c, moved);
        out[k] = move_stops(c, moved);
    }
}

void stops(chain *c, size_t n, const double *displacement, double *out) {
    for (size_t k = 0; k < n; k++) out[k] = move_stops(c, displacement[k]);
}
