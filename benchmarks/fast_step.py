"""A step of the full range at rates that hold few swings of the mass: what is left ringing, at the samples and between.

    python -m benchmarks.fast_step

The mass swings at 300 Hz, damped by 0.02: at 1 kHz once in three samples. The drive goes straight from sample to
sample, or is held from each on, and the model says so. The stage is in code of its own, looked at in forty parts of a
sample.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.fast_loop import PREVIEW_S, driven_v, loop_of
from benchmarks.fast_scans import STEP_DURATION_S, STEP_S, model, step_profile_um, truth
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.known_target import known_target
from fomrc_core.model.piezo_model import PiezoModel

STEP_UM, REST_S = 4.0, 0.1
PERIODS_S = (1e-3, 5e-4)


class Left(NamedTuple):
    """Largest departure from the end of the step once it is over, of the step [%]."""

    at_samples: float
    between: float


def model_at(period_s: float, *, is_held: bool) -> PiezoModel:
    """The model of the first bar, its drive held where it is."""
    return model(zero_order_hold={"hold_s": period_s}) if is_held else model()


def profile_um(period_s: float) -> np.ndarray:
    """The step by a constant acceleration, then the same to stop."""
    acceleration = 4.0 * STEP_UM / STEP_DURATION_S**2
    return step_profile_um(STEP_UM, acceleration, rest_s=REST_S)[:: round(period_s / STEP_S)]


def voltages_v(way: str, period_s: float, known: PiezoModel) -> tuple[np.ndarray, float]:
    """Voltages [V] and how late the target is followed [s], by a loop ("live"), a whole target, or without a future."""
    target_um = profile_um(period_s)
    if way == "live":
        return driven_v(loop_of(known, PREVIEW_S, period_s), target_um), PREVIEW_S
    if way == "static":
        return Compensator(known).run(np.full(target_um.size, period_s), target_um), 0.0
    return DynamicInverse(known).run(known_target(period_s * np.arange(target_um.size), target_um)).voltage_v, 0.0


def left_percent(way: str, period_s: float, *, is_held: bool, is_told: bool = True) -> Left:
    """What is left on the stage after the step, from the sample after its end on; the model may not know of a hold."""
    driven, late_s = voltages_v(way, period_s, model_at(period_s, is_held=is_held and is_told))
    moved_um = replace(truth(), is_held=is_held).between_samples_um(period_s, driven)
    n_parts = moved_um.size // driven.size
    first = round((REST_S + STEP_DURATION_S + late_s) / period_s) + 1
    off = 100.0 * np.abs(moved_um - STEP_UM) / STEP_UM
    return Left(
        float(np.max(off[n_parts * (first + 1) - 1 :: n_parts])), float(np.max(off[n_parts * (first + 1) - 1 :]))
    )


def main() -> None:
    """Print what is left for each rate, drive and inverse."""
    print("step of 4 um in 15 ms, mass of 300 Hz damped by 0.02: left after its end, of the step (bar 0.1 %)")
    for period_s in PERIODS_S:
        for is_held in (False, True):
            print(f"  {1.0 / period_s:g} Hz, drive {'held' if is_held else 'straight'} between samples:")
            for way in ("static", "whole", "live"):
                left = left_percent(way, period_s, is_held=is_held)
                print(f"    {way}: {left.at_samples:.3g} % at the samples, {left.between:.3g} % between them")
        blind = left_percent("live", period_s, is_held=True, is_told=False)
        print(f"    live, the model not told of the hold: {blind.at_samples:.3g} %, {blind.between:.3g} %")


if __name__ == "__main__":
    main()
