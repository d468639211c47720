"""What a record does not say about its beginning: the actuator's memory, and the offset of its sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Covariates
from fomrc_core.model.excursions_before import Entry, ExcursionsBefore
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import residual_um, rms

# Long enough that a start is told from another, short enough that the rest of the record is a prediction.
_SHARE_OF_RECORD = 0.1
_N_SAMPLES_MIN = 200
_LONG_S = 1000.0  # creep of an order of some hundredths has come to rest by then
# Of the stroke: pasts that differ by less are as good as the same.
_SAME_SHARE = 2e-3
_MORE_THAN_MEMORY = 3.0  # creep of the past is told from an offset over some times as long
_N_MEMORY_MAX = 30_000  # samples: some hundred simulations of them are to take seconds
_LITTLE_MORE = 1.1
_HARDLY_LESS = 0.9  # four numbers fitted to hundreds of samples are not worth less
_PRIOR = np.array([4.0, 1.0, 1.0, 1.0])  # the level is that of such drives, unless much speaks against it
_BEYOND = 0.25  # of the range of the record: how far out of it the past may have gone
_N_FITS = 25
_MOMENT_S = 0.5  # as who moves a stage by hand or by a program waits before a record


@dataclass(frozen=True, eq=False)
class RecordStart:
    """How a record begins.

    Attributes:
        state: state of the model just before the first sample.
        offset_um: measured minus predicted displacement [um] over the samples it was estimated from.
        description: what was assumed or found, in words.
        n_samples: how many samples, from the first on, it was estimated from; 0 where there was nothing to.
    """

    state: ModelState
    offset_um: float
    description: str
    n_samples: int

    def __str__(self) -> str:
        return f"{self.description}; offset {self.offset_um:.6g} um, from the first {self.n_samples} samples"


def relaxed_start(model: PiezoModel, recording: Recording) -> RecordStart:
    """Return the start of a record that is known to begin relaxed, or as the model's initial_state says.

    Only the offset is estimated, where there is a displacement to estimate it from.
    """
    description = "relaxed" if model.start is None else "as the model's initial_state says"
    return _start(model, recording, model.initial_state(), description)[0]


def estimate_start(model: PiezoModel, recording: Recording) -> RecordStart:
    """Return the start that explains the beginning of a record best, as far as the past matters in it.

    Tried are: relaxed; after a long rest at the first voltage; just come, or come long ago, from the highest or the
    lowest voltage of the record; and, where none of these explains the beginning, in mid-motion: a level and three
    extremes fitted together with the offset to the samples that depend on them. Without displacement, or with an
    initial_state in the model, there is nothing to choose: see ``relaxed_start``.

    Args:
        model: the actuator.
        recording: what was applied and, where known, what came of it.
    """
    if recording.displacement_um is None or model.start is not None:
        return relaxed_start(model, recording)
    n_first = _n_first(recording)
    starts = []
    for history, description in _histories(recording):
        state = model.initial_state()
        if history is not None:
            model.settle(state, *history.drive())
        starts.append((_start(model, recording, state, description, n_first), state))
    simple = min((found for found, _ in starts), key=lambda found: found[1])[0]
    n_memory = max(n_first, _n_memory(model, recording, [state for _, state in starts]))
    moving = _in_motion(model, recording, n_memory)
    if moving is None:
        return simple
    # it must win on the samples it was fitted to, or near the start, and lose little near the start
    ratios = []
    for n in (n_first, n_memory):
        errors = [_start(model, recording, s.state, s.description, n)[1] for s in (moving, simple)]
        ratios.append(errors[0] / max(errors[1], 1e-300))
    near, all_of_it = ratios
    return moving if all_of_it < 1.0 and near < _LITTLE_MORE and min(ratios) < _HARDLY_LESS else simple


def simulate_from(
    model: PiezoModel, recording: Recording, start: RecordStart, n_samples: int | None = None
) -> NDArray[np.float64]:
    """Return the displacement [um] the model gives for a record, offset included, shape (n_samples,).

    Args:
        model: the actuator.
        recording: what was applied.
        start: how the record begins; its state is left as it is.
        n_samples: how many samples to simulate; all of them unless told.
    """
    part = slice(n_samples)
    covariates = Covariates.of_recording(recording).part(part)
    moved_um = model.simulate(
        recording.steps_s[part],
        recording.voltage_v[part],
        start.state.copy(),
        temperature_c=covariates.temperature_c,
        cross=covariates.cross,
    )
    return moved_um + start.offset_um


def _histories(recording: Recording) -> Iterator[tuple[Prehistory | None, str]]:
    first_v = float(recording.voltage_v[0])
    yield None, "relaxed"
    if first_v != 0.0:
        yield Prehistory(first_v, first_v, _MOMENT_S, _LONG_S), f"rested at {first_v:g} V"
    for extreme_v in (float(np.max(recording.voltage_v)), float(np.min(recording.voltage_v))):
        if extreme_v == first_v:
            continue
        way = f"from {extreme_v:g} V to {first_v:g} V"
        yield Prehistory(extreme_v, first_v, _MOMENT_S, _MOMENT_S), f"come just {way}"
        # On the way from zero to the first voltage nothing turns: long after it is as after a plain rest.
        if not min(0.0, first_v) <= extreme_v <= max(0.0, first_v):
            yield Prehistory(extreme_v, first_v, _MOMENT_S, _LONG_S), f"come long ago {way}"


def _n_first(recording: Recording) -> int:
    return min(recording.n_samples, max(_N_SAMPLES_MIN, int(_SHARE_OF_RECORD * recording.n_samples)))


def _n_memory(model: PiezoModel, recording: Recording, states: list[ModelState]) -> int:
    """Return the number of samples after which very different pasts leave the same displacement but for an offset."""
    n = min(recording.n_samples, _N_MEMORY_MAX)
    moved = [simulate_from(model, recording, RecordStart(state, 0.0, "", 0), n) for state in states]
    spread = np.ptp([m - np.mean(m[n // 2 :]) for m in moved], axis=0)
    differs = np.flatnonzero(spread > _SAME_SHARE * float(np.ptp(moved[0])))
    return min(int(_MORE_THAN_MEMORY * (differs[-1] + 1)), n) if differs.size else 0


def _in_motion(model: PiezoModel, recording: Recording, n_samples: int) -> RecordStart | None:
    """Return the start from the excursions that explain so many samples best; None where the drive does not move.

    The starts of the fit are the drive's own extremes, and a quarter of the way in from them.
    """
    from scipy.optimize import least_squares  # a model alone does not wait for it

    part = slice(n_samples)
    voltage_v, measured_um = recording.voltage_v, recording.measured_um
    valid = recording.valid_samples[part]
    low, high = float(np.min(voltage_v)), float(np.max(voltage_v))
    span, entry = high - low, Entry.of(recording.steps_s, voltage_v)
    if not span > 0.0 or n_samples < _N_SAMPLES_MIN:
        return None

    def started(x: NDArray[np.float64]) -> ModelState:
        state = model.initial_state()
        model.settle(state, *ExcursionsBefore(*(low + span * x)).drive(entry))
        return state

    def left_um(x: NDArray[np.float64]) -> NDArray[np.float64]:
        start = RecordStart(started(x), 0.0, "", 0)
        left = (measured_um[part] - simulate_from(model, recording, start, n_samples))[valid]
        return np.asarray(left - np.mean(left))

    up, down = (1.0, 0.0) if entry.rate < 0.0 else (0.0, 1.0)
    best: tuple[float, NDArray[np.float64]] | None = None
    for inner in (0.0, 0.25):
        first = np.array([0.5, up, down, up])
        first[1:] += inner * (0.5 - first[1:])
        # what the samples leave open stays where such drives are: a fifth of a typical residual for each range
        weight = 0.2 * rms(left_um(first)) * np.sqrt(n_samples)

        def objective(
            x: NDArray[np.float64], first: NDArray[np.float64] = first, weight: float = weight
        ) -> NDArray[np.float64]:
            return np.concatenate((left_um(x), weight * _PRIOR * (x - first)))

        found = least_squares(objective, first, bounds=(-_BEYOND, 1.0 + _BEYOND), diff_step=1e-2, max_nfev=_N_FITS)
        if best is None or found.cost < best[0]:
            best = float(found.cost), np.asarray(found.x)
    assert best is not None
    past = ExcursionsBefore(*(low + span * best[1]))
    return _start(model, recording, started(best[1]), str(past), n_samples)[0]


def _start(
    model: PiezoModel, recording: Recording, state: ModelState, description: str, n_first: int | None = None
) -> tuple[RecordStart, float]:
    """Return the start with its offset, and the error [um] that is left over the first samples."""
    start = RecordStart(state, 0.0, description, 0)
    if recording.displacement_um is None:
        return start, 0.0
    n_first = _n_first(recording) if n_first is None else n_first
    left_um = residual_um(recording.displacement_um[:n_first], simulate_from(model, recording, start, n_first))
    valid = recording.valid_samples[:n_first]
    if not np.any(valid):
        valid[:] = True
    offset_um = float(np.mean(left_um[valid]))
    return RecordStart(state, offset_um, description, n_first), rms(left_um[valid] - offset_um)
