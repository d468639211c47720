"""What a record does not say about its beginning: the actuator's memory, and the offset of its sensor."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Covariates
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import residual_um, rms

# Long enough that a start is told from another, short enough that the rest of the record is a prediction.
_SHARE_OF_RECORD = 0.1
_N_SAMPLES_MIN = 200
_LONG_S = 1000.0  # creep of an order of some hundredths has come to rest by then
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
    """Return the start that explains the first samples of a record best.

    Tried are: relaxed; after a long rest at the first voltage; just come, or come long ago, from the highest
    or the lowest voltage of the record. Without displacement, or with an initial_state in the model, there is
    nothing to choose: see ``relaxed_start``.

    Args:
        model: the actuator.
        recording: what was applied and, where known, what came of it.
    """
    if recording.displacement_um is None or model.start is not None:
        return relaxed_start(model, recording)
    starts = []
    for history, description in _histories(recording):
        state = model.initial_state()
        if history is not None:
            model.settle(state, *history.drive())
        starts.append(_start(model, recording, state, description))
    return min(starts, key=lambda start: start[1])[0]


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


def _start(model: PiezoModel, recording: Recording, state: ModelState, description: str) -> tuple[RecordStart, float]:
    """Return the start with its offset, and the error [um] that is left over the first samples."""
    start = RecordStart(state, 0.0, description, 0)
    if recording.displacement_um is None:
        return start, 0.0
    n_first = min(recording.n_samples, max(_N_SAMPLES_MIN, int(_SHARE_OF_RECORD * recording.n_samples)))
    left_um = residual_um(recording.displacement_um[:n_first], simulate_from(model, recording, start, n_first))
    offset_um = float(np.mean(left_um))
    return RecordStart(state, offset_um, description, n_first), rms(left_um - offset_um)
