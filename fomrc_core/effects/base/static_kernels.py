"""Sums of static terms of a displacement: kinks, and what repeats with a period of it.

For controllers (step forms) and compiled, one beside the other; ``effects/unnamed_static.py`` says what a term is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.step_form import Fields, Number

Array = NDArray[np.float64]

STATIC_REACH = 2.0  # share of the span beyond which terms stand still: a line may go on as far as it was learned
_N_TURNS = 60  # of the inverse, each of which halves the error at least


def static_term(knot: float, cycles: float, turn: float, x: float) -> float:
    """Return one term: what x is beyond a knot, or where it repeats, a sine of it."""
    if cycles > 0.0:
        return math.sin(6.283185307179586 * (cycles * x + turn))
    return max(x - knot, 0.0)


def add_static_terms(c: Fields, value: float) -> Number:
    """Return the value with the terms of it [um]."""
    x = min(max(value / c.span_um, -c.reach), c.reach)
    total = 0.0
    for j in range(len(c.weights_um)):
        total = total + c.weights_um[j] * static_term(c.knots[j], c.cycles[j], c.turns[j], x)
    return value + total


def take_static_terms(c: Fields, value: float) -> Number:
    """Return the value whose terms make it this one [um]."""
    found = value
    # a contraction, for the terms are less steep than the displacement
    for _ in range(60):
        x = min(max(found / c.span_um, -c.reach), c.reach)
        total = 0.0
        for j in range(len(c.weights_um)):
            total = total + c.weights_um[j] * static_term(c.knots[j], c.cycles[j], c.turns[j], x)
        moved = value - total
        is_still = abs(moved - found) <= 1e-15 * c.span_um
        found = moved
        if is_still:
            break
    return found


_static_term = compiled(static_term)


@compiled
def static_columns(terms: Array, x: Array, columns: Array, total: Array) -> None:
    """Fill ``columns`` with each term without its weight, where it has rows, and ``total`` with their sum.

    ``terms`` has the rows weights, knots, cycles, turns; ``x`` is the share of the span.
    """
    for n in range(x.size):
        here = min(max(x[n], -STATIC_REACH), STATIC_REACH)
        total[n] = 0.0
        for j in range(terms.shape[1]):
            term = _static_term(terms[1, j], terms[2, j], terms[3, j], here)
            total[n] += terms[0, j] * term
            if columns.shape[0] > 0:
                columns[n, j] = term


@compiled
def invert_static(terms: Array, span_um: float, values: Array, out: Array) -> None:
    """Fill ``out`` with the values whose terms make them these [um]."""
    found = 0.0
    for n in range(values.size):
        found = values[n]
        # a contraction, for the terms are less steep than the displacement
        for _ in range(_N_TURNS):
            here = min(max(found / span_um, -STATIC_REACH), STATIC_REACH)
            total = 0.0
            for j in range(terms.shape[1]):
                total += terms[0, j] * _static_term(terms[1, j], terms[2, j], terms[3, j], here)
            moved = values[n] - total
            is_still = abs(moved - found) <= 1e-15 * span_um
            found = moved
            if is_still:
                break
        out[n] = found
