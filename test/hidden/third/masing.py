"""Masing's rule: every branch is the first loading, twice as large, from where the motion turned."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from test.hidden.third.arrays import Array


def runs(signal: Array) -> Iterator[tuple[int, int, float]]:
    """Yield first and last index of every stretch in which a signal does not turn, and its direction, 1 or -1."""
    change = np.diff(signal)
    moving = np.flatnonzero(change)
    if moving.size == 0:
        return
    sign = np.sign(change[moving])
    # A rest belongs to the run before it, so that a turn lies at the sample where the motion back begins.
    turns = moving[1:][sign[1:] != sign[:-1]]
    bounds = [0, *turns.tolist(), signal.size - 1]
    for k in range(len(bounds) - 1):
        yield bounds[k], bounds[k + 1], float(sign[0]) * (-1.0) ** k


def masing(signal: Array, curve: Callable[[Array], Array]) -> Array:
    """Return the response to a path from the relaxed state at zero.

    y = y_turn + 2 g((v - v_turn) / 2) on a branch, y = g(v) on the first loading. Turns wait on a stack; a branch that
    passes the turn before its own wipes both out and goes on as the branch they interrupted.

    Args:
        signal: the path, of any unit, shape (n,).
        curve: g, odd, increasing, of signed distances.
    """
    signal = np.asarray(signal, dtype=float)
    response = np.empty_like(signal)
    response[0] = curve(signal[:1])[0]
    response[:] = response[0]
    stack: list[tuple[float, float]] = []
    for first, last, way in runs(signal):
        if stack or way * signal[first] < 0.0:
            stack.append((float(signal[first]), float(response[first])))
        at = first + 1
        rising = way * signal[first + 1 : last + 1]
        while at <= last:
            limit = _limit(stack)
            end = first + 1 + int(np.searchsorted(rising, way * limit, side="right")) if stack else last + 1
            part = slice(at, end)
            if stack:
                turn_v, turn_um = stack[-1]
                response[part] = turn_um + 2.0 * curve(0.5 * (signal[part] - turn_v))
            else:
                response[part] = curve(signal[part])
            at = max(at, end)
            if at <= last:
                del stack[-2:]
    return response


def _limit(stack: list[tuple[float, float]]) -> float:
    """Return where the present branch ends: at the turn before, or where it meets the first loading."""
    if not stack:
        return 0.0
    return stack[-2][0] if len(stack) > 1 else -stack[0][0]
