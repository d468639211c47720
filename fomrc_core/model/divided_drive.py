"""A drive on the parts of its steps; those of one record kept, for a fit mostly divides it as the time before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import Substeps, held_parts, means_of_parts, parts_of_steps, subdivide
from fomrc_core.operators.hysteresis import HEADER as PLAYS_HEADER
from fomrc_core.operators.hysteresis import N_PLAYS

Array = NDArray[np.float64]

_MOST_KEPT = 3  # a fit goes between its residual, coarser directions, and a rival's finer parts
_MOST_PARTS = 1_000_000  # of one that is kept: beyond, the room it takes is worth more than the time


@dataclass(frozen=True, eq=False)
class ElementDrive:
    """What the Maxwell elements see of a drive.

    Attributes:
        steps_s: step that leads to each part [s], shape (n_parts,).
        voltage_v: voltage at the elements at the end of each part [V], shape (n_parts,).
        ends: part that ends at each sample, shape (n_samples,); None where no step is divided.
        widening: factor of the elements' thresholds at the end of each part, shape (n_parts,); None where it is one.
        is_averaged: whether a sample reads the mean over its parts and not their end.
    """

    steps_s: Array
    voltage_v: Array
    ends: NDArray[np.int64] | None
    widening: Array | None = None
    is_averaged: bool = False

    def at_samples(self, values: Array) -> Array:
        """Return values of all parts, along the first axis, as they are read at the samples."""
        if self.ends is None:
            return values
        if not self.is_averaged:
            return values[self.ends]
        return means_of_parts(values, self.ends)


@dataclass(frozen=True, eq=False)
class _Division:
    """How one drive, known by its arrays, was divided.

    Attributes:
        sampled: the drive.
        asked: what the division depends on beside the drive.
        divided: what came of it.
        bend_v: bend left for the next step [V].
    """

    sampled: ElementDrive
    asked: tuple[Substeps, int | bytes, float, float, float]
    divided: ElementDrive
    bend_v: float


class KeptDivisions:
    """The last divisions of a record's drive; what is kept changes no answer, only how soon it comes."""

    def __init__(self) -> None:
        self._kept: tuple[_Division, ...] = ()

    def of(
        self,
        state: ModelState,
        sampled: ElementDrive,
        substeps: Substeps,
        n_least: int | NDArray[np.int64],
        largest_v: float | None = None,
    ) -> ElementDrive:
        """Return the drive on the parts of its steps, see ``divided_drive``; the state moves on as there."""
        largest_v = largest_threshold(state, largest_v)
        least = n_least if isinstance(n_least, int) else n_least.tobytes()
        asked = (substeps, least, largest_v, state.last_input, state.bend)
        for kept in self._kept:
            is_same_drive = kept.sampled.voltage_v is sampled.voltage_v and kept.sampled.steps_s is sampled.steps_s
            if is_same_drive and kept.asked == asked:
                state.last_input, state.bend = float(sampled.voltage_v[-1]), kept.bend_v
                return kept.divided
        divided = divided_drive(state, sampled, substeps, n_least, largest_v)
        if divided.voltage_v.size <= _MOST_PARTS:
            # threads may lose what another has kept, and divide again
            self._kept = (_Division(sampled, asked, divided, state.bend), *self._kept[: _MOST_KEPT - 1])
        return divided


def divided_drive(
    state: ModelState,
    sampled: ElementDrive,
    substeps: Substeps,
    n_least: int | NDArray[np.int64],
    largest_v: float | None = None,
    *,
    is_held: bool = False,
) -> ElementDrive:
    """Return the drive on the parts of its steps; the state's last input and bend move on.

    Args:
        state: of the chain.
        sampled: the drive at its samples.
        substeps: how steps are divided.
        n_least: parts of each step at least, or of each its own, shape (n_samples,).
        largest_v: largest threshold [V], where it is not that of the state's plays.
        is_held: whether the drive jumps from sample to sample, and a sample reads the mean over its parts.
    """
    steps_s, drive_v = sampled.steps_s, sampled.voltage_v
    last_v, state.last_input = state.last_input, float(drive_v[-1])
    ends = None
    before_v = np.concatenate(([last_v], drive_v[:-1]))
    if substeps is not Substeps.NONE:
        if is_held and substeps is Substeps.FIT:
            substeps = Substeps.BENDS  # every step is a jump, spread over one of its parts
        change_v = drive_v - before_v
        parts, state.bend = parts_of_steps(change_v, largest_threshold(state, largest_v), n_least, substeps, state.bend)
        if np.any(parts > 1):
            steps_s, fine_v, ends = subdivide(steps_s, drive_v, last_v, parts)
            drive_v = held_parts(before_v, drive_v, parts) if is_held else fine_v
    if is_held and ends is None:
        drive_v = 0.5 * (before_v + drive_v)
    return ElementDrive(steps_s, drive_v, ends, is_averaged=is_held)


def largest_threshold(state: ModelState, largest_v: float | None) -> float:
    """Return the largest threshold [V]: as given, else that of the state's plays."""
    if largest_v is not None:
        return largest_v
    n_plays = int(state.packed[N_PLAYS])
    return float(state.packed[PLAYS_HEADER + n_plays - 1]) if n_plays else float("inf")
