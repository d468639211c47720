/* The same algorithm in plain C: play or stop sum, then creep by modes, one sample after the other, equal steps.
   Written as one would write it first; the compiler's flags are the only tuning. */
#include <stddef.h>

typedef struct {
    size_t n_plays, n_modes;
    double slope, current, held, previous;
    const double *thresholds, *weights, *decays, *from_previous, *from_current, *weighted_decays;
    double *plays, *modes;
} chain;

/* What does not change, in locals: the compiler need not read it again after each store. */
#define LOCALS \
    const size_t n_plays = c->n_plays, n_modes = c->n_modes; \
    const double slope = c->slope, current = c->current, held = c->held; \
    const double *restrict r = c->thresholds, *restrict g = c->weights, *restrict d = c->decays; \
    const double *restrict a = c->from_previous, *restrict b = c->from_current, *restrict w = c->weighted_decays; \
    double *restrict p = c->plays, *restrict q = c->modes; \
    double previous = c->previous; \
    (void)n_modes, (void)current, (void)held, (void)d, (void)a, (void)b, (void)w, (void)q, (void)previous

void forward(chain *c, size_t n, const double *restrict voltage, double *restrict out) {
    LOCALS;
    for (size_t k = 0; k < n; k++) {
        const double value = voltage[k];
        double moved = slope * value, history = held * previous;
        for (size_t j = 0; j < n_plays; j++) {
            const double low = value - r[j], high = value + r[j];
            double play = p[j];
            play = play > low ? play : low;
            play = play < high ? play : high;
            p[j] = play;
            moved += g[j] * play;
        }
        for (size_t j = 0; j < n_modes; j++) history += w[j] * q[j];
        out[k] = current * moved + history;
        for (size_t j = 0; j < n_modes; j++) q[j] = d[j] * q[j] + a[j] * previous + b[j] * moved;
        previous = moved;
    }
    c->previous = previous;
}

static inline double move_stops(size_t n_plays, double slope, const double *restrict r, const double *restrict g,
                                double *restrict p, double value) {
    double sum = slope * value;
    for (size_t j = 0; j < n_plays; j++) {
        double stop = value - p[j];
        stop = stop > -r[j] ? stop : -r[j];
        stop = stop < r[j] ? stop : r[j];
        p[j] = value - stop;
        sum += g[j] * stop;
    }
    return sum;
}

void inverse(chain *c, size_t n, const double *restrict desired, double *restrict out) {
    LOCALS;
    for (size_t k = 0; k < n; k++) {
        double history = held * previous;
        for (size_t j = 0; j < n_modes; j++) history += w[j] * q[j];
        const double moved = (desired[k] - history) / current;
        for (size_t j = 0; j < n_modes; j++) q[j] = d[j] * q[j] + a[j] * previous + b[j] * moved;
        previous = moved;
        out[k] = move_stops(n_plays, slope, r, g, p, moved);
    }
    c->previous = previous;
}

void stops(chain *c, size_t n, const double *restrict displacement, double *restrict out) {
    LOCALS;
    for (size_t k = 0; k < n; k++) out[k] = move_stops(n_plays, slope, r, g, p, displacement[k]);
}
