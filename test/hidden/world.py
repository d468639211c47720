"""The true actuator: continuous-time physics on a grid finer than the record, effects at their places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from test.hidden.creep import fractional_integral
from test.hidden.dynamics import dead_band, first_order, mass_spring_damper, rate_limited
from test.hidden.hysteresis import EnvelopePlays, MaxwellChain, RelayPlane, WarpedDrive, asymmetric
from test.hidden.noise import Noise

_TAIL_S = 0.1  # physics goes on after the last sample: a skewed clock may ask for it


@dataclass(frozen=True)
class Load:
    """A weight put on, or taken off: displacement by size_um within rise_s."""

    start_s: float
    rise_s: float
    size_um: float

    def displacement_um(self, time_s: np.ndarray) -> np.ndarray:
        """Return what the load adds [um]."""
        along = np.clip((time_s - self.start_s) / self.rise_s, 0.0, 1.0)
        return self.size_um * along**2 * (3.0 - 2.0 * along)


@dataclass(frozen=True)
class Circumstance:
    """What is particular to one record: what went before, what happened, what was recorded beside."""

    before_v: np.ndarray = field(default_factory=lambda: np.zeros(0))  # drive before, at the record's rate
    loads: tuple[Load, ...] = ()
    temperature_c: np.ndarray | None = None  # true temperature at the samples, relative to the record's start
    cross: np.ndarray | None = None  # motion [um] or voltage [V] of the second axis at the samples
    hum_phase: float = 0.0
    offset_um: float = 0.0


@dataclass(frozen=True)
class World:
    """One actuator and its surroundings; ``effects`` maps causes to their parameters."""

    hysteresis: RelayPlane | MaxwellChain
    largest_v: float
    creep_order: float
    effects: Mapping[str, Mapping[str, Any]]
    noise: Noise
    oversampling: int = 20

    def without(self, *causes: str) -> World:
        """Return the same world with some effects gone."""
        return replace(self, effects={c: p for c, p in self.effects.items() if c not in causes})

    def displacement_um(self, command_v: np.ndarray, rate_hz: float, circumstance: Circumstance) -> np.ndarray:
        """Return what a noiseless sensor would have read [um], shape of the command."""
        before = circumstance.before_v
        whole = np.concatenate([before, command_v, np.full(round(_TAIL_S * rate_hz), command_v[-1])])
        if "dac_quantization" in self.effects:
            lsb = self.effects["dac_quantization"]["step_v"]
            whole = lsb * np.floor(whole / lsb + 0.5)
        step_s = 1.0 / (rate_hz * self.oversampling)
        fine = np.interp(
            np.arange((whole.size - 1) * self.oversampling + 1) / self.oversampling,
            np.arange(whole.size),
            whole,
        )
        fine = self._mechanics(self._loops(fine, step_s), step_s)
        sample_s = np.arange(command_v.size) / rate_hz
        if "clock_skew" in self.effects:
            sample_s = sample_s * (1.0 + 1e-6 * self.effects["clock_skew"]["ppm"])
        delay_s = self.effects["transport_delay"]["delay_s"] if "transport_delay" in self.effects else 0.0
        x = np.interp(sample_s - delay_s + before.size / rate_hz, np.arange(fine.size) * step_s, fine)
        return self._surroundings(x, sample_s, circumstance) + circumstance.offset_um

    def measured_um(
        self, command_v: np.ndarray, rate_hz: float, circumstance: Circumstance, rng: np.random.Generator
    ) -> np.ndarray:
        """Return what the sensor reads [um], noise and all."""
        return self.displacement_um(command_v, rate_hz, circumstance) + self.noise.draw(command_v.size, rng)

    def _loops(self, drive_v: np.ndarray, step_s: float) -> np.ndarray:
        effects = self.effects
        at, turns_v = np.zeros(0, dtype=np.int64), np.zeros(0)
        if "amplifier_slew_limit" in effects:
            drive_v, at, turns_v = rate_limited(drive_v, effects["amplifier_slew_limit"]["slew_v_per_s"], step_s)
        if "amplifier_bandwidth" in effects:
            drive_v = first_order(drive_v, 2.0 * np.pi * effects["amplifier_bandwidth"]["cutoff_hz"], step_s)
            at, turns_v = at[:0], turns_v[:0]  # rounded off
        drive_v = np.insert(drive_v, at, turns_v)
        if "amplifier_saturation" in effects:
            rails = effects["amplifier_saturation"]
            drive_v = np.minimum(np.maximum(drive_v, rails["low_v"]), rails["high_v"])
        if "dead_zone" in effects:
            drive_v = dead_band(drive_v, effects["dead_zone"]["half_width_v"])
        loops: RelayPlane | MaxwellChain | EnvelopePlays | WarpedDrive = self.hysteresis
        if "asymmetric_hysteresis" in effects:
            skewed = effects["asymmetric_hysteresis"]
            loops = asymmetric(self.hysteresis, skewed["form"], skewed["amount"], self.largest_v)
        return np.delete(loops.run(drive_v), at + np.arange(at.size))

    def _mechanics(self, response_um: np.ndarray, step_s: float) -> np.ndarray:
        effects = self.effects
        x = fractional_integral(response_um, self.creep_order, step_s)
        if "slow_relaxation" in effects:
            relaxing = effects["slow_relaxation"]
            x = x + relaxing["amplitude"] * first_order(x, 1.0 / relaxing["time_constant_s"], step_s)
        if "mechanical_resonance" in effects:
            stage = effects["mechanical_resonance"]
            x = mass_spring_damper(x, stage["frequency_hz"], stage["damping_ratio"], step_s)
        return x

    def _surroundings(self, x: np.ndarray, sample_s: np.ndarray, circumstance: Circumstance) -> np.ndarray:
        effects = self.effects
        if "external_load" in effects:
            for load in circumstance.loads:
                x = x + load.displacement_um(sample_s)
        if "cross_axis" in effects:
            x = x + effects["cross_axis"]["gain"] * circumstance.cross
        if "gain_drift" in effects:
            x = x * (1.0 + effects["gain_drift"]["per_s"] * sample_s)
        if "thermal_drift" in effects:
            drift = effects["thermal_drift"]
            if "um_per_degc" in drift:
                x = x + drift["um_per_degc"] * circumstance.temperature_c
            elif "rate_um_per_s" in drift:
                x = x + drift["rate_um_per_s"] * sample_s
            else:
                x = x + drift["amplitude_um"] * (1.0 - np.exp(-sample_s / drift["time_constant_s"]))
        if "sensor_nonlinearity" in effects:
            bend = effects["sensor_nonlinearity"]
            x = x + bend["quadratic_per_um"] * x**2 + bend["cubic_per_um2"] * x**3
        if "mains_hum" in effects:
            hum = effects["mains_hum"]
            x = x + hum["amplitude_um"] * np.sin(2.0 * np.pi * hum["frequency_hz"] * sample_s + circumstance.hum_phase)
        return x
