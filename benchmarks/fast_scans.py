"""Fast motion: a target known as a whole is inverted with its dynamics, beside the inverse without a future.

python -m benchmarks.fast_scans
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.fast_truth import FastStage, plays_of_elements
from fomrc_core.effects.base.course import low_pass
from fomrc_core.identification.convex import identify
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.known_target import KnownTarget, known_target
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

STEP_S = 1e-4
KAPPA_UM_PER_V, SATURATION_V, CREEP_ORDER = [20.0, 12.0, 9.0, 1.4], [0.02, 0.07, 0.2], 0.015
AMPLIFIER_HZ, RESONANCE_HZ, DAMPING, DELAY_S = 500.0, 300.0, 0.02, 5e-4
STEP_DURATION_S = 0.015
REST_S = 0.005  # at either end of a course: longer than any delay here
N_ENDS = 300  # samples at either end that are not judged: the stage rings for so long after it has begun


def model(**changed: dict[str, float]) -> PiezoModel:
    """The model of the first bar; its creep holds from the parts of a step on, as the truth's does."""
    effects = {
        "amplifier_bandwidth": {"cutoff_hz": AMPLIFIER_HZ},
        "mechanical_resonance": {"frequency_hz": RESONANCE_HZ, "damping_ratio": DAMPING},
        "transport_delay": {"delay_s": DELAY_S},
    } | changed
    block = {"kappa_um_per_v": KAPPA_UM_PER_V, "saturation_v": SATURATION_V, "creep_order": CREEP_ORDER}
    return PiezoModel.from_mapping(block | {"shortest_time_s": 1e-6, "effects": list(effects)} | effects)


def truth() -> FastStage:
    """The same physics in code of its own."""
    plays = plays_of_elements(np.array(KAPPA_UM_PER_V), np.array(SATURATION_V))
    return FastStage(
        *plays,
        CREEP_ORDER,
        amplifier_hz=AMPLIFIER_HZ,
        resonance_hz=RESONANCE_HZ,
        damping=DAMPING,
        delay_s=DELAY_S,
    )


def band_limited_um(n_samples: int, seed: int, *, highest_hz: float = 150.0, range_um: float = 4.0) -> np.ndarray:
    """A random course with nothing above a frequency, from rest to rest."""
    rng = np.random.default_rng(seed)
    frequency_hz = np.fft.rfftfreq(n_samples, STEP_S)
    spectrum = rng.normal(size=frequency_hz.size) + 1j * rng.normal(size=frequency_hz.size)
    course = np.fft.irfft(spectrum * (frequency_hz > 0.0) * (frequency_hz <= highest_hz), n_samples)
    since_s = STEP_S * np.arange(n_samples)
    inside = np.clip((np.minimum(since_s, since_s[-1] - since_s) - REST_S) / 0.05, 0.0, 1.0)
    course *= 0.5 - 0.5 * np.cos(np.pi * inside)
    return range_um * course / np.ptp(course)


def raster_um(frequency_hz: float, range_um: float, *, rounded_hz: float = 150.0) -> np.ndarray:
    """One period of a triangle whose turns are rounded: nothing above ``rounded_hz``."""
    along = np.arange(round(1.0 / (frequency_hz * STEP_S))) * STEP_S * frequency_hz
    triangle = 4.0 * np.abs(np.mod(along - 0.25, 1.0) - 0.5) - 1.0
    spectrum = np.fft.rfft(triangle) * low_pass(np.fft.rfftfreq(along.size, STEP_S), 0.5 * rounded_hz, rounded_hz)
    return 0.5 * range_um * np.fft.irfft(spectrum, along.size)


def target_of(desired_um: np.ndarray, *, is_periodic: bool = False) -> KnownTarget:
    """Even samples from time zero."""
    return known_target(STEP_S * np.arange(desired_um.size), desired_um, is_periodic=is_periodic)


def largest_percent(moved_um: np.ndarray, desired_um: np.ndarray) -> float:
    """Largest error of the range [%], away from the ends."""
    inside = slice(N_ENDS, desired_um.size - N_ENDS)
    return float(100.0 * np.max(np.abs(moved_um - desired_um)[inside]) / np.ptp(desired_um))


@dataclass(frozen=True)
class FollowedCourse:
    """Largest errors of the range [%]: dynamic by the model and on the truth, static on the truth; rounds of search."""

    by_model: float
    on_truth: float
    static: float
    rounds: int


def band_limited_course(seed: int = 0, n_samples: int = 10000) -> FollowedCourse:
    """A course limited to 150 Hz, half of the resonance."""
    desired_um = band_limited_um(n_samples, seed)
    steps_s = np.full(n_samples, STEP_S)
    static_v = Compensator(model()).run(steps_s, desired_um)
    found = DynamicInverse(model()).run(target_of(desired_um))
    return FollowedCourse(
        largest_percent(model().simulate(steps_s, found.voltage_v), desired_um),
        largest_percent(truth().displacement_um(STEP_S, found.voltage_v), desired_um),
        largest_percent(truth().displacement_um(STEP_S, static_v), desired_um),
        int(found.errors_um.size),
    )


def step_profile_um(step_um: float, acceleration_um_per_s2: float, *, rest_s: float = 0.05) -> np.ndarray:
    """A step of a constant acceleration, then the same to stop, between rests."""
    half_s = np.sqrt(step_um / acceleration_um_per_s2)
    since_s = STEP_S * np.arange(round((2.0 * rest_s + 2.0 * half_s) / STEP_S)) - rest_s
    up = 0.5 * acceleration_um_per_s2 * np.clip(since_s, 0.0, half_s) ** 2
    down = 0.5 * acceleration_um_per_s2 * np.clip(2.0 * half_s - since_s, 0.0, half_s) ** 2
    return np.where(since_s < half_s, up, step_um - down)


@dataclass(frozen=True)
class Step:
    """Ringing after arrival of the step [%], with the inverses; arrival [s] predicted and on the truth."""

    ringing: float
    static_ringing: float
    predicted_s: float
    arrived_s: float


def acceleration_limited_step(step_um: float = 4.0, rest_s: float = 0.1) -> Step:
    """A step of the full range in four and a half swings of the mass, which does not let it ring out by itself."""
    desired_um = step_profile_um(step_um, 4.0 * step_um / STEP_DURATION_S**2, rest_s=rest_s)
    tolerance_um = 1e-3 * step_um
    found = DynamicInverse(model()).run(target_of(desired_um))
    static_v = Compensator(model()).run(np.full(desired_um.size, STEP_S), desired_um)
    moved_um = truth().displacement_um(STEP_S, found.voltage_v)
    static_um = truth().displacement_um(STEP_S, static_v)
    away = np.flatnonzero(np.abs(moved_um - desired_um[-1]) > tolerance_um)
    profile_s = rest_s + STEP_DURATION_S
    after = round(profile_s / STEP_S) + 1
    predicted_s = found.arrival_s(tolerance_um)
    assert predicted_s is not None
    return Step(
        100.0 * float(np.max(np.abs(moved_um - desired_um)[after:])) / step_um,
        100.0 * float(np.max(np.abs(static_um - desired_um)[after:])) / step_um,
        predicted_s - rest_s,
        float(away[-1] + 1) * STEP_S - rest_s,
    )


def other_stage() -> FastStage:
    """A stage of another form than any model: bent, with creep of three lags, and dynamics of its own."""
    thresholds_v = 1.6 * (np.arange(1, 31) / 30.0) ** 1.5
    weights = 0.9 * np.exp(-thresholds_v / 0.6) / np.sum(np.exp(-thresholds_v / 0.6))
    return FastStage(
        0.9,
        thresholds_v,
        weights,
        lags=((0.02, 0.02), (0.02, 0.3), (0.02, 5.0)),
        square_per_um=0.004,
        amplifier_hz=480.0,
        resonance_hz=310.0,
        damping=0.03,
        delay_s=4.6e-4,
    )


def identified_model() -> PiezoModel:
    """The other stage as its owner knows it: identified from a slow recording, dynamics by data sheets."""
    levels_v = np.array([0.0, 2.5, -2.5, 2.0, -2.0, 1.5, -1.5, 1.0, -1.0, 0.5, -0.5, 0.0])
    at_s = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(levels_v)) / 20.0)))
    time_s = 1e-3 * np.arange(round(at_s[-1] / 1e-3) + 1)
    voltage_v = np.interp(time_s, at_s, levels_v)
    moved_um = other_stage().displacement_um(1e-3, voltage_v)
    noise_um = np.random.default_rng(3).normal(0.0, 1e-3, time_s.size)
    shift = round((4.6e-4 + 3.3e-4) / 1e-3)
    found = identify(Recording(time_s, voltage_v, np.roll(moved_um, -shift) + noise_um), n_elements=10)
    return replace(model(), **{n: getattr(found.model, n) for n in ("kappa_um_per_v", "saturation_v", "creep_order")})


@dataclass(frozen=True)
class EndlessScan:
    """Largest error of the range [%] in the second and the hundredth period, and of the inverse without a future."""

    second: float
    hundredth: float
    static: float


def endless_scan(frequency_hz: float = 20.0, range_um: float = 4.0) -> EndlessScan:
    """A period played a hundred times, after four in which it is faded in."""
    desired_um = raster_um(frequency_hz, range_um)
    known = identified_model()
    voltage_v = DynamicInverse(known).run(target_of(desired_um, is_periodic=True)).voltage_v
    static_v = Compensator(known).run(np.full(4 * desired_um.size, STEP_S), np.tile(desired_um, 4))
    errors = _errors_of_periods(voltage_v, desired_um)
    return EndlessScan(errors[1], errors[99], _errors_of_periods(static_v[-desired_um.size :], desired_um, 2)[1])


def _errors_of_periods(voltage_v: np.ndarray, desired_um: np.ndarray, n_periods: int = 100) -> list[float]:
    n_faded = 4
    played_v = np.tile(voltage_v, n_faded + n_periods)
    fade = np.minimum(np.arange(played_v.size) / (n_faded * voltage_v.size), 1.0)
    moved_um = other_stage().displacement_um(STEP_S, played_v * (0.5 - 0.5 * np.cos(np.pi * fade)))
    periods_um = moved_um.reshape(-1, desired_um.size)[n_faded:]
    return [float(100.0 * np.max(np.abs(one - desired_um)) / np.ptp(desired_um)) for one in periods_um]


def main() -> None:
    """Print each bar with its figure."""
    course = band_limited_course()
    print(f"course to 150 Hz: by the model {course.by_model:.2g} % of the range off after {course.rounds} rounds,")
    print(f"  on the truth {course.on_truth:.2g} % (bar 1e-3 %); without a future {course.static:.3g} %")
    step = acceleration_limited_step()
    print(f"step of the range in {1e3 * STEP_DURATION_S:.0f} ms: {step.ringing:.2g} % after arrival (bar 0.1 %),")
    print(f"  without a future {step.static_ringing:.3g} %; it arrives after")
    print(f"  {1e3 * step.arrived_s:.2f} ms, predicted {1e3 * step.predicted_s:.2f} ms (bar 2 ms or 5 %)")
    scan = endless_scan()
    print(f"endless scan of 20 Hz on a stage of another form: period 2 {scan.second:.3g} % of the range,")
    print(f"  period 100 {scan.hundredth:.3g} % (bar within 10 %), without a future {scan.static:.3g} %")


if __name__ == "__main__":
    main()
