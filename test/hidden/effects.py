"""What may be hidden: for each cause, how its parameters are drawn, and how far its size may be turned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from test.hidden.hysteresis import RelayPlane


@dataclass(frozen=True)
class Draft:
    """One cause, drawn but for its size: ``build(size)`` gives the parameters.

    Args:
        build: parameters of a size.
        size: size drawn first.
        smallest, largest: sizes that are physically sensible.
        power: the visible effect grows about as size**power.
        window_um: visible rms [um] that makes a fair case at 1 nm of noise.
    """

    build: Callable[[float], dict[str, Any]]
    size: float
    smallest: float
    largest: float
    power: float = 1.0
    window_um: tuple[float, float] = (3e-3, 30e-3)


@dataclass(frozen=True)
class Stage:
    """What a draw needs to know of the world and its record."""

    low_v: float
    high_v: float
    hysteresis: object
    duration_s: float


_FAST_UM = (3e-3, 300e-3)  # effects of speed: large where the drive is fast, nothing elsewhere


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw evenly over the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _bandwidth(stage: Stage, rng: np.random.Generator) -> Draft:
    return Draft(lambda f: {"cutoff_hz": f}, log_uniform(rng, 20.0, 400.0), 20.0, 400.0, -1.0, _FAST_UM)


def _slew(stage: Stage, rng: np.random.Generator) -> Draft:
    return Draft(lambda s: {"slew_v_per_s": s}, log_uniform(rng, 80.0, 1500.0), 40.0, 3000.0, -1.5, _FAST_UM)


def _saturation(stage: Stage, rng: np.random.Generator) -> Draft:
    span = stage.high_v - stage.low_v
    far_v, side, share = rng.uniform(0.5, 2.0), int(rng.integers(3)), rng.uniform(0.5, 2.0)
    if stage.low_v >= 0.0:
        side = 0  # a drive of one sign meets the upper rail alone

    def rails(cut_v: float) -> dict[str, Any]:
        return {
            "low_v": stage.low_v + (cut_v * share if side == 2 else cut_v if side == 1 else -far_v),
            "high_v": stage.high_v - (cut_v if side != 1 else -far_v),
        }

    return Draft(rails, log_uniform(rng, 0.02 * span, 0.12 * span), 0.005 * span, 0.2 * span, 1.5)


def _dac(stage: Stage, rng: np.random.Generator) -> Draft:
    return Draft(lambda v: {"step_v": v}, log_uniform(rng, 0.007, 0.07), 0.003, 0.15)


def _dead_zone(stage: Stage, rng: np.random.Generator) -> Draft:
    return Draft(lambda v: {"half_width_v": v}, log_uniform(rng, 0.01, 0.15), 0.005, 0.4)


def _delay(stage: Stage, rng: np.random.Generator) -> Draft:
    return Draft(lambda s: {"delay_s": s}, log_uniform(rng, 0.2e-3, 3e-3), 0.2e-3, 3e-3, 1.0, _FAST_UM)


def _asymmetry(stage: Stage, rng: np.random.Generator) -> Draft:
    forms = ["warped_drive"]
    if isinstance(stage.hysteresis, RelayPlane):
        forms += ["skewed_plane", "bent_envelope"]
    form = forms[int(rng.integers(len(forms)))]
    sign = _sign(rng)
    low, high = {"warped_drive": (1e-3, 0.1), "skewed_plane": (0.02, 0.8), "bent_envelope": (3e-3, 0.3)}[form]
    return Draft(lambda a: {"form": form, "amount": sign * a}, log_uniform(rng, low, high), low, high)


def _relaxation(stage: Stage, rng: np.random.Generator) -> Draft:
    tau_s = log_uniform(rng, 0.5, 10.0)
    return Draft(lambda a: {"amplitude": a, "time_constant_s": tau_s}, log_uniform(rng, 0.01, 0.05), 5e-3, 0.1)


def _resonance(stage: Stage, rng: np.random.Generator) -> Draft:
    ratio = log_uniform(rng, 0.01, 0.1)
    return Draft(
        lambda f: {"frequency_hz": f, "damping_ratio": ratio},
        rng.uniform(150.0, 450.0),
        150.0,
        450.0,
        -2.0,
        _FAST_UM,
    )


def _load(stage: Stage, rng: np.random.Generator) -> Draft:
    sign = _sign(rng)
    return Draft(lambda d: {"size_um": sign * d}, log_uniform(rng, 8e-3, 50e-3), 5e-3, 80e-3, 1.0, (3e-3, 30e-3))


def _cross(stage: Stage, rng: np.random.Generator) -> Draft:
    sign = _sign(rng)
    return Draft(lambda g: {"gain": sign * g}, log_uniform(rng, 1e-3, 2e-2), 5e-4, 5e-2)


def _sensor(stage: Stage, rng: np.random.Generator) -> Draft:
    signs, kind = (_sign(rng), _sign(rng)), rng.integers(3)
    share = rng.uniform(0.3, 0.7)
    largest_um = 8.0

    def bends(departure: float) -> dict[str, Any]:
        quadratic = departure * (1.0 if kind == 0 else 0.0 if kind == 1 else share)
        cubic = departure * (0.0 if kind == 0 else 1.0 if kind == 1 else 1.0 - share)
        return {
            "quadratic_per_um": signs[0] * quadratic / largest_um,
            "cubic_per_um2": signs[1] * cubic / largest_um**2,
        }

    return Draft(bends, log_uniform(rng, 2e-3, 2e-2), 5e-4, 6e-2)


def _thermal(stage: Stage, rng: np.random.Generator) -> Draft:
    kind, sign = rng.integers(4), _sign(rng)
    if kind < 2:
        return Draft(lambda c: {"um_per_degc": sign * c}, log_uniform(rng, 0.01, 0.1), 2e-3, 0.5)
    if kind == 2:
        span = stage.duration_s
        return Draft(lambda d: {"rate_um_per_s": sign * d / span}, log_uniform(rng, 0.01, 0.1), 5e-3, 0.3)
    tau_s = log_uniform(rng, 0.2, 1.5) * stage.duration_s
    return Draft(lambda d: {"amplitude_um": sign * d, "time_constant_s": tau_s}, log_uniform(rng, 0.01, 0.1), 5e-3, 0.5)


def _gain_drift(stage: Stage, rng: np.random.Generator) -> Draft:
    sign = _sign(rng)
    return Draft(lambda g: {"per_s": sign * g}, log_uniform(rng, 2e-5, 3e-4), 1e-5, 1e-3)


def _hum(stage: Stage, rng: np.random.Generator) -> Draft:
    nominal = [50.0, 60.0, 100.0, 16.7, rng.uniform(20.0, 180.0)][int(rng.integers(5))]
    hertz = nominal * (1.0 + rng.uniform(-1.0, 1.0) * 5e-4)
    return Draft(
        lambda a: {"frequency_hz": hertz, "amplitude_um": a},
        log_uniform(rng, 3e-3, 15e-3),
        3e-3,
        3e-2,
        1.0,
        (2e-3, 15e-3),
    )


def _initial(stage: Stage, rng: np.random.Generator) -> Draft:
    top = stage.high_v if rng.random() < 0.7 or stage.low_v >= 0.0 else stage.low_v
    hold_s, wait_s = log_uniform(rng, 0.5, 15.0), log_uniform(rng, 0.05, 2.0)
    return Draft(
        lambda part: {"level_v": part * top, "hold_s": hold_s, "wait_s": wait_s},
        rng.uniform(0.4, 1.0),
        0.2,
        1.0,
        1.0,
        (3e-3, 300e-3),
    )


def _skew(stage: Stage, rng: np.random.Generator) -> Draft:
    sign = _sign(rng)
    return Draft(lambda p: {"ppm": sign * p}, log_uniform(rng, 20.0, 300.0), 20.0, 300.0, 1.0, _FAST_UM)


DRAWS: dict[str, Callable[[Stage, np.random.Generator], Draft]] = {
    "dac_quantization": _dac,
    "amplifier_slew_limit": _slew,
    "amplifier_bandwidth": _bandwidth,
    "amplifier_saturation": _saturation,
    "dead_zone": _dead_zone,
    "asymmetric_hysteresis": _asymmetry,
    "slow_relaxation": _relaxation,
    "mechanical_resonance": _resonance,
    "transport_delay": _delay,
    "external_load": _load,
    "cross_axis": _cross,
    "thermal_drift": _thermal,
    "gain_drift": _gain_drift,
    "sensor_nonlinearity": _sensor,
    "mains_hum": _hum,
    "initial_state": _initial,
    "clock_skew": _skew,
}
"""How to draw each cause but missing_hysteresis, which is no effect of the world but a lack of the model."""

CAUSES: tuple[str, ...] = (*DRAWS, "missing_hysteresis")
