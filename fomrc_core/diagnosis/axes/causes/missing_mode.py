"""A mode the model has not: something that hangs on the stage, or an order that was chosen too low."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.model.axes import AxesModel, AxesModes

_N_STARTS = 2  # strongest peaks of what is left at which a fit begins
_APART = 0.05  # relative distance of two peaks
_FIRST_DAMPING = 0.01
_DAMPINGS = (-3.0, 3.0)  # logarithm over the first, beyond which nothing is a structure's mode: 0.05 % to 20 %
_FIRST_SHARE = 0.01  # of a mode's displacement for a drive, over the largest static gain
_FREQUENCY_UNIT = 0.01


@dataclass(frozen=True, eq=False)
class MissingMode(AxesCause):
    """One more mode: its frequency, damping and shapes; and the frequencies of the others, which it pushes aside.

    Values: of the frequency and of the damping their logarithms' changes from the start, then the shape of the
    outputs and that of the inputs in the unit of the start, then the other modes' changes of frequency.

    Attributes:
        start_hz: frequency a fit begins at [Hz].
        axis: input whose entry of the shape is one.
        n_outputs: of the model.
    """

    name: ClassVar[str] = "missing_mode"
    meaning: ClassVar[str] = "The structure has a mode that the model has not."
    signature: ClassVar[str] = "the residual is a resonance where the model has none"
    experiment: ClassVar[str] = "a multisine whose lines are dense around it"

    start_hz: float = 1.0
    axis: int = 0
    n_outputs: int = 1

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return the strongest peaks of what is left, relative to what the drive puts in, for each input."""
        model, found = evidence.model, list[AxesCause]()
        n_modes = 0 if model.modes is None else model.modes.n_modes
        size = 2 + model.n_outputs + model.n_inputs - 1 + n_modes
        for hz in _peaks(evidence):
            for axis in range(model.n_inputs):
                values = np.zeros(size)
                values[2 : 2 + model.n_outputs] = _FIRST_SHARE
                found.append(cls(values, hz, axis, model.n_outputs))
        return found

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the mode."""
        n_out, n_in = model.n_outputs, model.n_inputs
        hz = self.start_hz * np.exp(_FREQUENCY_UNIT * self.values[0])
        damping = _FIRST_DAMPING * np.exp(np.clip(self.values[1], *_DAMPINGS))
        unit = float(np.max(np.abs(model.static_gain())))
        output = self.values[2 : 2 + n_out] * unit
        inputs = np.insert(self.values[2 + n_out : 1 + n_out + n_in], self.axis, 1.0)
        if model.modes is None:
            modes = AxesModes(np.array([hz]), np.array([damping]), _complex(output), _complex(inputs))
            return replace(model, modes=modes, coupling=model.static)
        old = model.modes
        others = old.frequency_hz * np.exp(_FREQUENCY_UNIT * self.values[1 + n_out + n_in :])
        modes = AxesModes(
            np.append(others, hz),
            np.append(old.damping, damping),
            np.vstack([old.output_shape, output]),
            np.vstack([old.input_shape, inputs]),
            *(np.append(change, 0.0) for change in old.changes),
        )
        joints = None if model.joints is None else np.pad(model.joints, ((0, 0), (0, 1)))
        return replace(model, modes=modes, coupling=model.static, joints=joints)

    @property
    def longest_step(self) -> Array:
        """A mode's width in frequency, and a factor of two in damping: further the response is another."""
        most = np.full(self.values.size, np.inf)
        most[:2] = 1.0, np.log(2.0)
        return most

    def is_plausible(self) -> bool:
        """Return whether its damping is that of a structure."""
        return bool(_DAMPINGS[0] < self.values[1] < _DAMPINGS[1])

    def companions(self) -> AxesCause | None:
        """Return what it does to the other modes."""
        values = self.values.copy()
        values[2 : 2 + self.n_outputs] = 0.0
        return replace(self, values=values)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return frequency [Hz] and damping [1]."""
        modes = self.applied(model).modes
        assert modes is not None
        return {"frequency_hz": float(modes.frequency_hz[-1]), "damping": float(modes.damping[-1])}


def _complex(shape: Array) -> ComplexArray:
    return np.asarray(shape[None], dtype=np.complex128)


def _peaks(evidence: AxesEvidence) -> list[float]:
    """Return frequencies [Hz] of the strongest peaks of what is left over what was driven."""
    records = evidence.records
    n = min(record.n_samples for record in records)
    left, drive = np.zeros(n // 2 + 1), np.zeros(n // 2 + 1)
    for record, residual in zip(records, evidence.residuals_um, strict=True):
        left += _power(residual[:n] / record.scale_um)
        drive += _power(record.voltage_v[:n]) / record.level_v**2
    driven = drive > 1e-6 * drive.max()
    driven[0] = False
    ratio = np.where(driven, left / np.where(driven, drive, 1.0), 0.0)
    frequency = np.fft.rfftfreq(n, 1.0 / records[0].rate_hz)
    found: list[float] = []
    for line in np.argsort(ratio)[::-1]:
        hz = float(frequency[line])
        if hz > 0.0 and all(abs(hz / other - 1.0) > _APART for other in found):
            found.append(hz)
        if len(found) == _N_STARTS:
            break
    return found


def _power(series: Array) -> Array:
    return np.asarray((np.abs(np.fft.rfft(series - series.mean(axis=0), axis=0)) ** 2).sum(axis=1))
