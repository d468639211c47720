"""The paper's experimental setup, section 4.1, with the electromechanical plant in place of the stage.

16-bit D/A, amplifier (first order), stage, capacitive sensor with noise, 18-bit A/D. Nothing of the model
that is identified is used: the plant has denser hysteresis, creep orders that differ from element to
element, and mechanics, and all is integrated in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.plants.electromechanical import ElectromechanicalPlant, ElectromechanicalState, table1_plant
from fomrc_core.records.excitation import Excitation
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

_N_FINE = 10  # parts of a sample step while the drive moves fast
_SETTLING_S = 0.03
_FAST_V = 0.004  # change of the drive in one sample from which it counts as fast [V]


def _stage() -> ElectromechanicalPlant:
    # Resonance of the loaded stage, well damped; the plant's own substep is as long as the rig lets it be.
    return table1_plant(40, order_spread=0.05, resonance_hz=2000.0, damping_ratio=0.3, substep_s=1.0)


@dataclass
class RigState:
    """What the rig remembers between samples; changed by whoever steps it.

    Attributes:
        plant: of the stage.
        commanded_v: voltage behind the converter [V].
        amplified_v: voltage behind the amplifier [V].
    """

    plant: ElectromechanicalState
    commanded_v: float = 0.0
    amplified_v: float = 0.0


@dataclass(frozen=True)
class SimulatedRig:
    """A stage with its amplifier, sensor and converters.

    Attributes:
        plant: the stage.
        amplifier_cutoff_hz: -3 dB frequency of the amplifier [Hz]. With the mechanics it makes up the lag
            of about 0.7 ms that the paper's Table 3 implies (docs/table3_lag.md).
        dac_step_v: 16 bits over -10..10 V [V].
        adc_step_um: 18 bits over a sensor range of -12..12 um [um].
        noise_um: standard deviation of the sensor noise [um].
    """

    plant: ElectromechanicalPlant = field(default_factory=_stage)
    amplifier_cutoff_hz: float = 250.0
    dac_step_v: float = 20.0 / 2**16
    adc_step_um: float = 24.0 / 2**18
    noise_um: float = 1e-3

    def measure(self, drive: Excitation, seed: int = 0, desired_um: Array | None = None) -> Recording:
        """Return what is recorded when the relaxed stage is driven.

        Args:
            drive: voltage commanded [V]; the converter's steps are on the way to the stage, not in the
                record.
            seed: of the sensor noise.
            desired_um: kept in the record where given [um].
        """
        steps = np.diff(drive.time_s, prepend=2.0 * drive.time_s[0] - drive.time_s[1])
        displacement = self.displacement_um(steps, np.asarray(drive.voltage_v))
        noise = np.random.default_rng(seed).normal(0.0, self.noise_um, displacement.size)
        measured = self.adc_step_um * np.round((displacement + noise) / self.adc_step_um)
        return Recording(drive.time_s, drive.voltage_v, measured, desired_um, name=drive.name)

    def initial_state(self) -> RigState:
        """Return the relaxed state."""
        return RigState(self.plant.initial_state())

    def advance(self, state: RigState, voltage_v: float, step_s: float) -> float:
        """Return the true displacement [um] after one step of ``step_s`` [s] that ends at ``voltage_v`` [V].

        Args:
            state: changed in place.
            voltage_v: voltage commanded [V]; linear on the way there, behind the converter.
            step_s: length of the step [s].
        """
        commanded_v = self.dac_step_v * round(voltage_v / self.dac_step_v)
        steps_s = np.full(_N_FINE, step_s / _N_FINE)
        drive = state.commanded_v + (commanded_v - state.commanded_v) * np.arange(1.0, _N_FINE + 1.0) / _N_FINE
        lag_s = 1.0 / (2.0 * math.pi * self.amplifier_cutoff_hz)
        amplified = first_order(steps_s, drive, lag_s, (state.amplified_v, state.commanded_v))
        state.commanded_v, state.amplified_v = commanded_v, float(amplified[-1])
        return float(self.plant.simulate(steps_s, amplified, state.plant)[-1])

    def displacement_um(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the true displacement [um] from the relaxed state, shape (n_samples,)."""
        commanded = self.dac_step_v * np.round(voltage_v / self.dac_step_v)
        n_parts = _parts(steps_s, commanded)
        last = np.cumsum(n_parts) - 1
        fine_steps = np.repeat(steps_s / n_parts, n_parts)
        ends = np.concatenate([[0.0], np.cumsum(steps_s)])
        drive = np.interp(np.cumsum(fine_steps), ends, np.concatenate([[0.0], commanded]))
        amplified = first_order(fine_steps, drive, 1.0 / (2.0 * math.pi * self.amplifier_cutoff_hz))
        return self.plant.simulate(fine_steps, amplified)[last]


def _parts(steps_s: Array, voltage_v: Array) -> NDArray[np.int64]:
    """Return into how many parts each step is cut: more where the drive has just moved fast."""
    is_fast = np.abs(np.diff(voltage_v, prepend=0.0)) > _FAST_V
    since_s = np.full(steps_s.size, math.inf)
    elapsed = math.inf
    for k in range(steps_s.size):
        elapsed = 0.0 if is_fast[k] else elapsed + steps_s[k]
        since_s[k] = elapsed
    # Steps longer than 1 ms are cut in proportion.
    fine = np.maximum(_N_FINE, np.ceil(_N_FINE * steps_s / 1e-3))
    return np.where(since_s <= _SETTLING_S, fine, 1.0).astype(np.int64)


def first_order(
    steps_s: Array, values: Array, time_constant_s: float, start: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return the first-order lag of values linear between samples, shape (n_samples,).

    Args:
        steps_s: steps [s], shape (n_samples,).
        values: what is lagged, shape (n_samples,).
        time_constant_s: of the lag [s].
        start: output and input at first.
    """
    out = np.empty(values.size)
    state, before = start
    for k in range(values.size):
        a = steps_s[k] / time_constant_s
        keep = math.exp(-a)
        mean = (1.0 - keep) / a
        state = keep * state + (mean - keep) * before + (1.0 - mean) * values[k]
        before = values[k]
        out[k] = state
    return out
