"""Records of several axes as a diagnosis sees them: what is learnt from, what is held out, and what a model leaves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.errors import RecordingError
from fomrc_core.model.axes import AxesModel
from fomrc_core.records.drive import held_out_blocks, learned_blocks
from fomrc_core.records.noise import known_noise
from fomrc_core.records.recording import Recording

_RUNG_OUT = 1e-3  # of what modes ring at the start of a run-in, what may be left of it: below any sensor's noise
_MOST_PERIODS = 8  # of a run-in: what rings longer is no mode of a structure
_LEAST_SAMPLES = 64


@dataclass(frozen=True, eq=False)
class AxesRecord:
    """One record: the mean period of a periodic one, otherwise the record from rest as it is.

    Attributes:
        name: to tell it by.
        rate_hz: sample rate [Hz].
        voltage_v: drives [V], (n_samples, n_inputs).
        displacement_um: measured [um], (n_samples, n_outputs).
        noise_um: rms of its noise [um], (n_outputs,).
        is_periodic: whether it is the steady state of a drive that repeats itself, not a motion from rest.
        is_learnt: samples to learn from, (n_samples,).
        is_held: samples to judge on.
    """

    name: str
    rate_hz: float
    voltage_v: Array
    displacement_um: Array
    noise_um: Array
    is_periodic: bool
    is_learnt: Mask
    is_held: Mask

    @classmethod
    def of(
        cls, name: str, rate_hz: float, voltage_v: Array, displacement_um: Array, *, role: str = "both"
    ) -> AxesRecord:
        """Return a record of periods.

        Args:
            name: to tell it by.
            rate_hz: sample rate [Hz].
            voltage_v: (n_samples, n_inputs, n_periods) [V]; two periods or more are a steady state.
            displacement_um: (n_samples, n_outputs, n_periods) [um].
            role: "train" to learn from alone, "test" to judge on alone, "both" for blocks of each.

        Raises:
            RecordingError: too short, not finite, or an axis that is dead.
        """
        # Many arguments: what a record is, and what it is for.
        n_samples, _, n_periods = voltage_v.shape
        if n_samples < _LEAST_SAMPLES:
            raise RecordingError("too short", where=name, value=n_samples, allowed=f"{_LEAST_SAMPLES} samples or more")
        for what, array in (("voltage", voltage_v), ("displacement", displacement_um)):
            if not np.all(np.isfinite(array)):
                raise RecordingError(f"{what} is not finite", where=name, value="nan or inf", allowed="numbers")
        spread = displacement_um.std(axis=(0, 2))
        if np.any(spread <= 1e-9 * max(float(spread.max()), 1e-300)):
            axis = int(np.argmin(spread)) + 1
            raise RecordingError("dead axis: its displacement does not change", where=f"{name}, axis {axis}")
        u, y = voltage_v.mean(axis=2), displacement_um.mean(axis=2)
        if n_periods > 1:
            deviation = displacement_um - displacement_um.mean(axis=0) - (y - y.mean(axis=0))[:, :, None]
            noise = np.sqrt((deviation**2).sum(axis=2).mean(axis=0) / (n_periods - 1) / n_periods)
        else:
            time = np.arange(n_samples) / rate_hz
            pairs = [Recording(time, u[:, min(o, u.shape[1] - 1)], y[:, o]) for o in range(y.shape[1])]
            noise = np.array([known_noise([pair]).floor_um for pair in pairs])
        everything, nothing = np.ones(n_samples, dtype=np.bool_), np.zeros(n_samples, dtype=np.bool_)
        learnt = {"train": everything, "test": nothing, "both": learned_blocks(n_samples)}[role]
        held = {"train": nothing, "test": everything, "both": held_out_blocks(n_samples)}[role]
        return cls(name, rate_hz, u, y, np.asarray(noise), n_periods > 1, learnt, held)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.voltage_v.shape[0])

    @property
    def level_v(self) -> float:
        """Root mean square of all voltages [V]."""
        return float(np.sqrt(np.mean(self.voltage_v**2)))

    @cached_property
    def scale_um(self) -> Array:
        """The displacements' rms without their means [um], (n_outputs,): what errors are told in."""
        return np.asarray(self.displacement_um.std(axis=0))

    def predicted_um(self, model: AxesModel) -> Array:
        """Return what a model gives [um], its offset that of the samples learnt from (n_samples, n_outputs)."""
        n_run_in = self._run_in(model) if self.is_periodic else 0
        before = np.tile(self.voltage_v, (1 + n_run_in // self.n_samples, 1))
        drive = np.concatenate([before[before.shape[0] - n_run_in :], self.voltage_v])
        state = model.initial_state(self.level_v if self.is_periodic else None)
        found = model.simulate(np.full(drive.shape[0], 1.0 / self.rate_hz), drive, state)[n_run_in:]
        seen = self.is_learnt if np.any(self.is_learnt) else self.is_held
        return np.asarray(found + (self.displacement_um - found)[seen].mean(axis=0))

    def _run_in(self, model: AxesModel) -> int:
        """Return the samples after which the modes of a model have rung out, at least a period for hysteresis."""
        if model.modes is None:
            return self.n_samples
        slowest_per_s = float(np.min(2.0 * np.pi * model.modes.frequency_hz * model.modes.damping))
        ringing = math.log(1.0 / _RUNG_OUT) / slowest_per_s * self.rate_hz
        return int(np.clip(math.ceil(ringing), self.n_samples, _MOST_PERIODS * self.n_samples))

    def residual_um(self, model: AxesModel) -> Array:
        """Return measured minus predicted [um], (n_samples, n_outputs)."""
        return self.displacement_um - self.predicted_um(model)

    def relative_residual(self, model: AxesModel) -> Array:
        """Return the residual as a share of the displacement's rms [1], (n_samples, n_outputs)."""
        return self.residual_um(model) / self.scale_um


def mean_noise(records: Sequence[AxesRecord]) -> float:
    """Return the noise of records, rms over all of them, as a share of the displacements' rms [1]."""
    return float(np.sqrt(np.mean([(r.noise_um / r.scale_um) ** 2 for r in records])))


def check_fit(records: Sequence[AxesRecord], model: AxesModel) -> None:
    """Refuse records that do not fit the model or one another.

    Raises:
        RecordingError: naming the record, the number of its axes or its rate, and what is allowed.
    """
    if not records:
        raise RecordingError("no records", where="records", value=0, allowed="1 or more")
    for record in records:
        shape = record.voltage_v.shape[1], record.displacement_um.shape[1]
        if shape != (model.n_inputs, model.n_outputs):
            raise RecordingError(
                "axes do not match the model",
                where=record.name,
                value=f"{shape[0]} voltages, {shape[1]} displacements",
                allowed=f"{model.n_inputs} voltages, {model.n_outputs} displacements",
            )
        if abs(record.rate_hz / records[0].rate_hz - 1.0) > 1e-6:
            raise RecordingError(
                f"rate_hz differs from that of {records[0].name}",
                where=record.name,
                value=record.rate_hz,
                allowed=str(records[0].rate_hz),
            )
