"""Voltages to drive an actuator with: what shows hysteresis and creep, and what wipes their memory.

Every signal runs about ``offset_v`` and, but for the multisine, ends there. The defaults are the paper's
where it gives numbers (section 3.1: 1 V/s, 0.25 V steps of 3 s, 1 kHz; Table 2: levels, -2.5 to 2.5 V); it
gives none for the relaxation routine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.records.arguments import not_negative, positive, whole
from fomrc_core.records.recording import Recording

AMPLITUDE_V = 2.5
RATE_HZ = 1000.0
_N_SAMPLES_MAX = 50_000_000
# From below the smallest step of any converter to above any amplifier; rates from a sample in years to a
# hundred times the fastest converter. Between these no product or quotient of two arguments overflows.
_SMALLEST_V, _LARGEST_V = 1e-9, 1e6
_SLOWEST_HZ, _FASTEST_HZ = 1e-9, 1e12


@dataclass(frozen=True, eq=False)
class Excitation:
    """A sampled drive voltage, linear between its samples.

    Args:
        time_s: sample times [s] from 0, strictly increasing, shape (n_samples,).
        voltage_v: voltage at these times [V], shape (n_samples,).
        name: what it is.

    Raises:
        RecordingError: unequal lengths, values not finite, time not increasing.
    """

    time_s: NDArray[np.float64]
    voltage_v: NDArray[np.float64]
    name: str

    def __post_init__(self) -> None:
        checked = Recording(self.time_s, self.voltage_v, name=self.name)
        object.__setattr__(self, "time_s", checked.time_s)
        object.__setattr__(self, "voltage_v", checked.voltage_v)

    def __str__(self) -> str:
        return (
            f"{self.name}: {self.n_samples} samples, {self.duration_s:g} s, "
            f"{self.voltage_v.min():g} to {self.voltage_v.max():g} V"
        )

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.time_s.size)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    def to_recording(self) -> Recording:
        """Return it as a recording without displacement."""
        return Recording(self.time_s, self.voltage_v, name=self.name)


def relaxation(
    amplitude_v: float = AMPLITUDE_V,
    *,
    duration_s: float = 30.0,
    frequency_hz: float = 10.0,
    corner_ratio: float = 0.1,
    final_ratio: float = 1e-4,
    rest_s: float = 0.0,
    offset_v: float = 0.0,
    rate_hz: float = RATE_HZ,
) -> Excitation:
    """Return the routine that brings every element to its relaxed state: an oscillation that dies away.

    Equations (27) and (28), a^max there being u^max: u = a(t) sin(2 pi f t - pi / 2), where a falls by k_1
    per second up to t_1 and exponentially with k_2 after it, and k_1 = k_2 (u^max - k_1 t_1) keeps the slope
    of a continuous. t_1, k_1 and k_2 follow from how far a falls until t_1 and until the end. The routine
    ends at the first passage of the sine through zero after ``duration_s``.

    An element keeps about half of what the amplitude fell by from one turning point to the next, k_1 / (4 f):
    more cycles leave less. Creep from what went before the routine is not wiped out but grows old.

    Args:
        amplitude_v: u^max [V]; the first sample is ``offset_v - amplitude_v``.
        duration_s: time the amplitude takes to fall [s], one period or longer.
        frequency_hz: f [Hz], at most a quarter of ``rate_hz``.
        corner_ratio: a(t_1) / u^max, between ``final_ratio`` and 1.
        final_ratio: a / u^max after ``duration_s``.
        rest_s: time without motion at the end [s].
        offset_v: voltage about which it runs, and at which it ends [V].
        rate_hz: sample rate [Hz].

    Raises:
        ParameterError: an argument outside what is allowed.
    """
    # Many arguments: the choices of one drive, each with the paper's value and given by name.
    _voltage("amplitude_v", amplitude_v)
    positive("frequency_hz", frequency_hz, "Hz", at_least=_SLOWEST_HZ, at_most=0.25 * _rate(rate_hz))
    positive("duration_s", duration_s, "s", at_least=1.0 / frequency_hz)
    _refuse_too_many((duration_s + not_negative("rest_s", rest_s, "s")) * rate_hz)
    positive("corner_ratio", corner_ratio, "", below=1.0)
    positive("final_ratio", final_ratio, "", below=corner_ratio)
    # a(t_1) = c u^max gives k_1 t_1 = (1 - c) u^max and k_2 = k_1 / (c u^max); then exp(-k_2 (t_f - t_1)) is
    # final_ratio / c.
    fall = corner_ratio / (1.0 - corner_ratio) * np.log(corner_ratio / final_ratio)
    linear_s = duration_s / (1.0 + fall)
    k_1 = (1.0 - corner_ratio) * amplitude_v / linear_s
    k_2 = k_1 / (corner_ratio * amplitude_v)
    # sin(2 pi f t - pi / 2) is zero at odd multiples of a quarter period.
    end_s = (2.0 * np.ceil(0.5 * (4.0 * frequency_hz * duration_s - 1.0)) + 1.0) / (4.0 * frequency_hz)
    time_s = _sample_times(end_s + rest_s, rate_hz)
    exponential_v = corner_ratio * amplitude_v * np.exp(k_2 * (linear_s - np.maximum(time_s, linear_s)))
    envelope_v = np.where(time_s <= linear_s, amplitude_v - k_1 * time_s, exponential_v)
    voltage_v = envelope_v * np.sin(2.0 * np.pi * frequency_hz * time_s - 0.5 * np.pi)
    voltage_v[time_s >= end_s - 0.5 / rate_hz] = 0.0
    return Excitation(time_s, _offset(offset_v) + voltage_v, "relaxation")


def triangle(
    amplitude_v: float = AMPLITUDE_V,
    *,
    slope_v_per_s: float = 1.0,
    n_cycles: int = 5,
    is_unipolar: bool = False,
    offset_v: float = 0.0,
    rate_hz: float = RATE_HZ,
) -> Excitation:
    """Return a triangle of constant slope whose amplitude falls from cycle to cycle, to zero after the last.

    Figure 9(a). The slope is exact; a turning point between two samples is cut off by less than one step.

    Args:
        amplitude_v: amplitude of the first cycle [V].
        slope_v_per_s: slope [V/s].
        n_cycles: number of cycles; the k-th has amplitude ``amplitude_v * (1 - (k - 1) / n_cycles)``.
        is_unipolar: between zero and the amplitude, not between minus and plus the amplitude.
        offset_v: voltage about which it runs [V].
        rate_hz: sample rate [Hz].

    Raises:
        ParameterError: an argument outside what is allowed.
    """
    _voltage("amplitude_v", amplitude_v)
    positive("slope_v_per_s", slope_v_per_s, "V/s", at_least=_SMALLEST_V * _SLOWEST_HZ)
    n_samples = _way_v(amplitude_v, n_cycles, is_unipolar=is_unipolar) / slope_v_per_s * _rate(rate_hz)
    _refuse_too_many(n_samples)
    if n_cycles > 1 and n_samples < 2 * n_cycles:
        raise ParameterError(
            "cycles fall between the samples",
            where="n_cycles",
            value=n_cycles,
            allowed=f"at most {max(1, int(0.5 * n_samples))} at this slope and rate",
        )
    turns_v = _turning_levels_v(amplitude_v, n_cycles, is_unipolar=is_unipolar)
    turn_times_s = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(turns_v))))) / slope_v_per_s
    time_s = _sample_times(float(turn_times_s[-1]), rate_hz)
    voltage_v = np.interp(time_s, turn_times_s, turns_v)
    voltage_v[-1] = 0.0
    return Excitation(time_s, _offset(offset_v) + voltage_v, "triangle")


def staircase(
    amplitude_v: float = AMPLITUDE_V,
    *,
    step_v: float = 0.25,
    dwell_s: float = 3.0,
    n_cycles: int = 2,
    is_unipolar: bool = False,
    offset_v: float = 0.0,
    rate_hz: float = RATE_HZ,
) -> Excitation:
    """Return a staircase up and down whose amplitude falls from cycle to cycle, to zero after the last.

    Figure 9(b).

    Args:
        amplitude_v: amplitude of the first cycle [V], one step or more; rounded to whole steps.
        step_v: height of a step [V].
        dwell_s: time on each step [s].
        n_cycles: number of cycles.
        is_unipolar: between zero and the amplitude, not between minus and plus the amplitude.
        offset_v: voltage about which it runs [V].
        rate_hz: sample rate [Hz].

    Raises:
        ParameterError: an argument outside what is allowed.
    """
    # Many arguments: the choices of one drive, each with the paper's value and given by name.
    _voltage("step_v", step_v)
    positive("amplitude_v", amplitude_v, "V", at_least=step_v, at_most=_LARGEST_V)
    _refuse_too_many(
        _way_v(amplitude_v, n_cycles, is_unipolar=is_unipolar) / step_v * _n_per_level(dwell_s, _rate(rate_hz))
    )
    turns = np.round(_turning_levels_v(amplitude_v, n_cycles, is_unipolar=is_unipolar) / step_v).astype(int)
    levels = [0]
    for level in turns[1:]:
        direction = 1 if level > levels[-1] else -1
        levels.extend(range(levels[-1] + direction, level + direction, direction) if level != levels[-1] else ())
    # Zero is where it begins, not the first step; at the end it is a step like the others.
    return _held(np.array(levels[1:]) * step_v, dwell_s, dwell_s, offset_v, rate_hz, "staircase")


def steps(
    levels_v: Sequence[float] = (2.5, 0.0, 1.5, 0.0, 0.5, 0.0, -0.5, 0.0, -1.5, 0.0, -2.5, 0.0),
    *,
    dwell_s: float = 60.0,
    lead_in_s: float = 1.0,
    offset_v: float = 0.0,
    rate_hz: float = RATE_HZ,
) -> Excitation:
    """Return steps from zero through given levels; by default those of figure 11 and Table 2, 60 s each.

    Args:
        levels_v: levels [V], in order.
        dwell_s: time on each level [s].
        lead_in_s: time at zero before the first step [s].
        offset_v: voltage counted as zero [V].
        rate_hz: sample rate [Hz].

    Raises:
        ParameterError: an argument outside what is allowed.
    """
    levels = np.atleast_1d(np.array(levels_v, dtype=np.float64))
    if levels.size == 0 or levels.ndim != 1 or not np.all(np.abs(levels) <= _LARGEST_V):
        raise ParameterError(
            "no levels to step to", where="levels_v", value=levels_v, allowed=f"numbers within {_LARGEST_V:g} V"
        )
    return _held(levels, dwell_s, lead_in_s, offset_v, rate_hz, "steps")


def multisine(
    amplitude_v: float = AMPLITUDE_V,
    *,
    lowest_hz: float = 0.1,
    highest_hz: float = 20.0,
    period_s: float = 10.0,
    n_periods: int = 3,
    seed: int = 0,
    offset_v: float = 0.0,
    rate_hz: float = RATE_HZ,
) -> Excitation:
    """Return a random-phase multisine: all harmonics in a band, equally high, repeated period by period.

    What differs from period to period is noise, drift or a transient; what repeats is the actuator. It begins
    at the sample of the period that is nearest to zero.

    Args:
        amplitude_v: largest excursion [V].
        lowest_hz: lower end of the band [Hz].
        highest_hz: upper end of the band [Hz], below half of ``rate_hz``.
        period_s: period [s], a whole number of samples.
        n_periods: number of periods.
        seed: seed of the phases.
        offset_v: voltage about which it runs [V].
        rate_hz: sample rate [Hz].

    Raises:
        ParameterError: an argument outside what is allowed, or a band without harmonics.
    """
    # Many arguments: the choices of one drive, each with the paper's value and given by name.
    _voltage("amplitude_v", amplitude_v)
    positive("highest_hz", highest_hz, "Hz", below=0.5 * _rate(rate_hz))
    positive("lowest_hz", lowest_hz, "Hz", at_most=highest_hz)
    whole("n_periods", n_periods, at_most=_N_SAMPLES_MAX)
    whole("seed", seed, at_least=0)
    _refuse_too_many(positive("period_s", period_s, "s") * rate_hz * n_periods)
    n_per_period = round(period_s * rate_hz)
    if n_per_period < 4 or abs(n_per_period - period_s * rate_hz) > 1e-6:
        raise ParameterError(
            "period is not a whole number of samples",
            where="period_s",
            value=period_s,
            allowed=f"multiples of {1.0 / rate_hz:g} s, 4 samples or more",
        )
    # A hair of tolerance, so that a band given in decimals holds the harmonics at its ends.
    harmonics = np.arange(np.ceil(lowest_hz * period_s - 1e-9), np.floor(highest_hz * period_s + 1e-9) + 1).astype(int)
    if harmonics.size == 0:
        raise ParameterError(
            "no harmonic of the period in the band",
            where="lowest_hz, highest_hz",
            value=(lowest_hz, highest_hz),
            allowed=f"a band with a multiple of {1.0 / period_s:g} Hz",
        )
    spectrum = np.zeros(n_per_period // 2 + 1, dtype=np.complex128)
    spectrum[harmonics] = np.exp(2j * np.pi * np.random.default_rng(seed).random(harmonics.size))
    period_v = np.fft.irfft(spectrum, n_per_period)
    period_v *= amplitude_v / np.max(np.abs(period_v))
    period_v = np.roll(period_v, -int(np.argmin(np.abs(period_v))))
    time_s = np.arange(n_per_period * n_periods) / rate_hz
    return Excitation(time_s, _offset(offset_v) + np.tile(period_v, n_periods), "multisine")


def concatenate(*excitations: Excitation, name: str = "") -> Excitation:
    """Return excitations one after the other, a sample step between them.

    Args:
        excitations: in order, one or more.
        name: name of the whole; by default the names joined.

    Raises:
        ParameterError: nothing to put together.
    """
    if not excitations:
        raise ParameterError("nothing to put together", where="excitations", allowed="one or more")
    times, start_s = [], 0.0
    for excitation in excitations:
        times.append(start_s + excitation.time_s - excitation.time_s[0])
        start_s = float(times[-1][-1]) + float(np.median(np.diff(excitation.time_s)))
    return Excitation(
        np.concatenate(times),
        np.concatenate([excitation.voltage_v for excitation in excitations]),
        name or "+".join(excitation.name for excitation in excitations),
    )


def _way_v(amplitude_v: float, n_cycles: int, *, is_unipolar: bool) -> float:
    """Return the way of the voltage through all its turning points [V], without making a list of them."""
    # A cycle takes two samples or more. The amplitudes sum to those of the first and the last cycle, times half their
    # number; each is gone through twice, on both sides of zero or on one.
    whole("n_cycles", n_cycles, at_most=_N_SAMPLES_MAX // 2)
    return (2.0 if is_unipolar else 4.0) * 0.5 * amplitude_v * (n_cycles + 1)


def _turning_levels_v(amplitude_v: float, n_cycles: int, *, is_unipolar: bool) -> NDArray[np.float64]:
    amplitudes = amplitude_v * (1.0 - np.arange(n_cycles) / n_cycles)
    lows = np.zeros(n_cycles) if is_unipolar else -amplitudes
    turns = np.column_stack((amplitudes, lows)).reshape(-1)
    return np.concatenate(([0.0], turns) if is_unipolar else ([0.0], turns, [0.0]))


def _held(
    levels_v: NDArray[np.float64],
    dwell_s: float,
    lead_in_s: float,
    offset_v: float,
    rate_hz: float,
    name: str,
) -> Excitation:
    n_per_level = _n_per_level(dwell_s, _rate(rate_hz))
    _refuse_too_many(not_negative("lead_in_s", lead_in_s, "s") * rate_hz + n_per_level * levels_v.size)
    n_lead_in = max(1, round(lead_in_s * rate_hz))
    voltage_v = np.concatenate((np.zeros(n_lead_in), np.repeat(levels_v, n_per_level)))
    return Excitation(np.arange(voltage_v.size) / rate_hz, _offset(offset_v) + voltage_v, name)


def _sample_times(duration_s: float, rate_hz: float) -> NDArray[np.float64]:
    _refuse_too_many(duration_s * rate_hz)
    n_steps = max(1, int(np.ceil(duration_s * rate_hz - 1e-6)))
    return np.arange(n_steps + 1) / rate_hz


def _n_per_level(dwell_s: float, rate_hz: float) -> int:
    _refuse_too_many(positive("dwell_s", dwell_s, "s", at_least=1.0 / rate_hz) * rate_hz)
    return round(dwell_s * rate_hz)


def _voltage(name: str, value: float) -> float:
    return positive(name, value, "V", at_least=_SMALLEST_V, at_most=_LARGEST_V)


def _rate(rate_hz: float) -> float:
    return positive("rate_hz", rate_hz, "Hz", at_least=_SLOWEST_HZ, at_most=_FASTEST_HZ)


def _offset(offset_v: float) -> float:
    if not abs(offset_v) <= _LARGEST_V:
        raise ParameterError("out of range", where="offset_v", value=offset_v, allowed=f"within {_LARGEST_V:g} V")
    return float(offset_v)


def _refuse_too_many(n_samples: float) -> None:
    # Asked before anything is rounded or made: a product of two arguments may be infinite.
    if not n_samples <= _N_SAMPLES_MAX:
        raise ParameterError(
            "too many samples",
            where="excitation",
            value=float(n_samples),
            allowed=f"{_N_SAMPLES_MAX} or fewer: a lower rate_hz, or shorter",
        )
