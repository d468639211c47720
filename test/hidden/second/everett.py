"""Hysteresis with return-point memory, from its Everett function and the stack of reversals not yet wiped out.

Any Preisach operator is known by E(high, low): how much the output rises on the way from a reversal at `low` to
`high`, and falls on the way back. See I. D. Mayergoyz, "Mathematical models of hysteresis", 1991, chapter 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from test.hidden.second.reversals import sweeps_of

Everett = Callable[[np.ndarray, np.ndarray], np.ndarray]
_N_SWINGS = 2000  # of the decaying drive that relaxes the actuator beforehand
_OVERSHOOT = 1.05  # of its first swing over all that follows


def run_everett(everett: Everett, drive: np.ndarray) -> np.ndarray:
    """Return the output, shape of the drive, of an operator relaxed at a drive of 0 by swings that die away.

    Args:
        everett: E(high, low) of two arrays of one shape, high >= low.
        drive: from 0, shape (n_samples,).
    """
    largest = _OVERSHOOT * max(float(np.max(np.abs(drive))), 1e-300)
    # Half a swing apart on either side, so that the staircase in the plane has as much above as below the line.
    swings = largest * (1.0 - np.arange(2 * _N_SWINGS) / (2 * _N_SWINGS)) * (1 - 2 * (np.arange(2 * _N_SWINGS) % 2))
    places = swings.tolist()  # of every reversal ever made
    parents = [-1, *range(2 * _N_SWINGS - 1)]  # the reversal each was reached from
    open_ones = list(range(2 * _N_SWINGS))  # not wiped out, outermost first
    rest_from = open_ones[-1]
    start, parent = [0], [rest_from]
    sweeps = sweeps_of(drive)
    before = 1  # the last swing was to below 0, and from there up to it
    for first, last, heading in zip(sweeps.first.tolist(), sweeps.last.tolist(), sweeps.heading.tolist(), strict=True):
        if heading != before:
            places.append(float(drive[first]))
            parents.append(open_ones[-1])
            open_ones.append(len(places) - 1)
            before = heading
        begin = first + 1
        goal = float(drive[last])
        while (goal - places[open_ones[-2]]) * heading > 0.0:
            begin_next = first + 1 + _first_beyond(drive[first + 1 : last + 1], places[open_ones[-2]], heading)
            start.append(begin)
            parent.append(open_ones[-1])
            begin = begin_next
            del open_ones[-2:]
        start.append(begin)
        parent.append(open_ones[-1])
    return _evaluate(everett, drive, (places, parents), (start, parent), rest_from)


def _first_beyond(values: np.ndarray, level: float, heading: int) -> int:
    return int((heading * values).searchsorted(heading * level, side="right"))


def _evaluate(
    everett: Everett,
    drive: np.ndarray,
    tree: tuple[list[float], list[int]],
    pieces: tuple[list[int], list[int]],
    rest_from: int,
) -> np.ndarray:
    """Add up Everett functions along the tree of reversals, then along every piece of the drive."""
    places, parents = np.array(tree[0]), np.array(tree[1])
    rises = np.zeros(places.size)
    rises[1:] = _signed(everett, places[1:], places[parents[1:]])
    outputs = rises.tolist()
    for k, up in enumerate(parents.tolist()):
        if up >= 0:
            outputs[k] += outputs[up]
    levels = np.array(outputs)
    start, parent = np.array(pieces[0]), np.array(pieces[1])
    of = np.repeat(parent, np.diff(np.append(start, drive.size)))
    rest = levels[rest_from] + _signed(everett, np.zeros(1), places[[rest_from]])[0]
    return levels[of] + _signed(everett, drive, places[of]) - rest


def _signed(everett: Everett, to: np.ndarray, since: np.ndarray) -> np.ndarray:
    return np.sign(to - since) * everett(np.maximum(to, since), np.minimum(to, since))
