"""What may be hidden: for each cause, how its parameters are drawn on a bench, and how far its size may be turned.

Times are drawn in samples and shares of the record, displacements and voltages in shares of the ranges, so that a
cause is as easily seen on a stage of 10 nm as on one of 20 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from test.hidden.second.hysteresis_forms import PLAY_FORMS
from test.hidden.second.scale import Scale, log_uniform


@dataclass(frozen=True)
class Draft:
    """One cause, drawn but for its size: ``build(size)`` gives the parameters.

    Args:
        build: parameters of a size.
        smallest, largest: sizes that are physically sensible.
        power: the visible effect grows about as size**power.
    """

    build: Callable[[float], dict[str, Any]]
    smallest: float
    largest: float
    power: float = 1.0


class Bench(Protocol):
    """What a draw needs to know of a bench."""

    scale: Scale
    form: str

    @property
    def largest_rate_v_per_s(self) -> float:
        """Fastest motion of the training drive, but for single steps [V/s]."""


Draw = Callable[[Bench, np.random.Generator], Draft]


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _dac(bench: Bench, rng: np.random.Generator) -> Draft:
    span = bench.scale.span_v
    return Draft(lambda v: {"step_v": v}, 1e-4 * span, 0.05 * span)


def _slew(bench: Bench, rng: np.random.Generator) -> Draft:
    most = bench.largest_rate_v_per_s
    return Draft(lambda part: {"slew_v_per_s": most / part}, 0.05, 50.0, 1.5)


def _lag_s(bench: Bench) -> tuple[float, float]:
    """Return the least and largest time constant a record can show [s]."""
    return 0.1 * bench.scale.step_s, 0.02 * bench.scale.duration_s


def _bandwidth(bench: Bench, rng: np.random.Generator) -> Draft:
    return Draft(lambda tau: {"cutoff_hz": 1.0 / (2.0 * np.pi * tau)}, *_lag_s(bench))


def _capacitance(bench: Bench, rng: np.random.Generator) -> Draft:
    per_v = rng.uniform(0.3, 0.8) / bench.scale.reach_v * _sign(rng)
    return Draft(lambda tau: {"time_constant_s": tau, "per_v": per_v}, *_lag_s(bench))


def _unequal(bench: Bench, rng: np.random.Generator) -> Draft:
    ratio = np.exp(_sign(rng) * rng.uniform(0.5, 1.2))
    return Draft(lambda tau: {"rising_s": tau * np.sqrt(ratio), "falling_s": tau / np.sqrt(ratio)}, *_lag_s(bench))


def _sensor_bandwidth(bench: Bench, rng: np.random.Generator) -> Draft:
    order = int(rng.integers(1, 5))
    return Draft(lambda tau: {"cutoff_hz": 1.0 / (2.0 * np.pi * tau), "order": order}, *_lag_s(bench))


def _period_s(bench: Bench) -> tuple[float, float]:
    """Return the shortest and longest period of an oscillation a record can show [s]."""
    return 4.0 * bench.scale.step_s, 0.02 * bench.scale.duration_s


def _drive_resonance(bench: Bench, rng: np.random.Generator) -> Draft:
    ratio = rng.uniform(0.15, 0.6)
    return Draft(lambda p: {"frequency_hz": 1.0 / p, "damping_ratio": ratio}, *_period_s(bench), 1.5)


def _resonance(bench: Bench, rng: np.random.Generator) -> Draft:
    ratio = log_uniform(rng, 0.01, 0.15)
    return Draft(lambda p: {"frequency_hz": 1.0 / p, "damping_ratio": ratio}, *_period_s(bench), 1.5)


def _second_mode(bench: Bench, rng: np.random.Generator) -> Draft:
    apart, second = rng.uniform(0.3, 0.6), rng.uniform(0.15, 0.45)
    ratios = tuple(log_uniform(rng, 0.01, 0.1) for _ in range(2))
    shortest, longest = _period_s(bench)
    return Draft(
        lambda p: {
            "frequencies_hz": (1.0 / p, 1.0 / (apart * p)),
            "shares": (1.0 - second, second),
            "damping_ratios": ratios,
        },
        shortest / apart,
        longest,
        1.5,
    )


def _saturation(bench: Bench, rng: np.random.Generator) -> Draft:
    scale = bench.scale
    which = int(rng.integers(3)) if scale.low_v < -0.2 * scale.reach_v else 0  # upper, lower, both
    far_v, share = 0.2 * scale.span_v, rng.uniform(0.5, 1.0)

    def rails(cut_v: float) -> dict[str, Any]:
        return {
            "low_v": scale.low_v + (-far_v, cut_v, share * cut_v)[which],
            "high_v": scale.high_v - (cut_v, -far_v, cut_v)[which],
        }

    return Draft(rails, 0.003 * scale.span_v, 0.15 * scale.span_v, 1.5)


def _dead_zone(bench: Bench, rng: np.random.Generator) -> Draft:
    span = bench.scale.span_v
    return Draft(lambda v: {"half_width_v": v}, 5e-4 * span, 0.08 * span)


def _charge_leak(bench: Bench, rng: np.random.Generator) -> Draft:
    duration_s = bench.scale.duration_s
    return Draft(lambda rate: {"time_constant_s": duration_s / rate}, 0.003, 5.0)


def _contact(bench: Bench, rng: np.random.Generator) -> Draft:
    many = int(rng.integers(2, 6))
    return Draft(lambda share: {"n_openings": many, "share_of_record": share}, 1e-3, 0.03, 1.5)


def _rate_dependent(bench: Bench, rng: np.random.Generator) -> Draft:
    fast = bench.largest_rate_v_per_s
    return Draft(lambda w: {"per_v_per_s": w / fast}, 0.01, 3.0)


def _asymmetry(bench: Bench, rng: np.random.Generator) -> Draft:
    form = ("warped_drive", "unequal_envelopes")[int(rng.integers(2))] if bench.form in PLAY_FORMS else "warped_drive"
    sign = _sign(rng)
    return Draft(lambda a: {"form": form, "amount": sign * a}, 1e-4, 0.3)


def _creep_law(bench: Bench, rng: np.random.Generator) -> Draft:
    step_s, duration_s = bench.scale.step_s, bench.scale.duration_s
    if rng.random() < 0.5:
        onset_s = log_uniform(rng, 3.0 * step_s, 0.03 * duration_s)
        return Draft(lambda g: {"form": "logarithmic", "per_decade": g, "onset_s": onset_s}, 1e-3, 0.2)
    n = int(rng.integers(2, 5))
    taus_s = np.sort([log_uniform(rng, 5.0 * step_s, 0.3 * duration_s) for _ in range(n)])
    shares = rng.dirichlet(np.full(n, 4.0))
    return Draft(
        lambda total: {
            "form": "relaxations",
            "amplitudes": tuple(total * shares),
            "time_constants_s": tuple(taus_s),
        },
        1e-3,
        0.3,
    )


def _amplitude_creep(bench: Bench, rng: np.random.Generator) -> Draft:
    onset_s = bench.scale.step_s / bench.actuator.oversampling
    return Draft(lambda share: {"share": share, "onset_s": onset_s}, 0.05, 30.0)


def _relaxation(bench: Bench, rng: np.random.Generator) -> Draft:
    tau_s = log_uniform(rng, 8.0 * bench.scale.step_s, 0.15 * bench.scale.duration_s)
    return Draft(lambda a: {"amplitude": a, "time_constant_s": tau_s}, 5e-4, 0.3)


def _lost_preload(bench: Bench, rng: np.random.Generator) -> Draft:
    scale = bench.scale
    kink_um = scale.stroke_um * (scale.low_v + rng.uniform(0.25, 0.7) * scale.span_v) / scale.span_v
    sign = _sign(rng)
    return Draft(lambda a: {"kink_um": kink_um, "share": sign * a}, 1e-3, 0.4)


def _backlash(bench: Bench, rng: np.random.Generator) -> Draft:
    stroke_um = bench.scale.stroke_um
    return Draft(lambda g: {"gap_um": g}, 1e-4 * stroke_um, 0.05 * stroke_um)


def _delay(bench: Bench, rng: np.random.Generator) -> Draft:
    return Draft(lambda s: {"delay_s": s}, *_lag_s(bench))


def _skew(bench: Bench, rng: np.random.Generator) -> Draft:
    sign, n = _sign(rng), bench.scale.n_samples
    # From a tenth of a sample at the record's end to a hundredth of the record.
    return Draft(lambda p: {"ppm": sign * p}, 1e6 * 0.1 / n, 1e4)


def _load(bench: Bench, rng: np.random.Generator) -> Draft:
    sign, stroke_um = _sign(rng), bench.scale.stroke_um
    return Draft(lambda d: {"size_um": sign * d}, 1e-4 * stroke_um, 0.1 * stroke_um)


def _cross(bench: Bench, rng: np.random.Generator) -> Draft:
    sign = _sign(rng)
    # Per unit of a motion, or voltage, as large as this axis' own.
    kind = ("displacement", "voltage")[int(rng.integers(2))]
    unit = 1.0 if kind == "displacement" else bench.scale.stroke_um / bench.scale.span_v
    return Draft(lambda g: {"gain": sign * g * unit, "kind": kind}, 1e-4, 0.1)


def _thermal(bench: Bench, rng: np.random.Generator) -> Draft:
    kind, sign, stroke_um = int(rng.integers(4)), _sign(rng), bench.scale.stroke_um
    duration_s = bench.scale.duration_s
    if kind < 2:
        return Draft(lambda d: {"um_per_degc": sign * d}, 1e-4 * stroke_um, 0.5 * stroke_um)
    if kind == 2:
        return Draft(lambda d: {"um_per_s": sign * d / duration_s}, 1e-4 * stroke_um, 0.5 * stroke_um)
    tau_s = log_uniform(rng, 0.2, 1.5) * duration_s
    return Draft(lambda d: {"amplitude_um": sign * d, "time_constant_s": tau_s}, 1e-4 * stroke_um, 0.5 * stroke_um)


def _gain_drift(bench: Bench, rng: np.random.Generator) -> Draft:
    sign, duration_s = _sign(rng), bench.scale.duration_s
    return Draft(lambda g: {"per_s": sign * g / duration_s}, 2e-4, 0.2)


def _nonlinearity(bench: Bench, rng: np.random.Generator) -> Draft:
    signs, quadratic = (_sign(rng), _sign(rng)), (1.0, 0.0, rng.uniform(0.3, 0.7))[int(rng.integers(3))]
    stroke_um = bench.scale.stroke_um
    return Draft(
        lambda d: {
            "quadratic_per_um": signs[0] * d * quadratic / stroke_um,
            "cubic_per_um2": signs[1] * d * (1.0 - quadratic) / stroke_um**2,
        },
        1e-4,
        0.3,
    )


def _cyclic(bench: Bench, rng: np.random.Generator) -> Draft:
    stroke_um, phase = bench.scale.stroke_um, rng.uniform(0.0, 2.0 * np.pi)
    period_um = stroke_um / log_uniform(rng, 3.0, 30.0)
    return Draft(
        lambda a: {"period_um": period_um, "amplitude_um": a, "phase_rad": phase}, 5e-5 * stroke_um, 0.15 * period_um
    )


def _hum(bench: Bench, rng: np.random.Generator) -> Draft:
    scale = bench.scale
    hertz = log_uniform(rng, 20.0 / scale.duration_s, 0.12 * scale.rate_hz)
    shares = (1.0, rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5)) if rng.random() < 0.5 else (1.0, 0.0, 0.0)
    return Draft(
        lambda a: {"frequency_hz": hertz, "amplitude_um": a, "shares": shares},
        1e-5 * scale.stroke_um,
        0.1 * scale.stroke_um,
    )


def _initial(bench: Bench, rng: np.random.Generator) -> Draft:
    scale = bench.scale
    top = scale.high_v if rng.random() < 0.7 or scale.low_v > -0.2 * scale.reach_v else scale.low_v
    held_s, rested_s = log_uniform(rng, 0.02, 0.4) * scale.duration_s, log_uniform(rng, 0.005, 0.08) * scale.duration_s
    return Draft(lambda part: {"level_v": part * top, "held_s": held_s, "rested_s": rested_s}, 0.15, 1.0)


KNOWN: dict[str, Draw] = {
    "dac_quantization": _dac,
    "amplifier_slew_limit": _slew,
    "amplifier_bandwidth": _bandwidth,
    "amplifier_saturation": _saturation,
    "dead_zone": _dead_zone,
    "asymmetric_hysteresis": _asymmetry,
    "initial_state": _initial,
    "slow_relaxation": _relaxation,
    "mechanical_resonance": _resonance,
    "transport_delay": _delay,
    "clock_skew": _skew,
    "external_load": _load,
    "cross_axis": _cross,
    "thermal_drift": _thermal,
    "gain_drift": _gain_drift,
    "sensor_nonlinearity": _nonlinearity,
    "mains_hum": _hum,
}
"""Effects a library of causes has long had; missing_hysteresis is a lack of a model and no effect."""

NEW: dict[str, Draw] = {
    "rate_dependent_hysteresis": _rate_dependent,
    "sensor_bandwidth": _sensor_bandwidth,
    "drive_resonance": _drive_resonance,
    "second_mode": _second_mode,
    "zero_order_hold": lambda bench, rng: Draft(lambda _: {"hold_s": bench.scale.step_s}, 1.0, 1.0),
    "creep_law": _creep_law,
    "lost_preload": _lost_preload,
    "backlash": _backlash,
    "voltage_dependent_capacitance": _capacitance,
    "unequal_lag": _unequal,
    "amplitude_dependent_creep": _amplitude_creep,
    "charge_leak": _charge_leak,
    "cyclic_sensor_error": _cyclic,
    "intermittent_contact": _contact,
}
"""Effects that real stages have and a library may lack."""

DRAWS: dict[str, Draw] = {**KNOWN, **NEW}
MISSING = "missing_hysteresis"
KNOWN_CAUSES: tuple[str, ...] = (*KNOWN, MISSING)
NEW_CAUSES: tuple[str, ...] = tuple(NEW)
ON_PLAYS = ("rate_dependent_hysteresis", MISSING)
"""Causes that act on single plays, so that the actuator's hysteresis must be plays."""
BELONG_TO_ONE_RECORD = ("initial_state", "external_load")
"""Causes that may befall the training record alone."""
