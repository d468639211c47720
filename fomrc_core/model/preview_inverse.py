"""The inverse of a live target that is followed some time late, so that so much of its future is known.

    target --[undo the mechanics]--> x --[undo creep and hysteresis]--> u --[undo the amplifier]--> voltage

Hysteresis and creep are stepped exactly as the ``Compensator`` does. The linear dynamics are undone by filters that see
ahead (preview_filter.py): those of the mechanics on the target, those of the amplifier on the hysteresis voltage, for
which creep and hysteresis are stepped ahead at each tick, on a copy. So the memory itself stands where the actuator is,
and whatever keeps the voltage from its plan is seen at the next tick: nothing of an old plan is driven.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled_sums
from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.course import Course
from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.hysteresis_bends import N_BENDS, N_BENDS_BEHIND, bent_run, bent_step
from fomrc_core.model.kernels import inverse_step
from fomrc_core.model.loop_filters import loop_filters
from fomrc_core.model.near_sample_rate import ringing_notes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_filter import PreviewFilter
from fomrc_core.model.preview_window import PreviewWindow
from fomrc_core.model.state import ModelState
from fomrc_core.operators.creep import PREVIOUS
from fomrc_core.operators.hysteresis import peek_stops

_LEAST_DRIVEN = 32  # voltages remembered where the amplifier needs fewer
_N_BLANK = 16
LONGEST_PREVIEW_S = 1.0
MOST_PREVIEW = 1000  # samples
_DRIVE = (Stage.SAMPLED_DRIVE, Stage.DRIVE)


@compiled_sums
def _planned_voltage(
    packed: Array,
    at_creep: int,
    work: Array,
    targets: Array,
    first: int,
    taps: Array,
    drive_taps: Array,
    inner: Array,
    bend_taps: Array,
    bends: Array,
    planned_bends: Array,
    correction: float,
    step_s: float,
    out: Array,
) -> None:
    # Fill ``out`` with voltage, displacement and hysteresis voltage of the step; work takes the steps ahead. Bends
    # within the step are left in ``planned_bends``; without taps for them nobody looks.
    work[:] = packed
    n_behind = inner.size
    voltage = 0.0
    for i in range(n_behind):
        voltage += drive_taps[i] * inner[i]
    is_bent, n_past = bend_taps.shape[0] > 0, bends.shape[1]
    own = out[3:]
    before = peek_stops(work, 0, work[at_creep + PREVIOUS])
    for i in range(bend_taps.shape[0]):
        for k in range(n_past):
            voltage += bend_taps[i, k] * bends[i, k]
    for j in range(drive_taps.size - n_behind):
        moved = correction
        for i in range(taps.size):
            moved += taps[i] * targets[first + j + i]
        if is_bent:
            wanted = before = bent_step(work, at_creep, moved, step_s, before, own)
            for i in range(bend_taps.shape[0]):
                voltage += bend_taps[i, n_past + j] * own[i]
                if j == 0:
                    planned_bends[i] = own[i]
        else:
            wanted = inverse_step(work, at_creep, moved, step_s)
        voltage += drive_taps[n_behind + j] * wanted
        if j == 0:
            out[1], out[2] = moved, wanted
    out[0] = voltage


# Of what the rate lets be undone: from here on a preview counts as long enough.
_ENOUGH = 0.9


class Planned(NamedTuple):
    """A step: voltage [V], displacement before the mechanics [um], voltage of the hysteresis [V]."""

    voltage_v: float
    moved_um: float
    inner_v: float


@dataclass(frozen=True, eq=False)
class PreviewInverse:
    """Feedforward for a live target, its dynamics undone with a preview.

    Attributes:
        core: the compensator of what is left: hysteresis, creep, and effects that need no future.
        step_s: period of the loop [s].
        n_preview: periods by which the target is followed late.
        mechanics: linear effects undone on the target.
        amplifier: linear effects undone on the voltage.
        target_filter: undoes the mechanics.
        drive_filter: undoes the amplifier.
        bend_taps: give the stage what hysteresis bends within samples, where it rings; else of no row.
    """

    core: Compensator
    step_s: float
    n_preview: int
    mechanics: tuple[Effect, ...]
    amplifier: tuple[Effect, ...]
    target_filter: PreviewFilter
    drive_filter: PreviewFilter
    bend_taps: Array
    _work: Array = field(init=False, repr=False)
    _out: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_work", np.zeros(self.core.initial_state().packed.size))
        object.__setattr__(self, "_out", np.zeros(3 + N_BENDS))

    @classmethod
    def of(cls, model: PiezoModel, step_s: float, preview_s: float) -> PreviewInverse:
        """Return the inverse of a model for a loop of this period.

        Args:
            model: the actuator.
            step_s: period [s].
            preview_s: how late the target is followed [s]; rounded to whole periods, one at least.

        Raises:
            ParameterError: a preview that is not positive, or is longer than is kept of targets.
        """
        longest_s = min(LONGEST_PREVIEW_S, MOST_PREVIEW * step_s)
        if not 0.0 < preview_s <= longest_s:
            allowed = f"above 0, at most {longest_s:g} s: so much of the targets is kept"
            raise ParameterError("out of range", where="preview_s", value=preview_s, allowed=allowed)
        n_preview = max(round(preview_s / step_s), 1)
        course, model = Course(_N_BLANK, step_s), model.sampled_every(step_s)
        undone = [effect for effect in model.effects if _needs_preview(effect, course)]
        mechanics = tuple(effect for effect in undone if effect.stage not in _DRIVE)
        amplifier = tuple(effect for effect in undone if effect.stage in _DRIVE)
        left = tuple(effect for effect in model.effects if effect not in undone)
        filters = loop_filters(mechanics, amplifier, step_s, n_preview)
        return cls(Compensator(replace(model, effects=left)), step_s, n_preview, mechanics, amplifier, *filters)

    def __str__(self) -> str:
        undone = ", ".join(effect.name for effect in (*self.amplifier, *self.mechanics)) or "nothing"
        return f"inverse with {1e3 * self.n_preview * self.step_s:g} ms of preview, undoing {undone}"

    @property
    def holds_to_hz(self) -> float:
        """Up to here gain and phase of what is undone are right to a per cent [Hz]; inf where nothing is."""
        return min(self.target_filter.holds_to_hz, self.drive_filter.holds_to_hz)

    @property
    def note(self) -> str:
        """What the user should know of preview and rate, in a line; "" where both are enough."""
        return "; ".join(filter(None, (self._short_note, *self._ringing_notes)))

    @functools.cached_property
    def _ringing_notes(self) -> list[str]:
        return ringing_notes((*self.amplifier, *self.mechanics), self.step_s, "rate_hz of")

    @functools.cached_property
    def _short_note(self) -> str:
        reaches_hz = min(self.target_filter.reaches_hz, self.drive_filter.reaches_hz)
        if self.holds_to_hz >= _ENOUGH * reaches_hz or not math.isfinite(reaches_hz):
            return ""
        return (
            f"preview_s of {self.n_preview * self.step_s:g} s is too short for the model: dynamics are undone to 1 % "
            f"up to {self.holds_to_hz:.3g} Hz, {self._needed_s():.2g} s would reach {reaches_hz:.3g} Hz"
        )

    def _needed_s(self) -> float:
        n_preview = max(self.n_preview, 1)
        while n_preview < MOST_PREVIEW:
            n_preview *= 2
            filters = loop_filters(self.mechanics, self.amplifier, self.step_s, n_preview)
            if all(one.holds_to_hz >= _ENOUGH * one.reaches_hz for one in (filters.target, filters.drive)):
                break
        return n_preview * self.step_s

    def warm_up(self) -> None:
        """Step a throw-away state, so that nothing is compiled in the loop."""
        window = self.window()
        window.take(0.0)
        window.note(0.0, self.inner_after(window, 0.0))
        self.plan(self.core.initial_state(), window)

    def window(self) -> PreviewWindow:
        """Return an empty window."""
        n_driven = max(self.drive_filter.n_behind, _LEAST_DRIVEN)
        n_targets = self.target_filter.n_behind + 1 + self.n_preview
        bends_v = np.zeros((self.bend_taps.shape[0], N_BENDS_BEHIND))
        return PreviewWindow(self.n_preview, np.zeros(n_targets), np.zeros(n_driven), np.zeros(n_driven), bends_v)

    def plan(
        self, state: ModelState, window: PreviewWindow, correction_um: float = 0.0, cross: float = np.nan
    ) -> Planned:
        """Return the next step; the state stays as it is.

        Args:
            state: of the core.
            window: what was wanted and driven until now, and what is wanted ahead; takes the bends that are planned.
            correction_um: added to where the stage is to go [um].
            cross: second axis, for effects that use it.
        """
        first = window.present - self.target_filter.n_behind
        n_behind = self.drive_filter.n_behind
        inner = window.inner_v[window.inner_v.size - n_behind :]
        if self.core.model.effects:
            return self._planned_beside(state, window, inner, correction_um, cross)
        out = self._out
        _planned_voltage(
            state.packed,
            self.core.at_creep,
            self._work,
            window.targets_um,
            first,
            self.target_filter.taps,
            self.drive_filter.taps,
            inner,
            self.bend_taps,
            window.bends_v,
            window.planned_bends_v,
            correction_um,
            self.step_s,
            out,
        )
        return Planned(float(out[0]), float(out[1]), float(out[2]))

    def _planned_beside(
        self, state: ModelState, window: PreviewWindow, inner: Array, correction_um: float, cross: float
    ) -> Planned:
        n_steps = self.drive_filter.n_ahead + 1
        first, n_taps = window.present - self.target_filter.n_behind, self.target_filter.taps.size
        moved = correction_um + np.array(
            [self.target_filter.taps @ window.targets_um[first + j : first + j + n_taps] for j in range(n_steps)]
        )
        beside = None if np.isnan(cross) else np.full(n_steps, cross)
        wanted = self.core.run(np.full(n_steps, self.step_s), moved, state.copy(), cross=beside)
        voltage = self.drive_filter.taps @ np.concatenate((inner, wanted))
        return Planned(float(voltage), float(moved[0]), float(wanted[0]))

    def driven_ahead(self, window: PreviewWindow, n_steps: int) -> Array:
        """Return displacements before the mechanics in steps to come [um], (n_steps,), the newest target held.

        Args:
            window: of the last step.
            n_steps: how many.
        """
        targets_um = np.append(window.targets_um, np.full(n_steps, window.targets_um[-1]))
        first, taps = window.present - self.target_filter.n_behind + 1, self.target_filter.taps
        return np.asarray(np.correlate(targets_um[first : first + n_steps + taps.size - 1], taps, "valid"))

    def voltages_ahead(
        self, state: ModelState, window: PreviewWindow, n_steps: int, correction_um: float = 0.0, cross: float = np.nan
    ) -> Array:
        """Return the voltages of steps to come [V], (n_steps,), the newest target held and nothing limited.

        Args:
            state: of the core; stays as it is.
            window: of the last step.
            n_steps: how many.
            correction_um: added to where the stage is to go [um].
            cross: second axis, for effects that use it.
        """
        n_seen = n_steps + self.drive_filter.n_ahead
        moved_um = self.driven_ahead(window, n_seen) + correction_um
        behind_v = window.inner_v[window.inner_v.size - self.drive_filter.n_behind :]
        if self.core.model.effects:
            beside = None if np.isnan(cross) else np.full(n_seen, cross)
            wanted_v, bends_v = self.core.run(np.full(n_seen, self.step_s), moved_um, state.copy(), cross=beside), None
        else:
            wanted_v, bends_v = np.empty(n_seen), np.empty((n_seen, N_BENDS))
            bent_run(state.packed.copy(), self.core.at_creep, moved_um, self.step_s, wanted_v, bends_v)
        voltages_v = np.correlate(np.concatenate((behind_v, wanted_v)), self.drive_filter.taps, "valid")
        if bends_v is not None:
            for past_v, own_v, taps in zip(window.bends_v, bends_v.T, self.bend_taps, strict=False):
                voltages_v += np.correlate(np.concatenate((past_v, own_v)), taps, "valid")
        return np.asarray(voltages_v)

    def inner_after(self, window: PreviewWindow, voltage_v: float) -> float:
        """Return what the amplifier makes of a voltage [V] after those of the window [V]."""
        if not self.amplifier:
            return voltage_v
        rest_v = float(window.voltages_v[0])
        values = np.append(window.voltages_v, voltage_v) - rest_v
        steps_s = np.full(values.size, self.step_s)
        for effect in self.amplifier:
            values = effect.run(effect.initial_state(), values, steps_s)
        return rest_v + float(values[-1])

    def peek(self, state: ModelState, position_um: float) -> float:
        """Return the voltage of the hysteresis [V] where the stage stays at a position [um]; the state stays."""
        return self.core.advance(state.copy(), position_um, self.step_s)


def _needs_preview(effect: Effect, course: Course) -> bool:
    if effect.is_null() or effect.response(np.zeros(1)) is None:
        return False
    if effect.can_invert and effect.stage not in _DRIVE:
        return False  # slow, and undone exactly by the core
    return effect.undo_known(np.zeros(course.n_samples), course) is not None
