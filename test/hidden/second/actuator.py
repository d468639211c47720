"""The true actuator: from the voltage that is commanded to what a sensor without noise would read.

    command -> converter -> lead -> amplifier -> hysteresis -> creep -> mechanics -> clocks -> surroundings -> sensor

Physics goes in steps finer than the samples. Effects are keyed by the cause's name; their parameters are floats,
tuples of floats or words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from test.hidden.second import linear_dynamics, stateful_dynamics
from test.hidden.second.creep import CreepLaw, Logarithmic, Relaxations, creep
from test.hidden.second.plays import GeneralisedPlays, PlayStack, RateDependentPlays

Effects = Mapping[str, Mapping[str, Any]]


class Loops(Protocol):
    """Rate-independent hysteresis."""

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0."""

    def switching(self, reach_v: float) -> Loops:
        """Return the part of it that creeps more."""


@dataclass(frozen=True)
class Load:
    """A weight put on (or, of negative size, taken off)."""

    start_s: float
    rise_s: float
    size_um: float


@dataclass(frozen=True)
class Circumstance:
    """What is particular to one record.

    Args:
        before_v: drive before the record, at the record's rate.
        loads: weights put on.
        temperature_c: of the room at the samples, less that at the start; None where there is no such effect.
        cross: motion [um] or voltage [V] of the second axis at the samples.
        hum_phases: phases of the tone and its harmonics [rad].
        open_s: begin and end of each time the lead has no contact.
        offset_um: zero of the sensor.
    """

    before_v: np.ndarray = field(default_factory=lambda: np.zeros(0))
    loads: tuple[Load, ...] = ()
    temperature_c: np.ndarray | None = None
    cross: np.ndarray | None = None
    hum_phases: tuple[float, ...] = (0.0, 0.0, 0.0)
    open_s: tuple[tuple[float, float], ...] = ()
    offset_um: float = 0.0


@dataclass(frozen=True)
class Actuator:
    """One actuator and its bench; ``effects`` maps causes to their parameters."""

    loops: Loops
    creep_law: CreepLaw
    reach_v: float
    effects: Effects
    oversampling: int

    def having(self, effects: Effects) -> Actuator:
        """Return the same actuator with other effects."""
        return replace(self, effects=effects)

    def true_um(self, command_v: np.ndarray, step_s: float, circumstance: Circumstance) -> np.ndarray:
        """Return what a sensor without noise would read [um], shape of the command.

        Args:
            command_v: drive at the samples [V], from 0.
            step_s: time between samples [s].
            circumstance: what else happened.
        """
        n_before, m = circumstance.before_v.size, self.oversampling
        n_tail = 2 + self._latest_s(step_s * command_v.size) / step_s
        whole = np.concatenate([circumstance.before_v, command_v, np.full(int(np.ceil(n_tail)), command_v[-1])])
        fine_s = step_s / m
        drive_v = self._drive(whole, fine_s, circumstance, n_before * step_s)
        fine = self._mechanics(self._creeping(drive_v, fine_s), fine_s)
        if "sensor_bandwidth" in self.effects:
            sensor = self.effects["sensor_bandwidth"]
            fine = linear_dynamics.low_pass(fine, sensor["cutoff_hz"], sensor["order"], fine_s)
        sample_s = np.arange(command_v.size) * step_s
        read_s = sample_s.copy()
        if "clock_skew" in self.effects:
            read_s *= 1.0 + 1e-6 * self.effects["clock_skew"]["ppm"]
        if "transport_delay" in self.effects:
            read_s -= self.effects["transport_delay"]["delay_s"]
        x = np.interp((read_s + n_before * step_s) / fine_s, np.arange(fine.size), fine)
        if "zero_order_hold" in self.effects:
            # An integrating converter sees the mean over the sample: half of it is of the level before.
            total = np.concatenate([[0.0], np.cumsum(0.5 * (fine[1:] + fine[:-1]))])
            middles = (read_s[:, None] + n_before * step_s) / fine_s
            ends = np.interp(middles + 0.5 * m * np.array([-1, 1]), np.arange(total.size), total)
            x = (ends[:, 1] - ends[:, 0]) / m
        return self._surroundings(x, sample_s, circumstance) + circumstance.offset_um

    def _latest_s(self, duration_s: float) -> float:
        """Return how long after the last sample the physics is asked for [s]."""
        skew = self.effects.get("clock_skew", {"ppm": 0.0})["ppm"]
        return max(0.0, 1e-6 * float(skew)) * duration_s

    def _drive(self, command_v: np.ndarray, fine_s: float, circumstance: Circumstance, start_s: float) -> np.ndarray:
        effects, m = self.effects, self.oversampling
        if "dac_quantization" in effects:
            lsb = effects["dac_quantization"]["step_v"]
            command_v = lsb * np.round(command_v / lsb)
        at = np.arange((command_v.size - 1) * m + 1) / m
        if "zero_order_hold" in effects:
            # Straight between the nodes as all else: the jump is half done at its own node, or it would come half a
            # fine step early.
            before, after = np.ceil(at).astype(np.int64) - 1, np.floor(at).astype(np.int64)
            fine = 0.5 * (command_v[np.maximum(before, 0)] + command_v[after])
        else:
            fine = np.interp(at, np.arange(command_v.size), command_v)
        for begin_s, end_s in circumstance.open_s if "intermittent_contact" in effects else ():
            # The charge stays where it is while the lead is open.
            first, last = (np.array([begin_s, end_s]) + start_s) / fine_s
            fine[int(first) + 1 : int(last) + 1] = fine[int(first)]
        if "amplifier_slew_limit" in effects:
            fine = stateful_dynamics.rate_limited(fine, effects["amplifier_slew_limit"]["slew_v_per_s"], fine_s)
        if "amplifier_bandwidth" in effects:
            tau_s = 1.0 / (2.0 * np.pi * effects["amplifier_bandwidth"]["cutoff_hz"])
            fine = linear_dynamics.first_order_lag(fine, tau_s, fine_s)
        if "voltage_dependent_capacitance" in effects:
            load = effects["voltage_dependent_capacitance"]
            fine = stateful_dynamics.charged_through(fine, load["time_constant_s"], load["per_v"], fine_s)
        if "unequal_lag" in effects:
            lag = effects["unequal_lag"]
            fine = stateful_dynamics.unequal_lag(fine, lag["rising_s"], lag["falling_s"], fine_s)
        if "drive_resonance" in effects:
            coil = effects["drive_resonance"]
            fine = linear_dynamics.oscillator(fine, coil["frequency_hz"], coil["damping_ratio"], fine_s)
        if "amplifier_saturation" in effects:
            rails = effects["amplifier_saturation"]
            fine = np.clip(fine, rails["low_v"], rails["high_v"])
        if "dead_zone" in effects:
            band = effects["dead_zone"]["half_width_v"]
            fine = fine - np.clip(fine, -band, band)
        if "charge_leak" in effects:
            fine = linear_dynamics.leak(fine, effects["charge_leak"]["time_constant_s"], fine_s)
        return fine

    def _looped(self, drive_v: np.ndarray, fine_s: float) -> np.ndarray:
        loops: Any = self.loops
        if "asymmetric_hysteresis" in self.effects:
            skewed = self.effects["asymmetric_hysteresis"]
            if skewed["form"] == "warped_drive":
                drive_v = drive_v * (1.0 + skewed["amount"] * drive_v / self.reach_v)
            elif skewed["form"] == "unequal_envelopes":
                assert isinstance(loops, PlayStack)
                plays = (loops.slope_um_per_v, loops.thresholds_v, loops.weights_um_per_v)
                loops = GeneralisedPlays(*plays, self.reach_v, (0.0, 0.0), skewed["amount"])
            else:
                raise ValueError(f"asymmetry of form {skewed['form']!r}")
        if "rate_dependent_hysteresis" in self.effects:
            assert isinstance(loops, PlayStack)
            loops = RateDependentPlays(loops, self.effects["rate_dependent_hysteresis"]["per_v_per_s"], fine_s)
        return loops.run(drive_v)

    def _creeping(self, drive_v: np.ndarray, fine_s: float) -> np.ndarray:
        law = self.creep_law
        if "creep_law" in self.effects:
            other = self.effects["creep_law"]
            if other["form"] == "logarithmic":
                law = Logarithmic(other["per_decade"], other["onset_s"])
            else:
                law = Relaxations(other["amplitudes"], other["time_constants_s"])
        x = creep(self._looped(drive_v, fine_s), law, fine_s)
        if "amplitude_dependent_creep" in self.effects:
            switching = self.effects["amplitude_dependent_creep"]
            more = switching["share"] * self.loops.switching(self.reach_v).run(drive_v)
            # What has crept by then is of the loops. The same time for every record: no sensor's rate moves domains.
            x = x + creep(more, law, fine_s) - law.of_step(np.array([switching["onset_s"]]))[0] * more
        return x

    def _mechanics(self, x: np.ndarray, fine_s: float) -> np.ndarray:
        effects = self.effects
        if "slow_relaxation" in effects:
            glue = effects["slow_relaxation"]
            x = x + glue["amplitude"] * linear_dynamics.first_order_lag(x, glue["time_constant_s"], fine_s)
        if "mechanical_resonance" in effects:
            stage = effects["mechanical_resonance"]
            x = linear_dynamics.oscillator(x, stage["frequency_hz"], stage["damping_ratio"], fine_s)
        if "second_mode" in effects:
            modes = effects["second_mode"]
            parts = zip(modes["shares"], modes["frequencies_hz"], modes["damping_ratios"], strict=True)
            x = sum(share * linear_dynamics.oscillator(x, f, ratio, fine_s) for share, f, ratio in parts)
        if "lost_preload" in effects:
            clamp = effects["lost_preload"]
            x = x + clamp["share"] * np.minimum(x - clamp["kink_um"], 0.0)
        if "backlash" in effects:
            x = stateful_dynamics.backlash(x, effects["backlash"]["gap_um"])
        return x

    def _surroundings(self, x: np.ndarray, sample_s: np.ndarray, circumstance: Circumstance) -> np.ndarray:
        effects = self.effects
        for load in circumstance.loads if "external_load" in effects else ():
            x = x + load.size_um * -np.expm1(-np.maximum(sample_s - load.start_s, 0.0) / load.rise_s)
        if "cross_axis" in effects and circumstance.cross is not None:
            x = x + effects["cross_axis"]["gain"] * circumstance.cross
        if "gain_drift" in effects:
            x = x * (1.0 + effects["gain_drift"]["per_s"] * sample_s)
        if "thermal_drift" in effects:
            drift = effects["thermal_drift"]
            if "um_per_degc" in drift:
                x = x + drift["um_per_degc"] * circumstance.temperature_c
            elif "um_per_s" in drift:
                x = x + drift["um_per_s"] * sample_s
            else:
                x = x - drift["amplitude_um"] * np.expm1(-sample_s / drift["time_constant_s"])
        if "sensor_nonlinearity" in effects:
            bend = effects["sensor_nonlinearity"]
            x = x + bend["quadratic_per_um"] * x**2 + bend["cubic_per_um2"] * x**3
        if "cyclic_sensor_error" in effects:
            fringe = effects["cyclic_sensor_error"]
            x = x + fringe["amplitude_um"] * np.sin(2.0 * np.pi * x / fringe["period_um"] + fringe["phase_rad"])
        if "mains_hum" in effects:
            hum = effects["mains_hum"]
            angle = 2.0 * np.pi * hum["frequency_hz"] * sample_s
            for k, (share, phase) in enumerate(zip(hum["shares"], circumstance.hum_phases, strict=True), start=1):
                x = x + hum["amplitude_um"] * share * np.sin(k * angle + phase)
        return x
