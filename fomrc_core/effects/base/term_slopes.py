"""What small changes of a displacement make of sums of terms of it: their slope, exactly, beside one run of the sum."""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.terms import MOST_PATH, REACH, Array, shares_of


def slopes_of_sum(
    terms: tuple[Array, Array, Array, Array, Array], span_um: float, values: Array, changes: Array, steps_s: Array
) -> Array:
    """Return the changes with what they change of the terms [of a change], shape (n_samples, n_changes).

    By differences each change costs two runs of the sum; the slope needs one run for all of them, and at a kink it is
    that of the side the sum is on.

    Args:
        terms: weights [um], powers, lags [s], powers of lags and thresholds of the terms, each of shape (n_terms,).
        span_um: largest displacement [um].
        values: the displacement [um], shape (n_samples,).
        changes: of it, shape (n_samples, n_changes).
        steps_s: step that leads to each sample [s], shape (n_samples,).
    """
    out = np.array(changes, dtype=np.float64, order="C")
    _add_slopes(*terms, span_um, np.ascontiguousarray(values), np.ascontiguousarray(steps_s), out)
    return out


@compiled
def _add_slopes(  # noqa: C901 - one pass over factors that each remember something
    weights: Array,
    powers: Array,
    lags_s: Array,
    lag_powers: Array,
    thresholds: Array,
    span_um: float,
    values: Array,
    steps_s: Array,
    out: Array,
) -> None:
    # Long: a term is a product of three factors with a memory each, and every memory has a slope.
    n_terms, n_changes = weights.size, out.shape[1]
    gone, ramps = np.zeros(n_terms), np.zeros(n_terms)
    late, play = np.zeros(n_terms), np.zeros(n_terms)
    late_slope, play_slope = np.zeros((n_terms, n_changes)), np.zeros((n_terms, n_changes))
    here, earlier, total = np.zeros(n_changes), np.zeros(n_changes), np.zeros(n_changes)
    before, step_s = 0.0, -1.0
    for k in range(values.size):
        step_s = shares_of(lags_s, steps_s[k], step_s, gone, ramps)
        x = values[k] / span_um
        is_inside = -REACH < x < REACH
        x = min(max(x, -REACH), REACH)
        for c in range(n_changes):
            here[c] = out[k, c] / span_um if is_inside else 0.0
            total[c] = 0.0
        for j in range(n_terms):
            steep, power = 0.0, 1.0
            for _ in range(int(powers[j])):
                steep = steep * x + power
                power *= x
            memory, by_x, by_late = 1.0, 0.0, 0.0
            kept, by_here, by_earlier = 0.0, 0.0, 0.0
            if lags_s[j] > 0.0:
                if lag_powers[j] < 0.5:
                    gone_on = late[j] - gone[j] * late[j] + abs(x - before)
                    if gone_on < MOST_PATH:
                        kept = 1.0 - gone[j]
                        by_here = 1.0 if x > before else (-1.0 if x < before else 0.0)
                        by_earlier = -by_here
                    late[j] = min(gone_on, MOST_PATH)
                    memory, by_late = late[j], 1.0
                else:
                    late[j] += ramps[j] * x + (gone[j] - ramps[j]) * before - gone[j] * late[j]
                    kept, by_here, by_earlier = 1.0 - gone[j], ramps[j], gone[j] - ramps[j]
                    behind = x - late[j]
                    exponent = 1 if lag_powers[j] < 1.5 else (2 if lag_powers[j] < 2.5 else 3)
                    by_x = 1.0
                    memory = behind
                    for _ in range(exponent - 1):
                        by_x = by_x * behind + memory
                        memory *= behind
                    by_late = -by_x
            place, is_held = 1.0, False
            if thresholds[j] > 0.0:
                low, high = x - thresholds[j], x + thresholds[j]
                is_held = low < play[j] < high
                play[j] = min(max(play[j], low), high)
                place = x - play[j]
            # weight times each factor's slope, the other two as they are
            of_x = weights[j] * (steep * memory * place + power * by_x * place)
            of_late = weights[j] * power * by_late * place
            of_place = weights[j] * power * memory if thresholds[j] > 0.0 else 0.0
            for c in range(n_changes):
                if lags_s[j] > 0.0:
                    late_slope[j, c] = kept * late_slope[j, c] + by_here * here[c] + by_earlier * earlier[c]
                if thresholds[j] > 0.0 and not is_held:
                    play_slope[j, c] = here[c]
                total[c] += of_x * here[c] + of_late * late_slope[j, c] + of_place * (here[c] - play_slope[j, c])
        for c in range(n_changes):
            out[k, c] += total[c]
            earlier[c] = here[c]
        before = x
