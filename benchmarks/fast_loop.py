"""The live loop with a preview and its arrival: what it gains, and what a tick costs.

python -m benchmarks.fast_loop
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.fast_scans import STEP_S, model, raster_um, step_profile_um, truth
from benchmarks.subjects import table_1
from fomrc_core.control.arrival import Arrival
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.stage_motion import StageMotion
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_inverse import PreviewInverse
from fomrc_core.records.residual import nrmse_percent

PERIOD_S = 1e-3
PREVIEW_S = 0.02
_SLEW_V_PER_S, _LIMIT_V = 500.0, 5.0
_N_SCANNED = 3000
_FROM = 1000  # the scan has been faded in by then
NOISE_UM = 1e-3


def loop_of(known: PiezoModel, preview_s: float, period_s: float = PERIOD_S) -> CompensationLoop:
    """A loop of a model, with a preview or without."""
    limits = VoltageLimits(-_LIMIT_V, _LIMIT_V, _SLEW_V_PER_S, 0.0, 10.0, 2.0 * period_s)
    settings = LoopSettings(limits, 0.0, False, period_s, 60.0)
    if not preview_s:
        return CompensationLoop(Compensator(known), settings)
    preview = PreviewInverse.of(known, period_s, preview_s)
    return CompensationLoop(preview.core, settings, preview=preview)


def driven_v(loop: CompensationLoop, target_um: np.ndarray) -> np.ndarray:
    """Voltages of a loop that is told one target a tick [V]."""
    voltages = []
    for wanted_um in target_um:
        loop.set_target(float(wanted_um))
        voltages.append(loop.tick(loop.settings.period_s))
    return np.array(voltages)


def scan_um(frequency_hz: float, period_s: float = PERIOD_S, n_samples: int = _N_SCANNED) -> np.ndarray:
    """A raster of 4 um rounded to 150 Hz, faded in over 0.3 s."""
    time_s, one = period_s * np.arange(n_samples), raster_um(frequency_hz, 4.0)
    along = np.linspace(0.0, 1.0, one.size + 1)
    fade = 0.5 - 0.5 * np.cos(np.pi * np.clip(time_s / 0.3, 0.0, 1.0))
    return fade * np.interp((time_s * frequency_hz) % 1.0, along, np.append(one, one[0]))


def raster_percent(known: PiezoModel, frequency_hz: float, preview_s: float) -> float:
    """NRMSE [%] of a raster on a stage in code of its own, against the target of the preview before."""
    target_um = scan_um(frequency_hz)
    moved_um = truth().displacement_um(PERIOD_S, driven_v(loop_of(known, preview_s), target_um))
    n_late = round(preview_s / PERIOD_S)
    return nrmse_percent(target_um[_FROM - n_late : target_um.size - n_late], moved_um[_FROM:])


def tick_us(known: PiezoModel) -> float:
    """Processor time of a tick of the inverse with preview [us]: target in, plan, memory moved on, voltage noted."""
    preview = PreviewInverse.of(known, PERIOD_S, PREVIEW_S)
    window, state = preview.window(), preview.core.initial_state()
    preview.warm_up()
    best_s, n_ticks = np.inf, 5000
    for _ in range(9):
        began = time.thread_time()
        for k in range(n_ticks):
            window.take(1e-3 * (k % 100))
            planned = preview.plan(state, window)
            preview.core.advance(state, planned.moved_um, PERIOD_S)
            window.note(planned.voltage_v, planned.inner_v)
        best_s = min(best_s, (time.thread_time() - began) / n_ticks)
    return 1e6 * best_s


class SteppedTo(NamedTuple):
    """How a step of 4 um ends: arrival by the loop and on the stage [s], ringing there [um], from its end on."""

    predicted_s: float
    measured_s: float
    ringing_um: float


def stepped(tolerance_um: float, period_s: float = PERIOD_S, preview_s: float = PREVIEW_S) -> SteppedTo:
    """A step of 4 um in 15 ms by a constant acceleration, then the same to stop, through a loop and on the stage."""
    rest_s, step_s = 0.05, 0.015
    target_um = step_profile_um(4.0, 16.0 / step_s**2, rest_s=2.0 * rest_s)[:: round(period_s / STEP_S)]
    loop, arrival = loop_of(model(), preview_s, period_s), Arrival(tolerance_um)
    motion, voltages, arrived = StageMotion(arrival, None), [], []
    for k, wanted_um in enumerate(target_um):
        loop.set_target(float(wanted_um))
        voltages.append(loop.tick(period_s))
        motion.after_tick(loop, k * period_s)
        arrived.append(arrival.has_arrived)
    off_um = np.abs(truth().displacement_um(period_s, np.array(voltages)) - 4.0)
    away = np.flatnonzero(off_um > tolerance_um)[-1] + 1
    not_yet = np.flatnonzero(~np.array(arrived))[-1] + 1
    ends_s = 2.0 * rest_s + step_s + preview_s
    ringing_um = float(np.max(off_um[round(ends_s / period_s) + 1 :]))
    return SteppedTo(float(not_yet * period_s - ends_s), float(away * period_s - ends_s), ringing_um)


def main() -> None:
    """Print each row with its figure."""
    known = model()
    print(f"loop at {1.0 / PERIOD_S:g} Hz, preview {1e3 * PREVIEW_S:g} ms, stage in code of its own:")
    for frequency_hz in (1.0, 10.0, 30.0):
        late, now = (raster_percent(known, frequency_hz, preview_s) for preview_s in (PREVIEW_S, 0.0))
        alone = raster_percent(replace(known, effects=()), frequency_hz, 0.0)
        print(f"  {frequency_hz:g} Hz: NRMSE {late:.3g} %, without a preview {now:.3g} %,")
        print(f"    of hysteresis and creep alone {alone:.3g} %")
    elements = replace(table_1(), effects=known.effects)
    print(f"tick with amplifier, resonance, delay and 10 elements: {tick_us(elements):.2f} us (bar 5 us)")
    for period_s in (PERIOD_S, 0.5 * PERIOD_S):
        for tolerance_um in (0.04, 0.02, 0.004):
            step = stepped(tolerance_um, period_s)
            print(f"step of 4 um in 15 ms at {1.0 / period_s:g} Hz, within {1e3 * tolerance_um:g} nm: arrives")
            print(f"  {1e3 * step.measured_s:.1f} ms after its end, predicted {1e3 * step.predicted_s:.1f} ms;")
            print(f"  it rings by {1e3 * step.ringing_um:.1f} nm (bar 4 nm)")


if __name__ == "__main__":
    main()
