"""A sensor beside the live loop with a preview: what it takes off, and what its failures do to the voltage.

    python -m benchmarks.fast_sensor

The model is 5 % off its stage, the sensor has 1 nm of noise, the target rests at 2 um or swings about there at 5 Hz.
The sensor fails from 0.6 to 0.8 s. Steps of the voltage are told beside those of the same loop with a sound sensor, and
beside what the slew limit allows in a period.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.fast_loop import NOISE_UM, PERIOD_S, PREVIEW_S, loop_of
from benchmarks.fast_scans import model
from fomrc_core.control.feedback import Feedback
from fomrc_core.control.stage_motion import StageMotion

N_TICKS, LOAD_AT, FAILS_FROM, FAILS_TO = 1000, 600, 600, 800
LOAD_UM = 0.05
BANDWIDTH_HZ = 20.0
# A resonance of 300 Hz damped by 0.02 bears 6 Hz of bandwidth: this one bears more than the 20 Hz.
RESONANCE = {"frequency_hz": 900.0, "damping_ratio": 0.2}
_SLEW_V_PER_S = 100.0

Sensor = Callable[[int, float], float | None]
FAILURES: dict[str, Sensor] = {
    "cut": lambda k, true_um: None,
    "not a number": lambda k, true_um: math.nan,
    "stuck": lambda k, true_um: 2.0,
    "spikes": lambda k, true_um: true_um + (1.0 if k % 2 else -1.0),
}


@dataclass(frozen=True, eq=False)
class Driven:
    """What a loop with a sensor did.

    Attributes:
        voltage_v: of each tick [V].
        off_um: stage less target [um].
        is_closed: whether the sensor was believed at each tick.
    """

    voltage_v: np.ndarray
    off_um: np.ndarray
    is_closed: np.ndarray

    @property
    def largest_step_v(self) -> float:
        """Largest change of the voltage from tick to tick once the target is followed [V]."""
        return float(np.max(np.abs(np.diff(self.voltage_v[LOAD_AT - 100 :]))))

    @property
    def opened_after(self) -> int:
        """Periods from the first measurement that fails until the loop is open, rounded up."""
        return int(np.argmin(self.is_closed[FAILS_FROM:])) if not np.all(self.is_closed[FAILS_FROM:]) else N_TICKS


def driven(target_um: np.ndarray, sensor: Sensor, load_um: float = 0.0) -> Driven:
    """Drive a loop of a model 5 % off; a load from tick 600 on, a sensor that says what it likes from then to 800."""
    known = model(mechanical_resonance=RESONANCE)
    stage = replace(known, kappa_um_per_v=1.05 * known.kappa_um_per_v)
    loop, feedback = loop_of(known, PREVIEW_S), Feedback(BANDWIDTH_HZ, PERIOD_S)
    loop.settings = replace(loop.settings, limits=replace(loop.settings.limits, slew_v_per_s=_SLEW_V_PER_S))
    motion, state = StageMotion(None, feedback), stage.initial_state()
    noise_um = np.random.default_rng(1).normal(0.0, NOISE_UM, N_TICKS)
    n_late = round(PREVIEW_S / PERIOD_S)
    voltages, off_um, closed = [], [], []
    for k in range(N_TICKS):
        loop.set_target(float(target_um[k]))
        motion.before_tick(loop, k * PERIOD_S)
        voltages.append(loop.tick(PERIOD_S))
        motion.after_tick(loop, k * PERIOD_S)
        true_um = stage.advance(state, voltages[-1], PERIOD_S) + (load_um if k >= LOAD_AT else 0.0)
        seen_um = true_um + noise_um[k]
        said = sensor(k, seen_um) if FAILS_FROM <= k < FAILS_TO else seen_um
        if said is not None:
            feedback.take((k + 0.5) * PERIOD_S, said)
        closed.append(feedback.is_closed)
        off_um.append(true_um - target_um[max(k - n_late, 0)])
    return Driven(np.array(voltages), np.array(off_um), np.array(closed))


def resting_um() -> np.ndarray:
    """A jump to 2 um."""
    return np.where(np.arange(N_TICKS) >= 50, 2.0, 0.0)


def swinging_um() -> np.ndarray:
    """A jump to 2 um, about which it then swings."""
    return resting_um() * (1.0 + 0.15 * np.sin(2.0 * np.pi * 5.0 * PERIOD_S * np.arange(N_TICKS)))


def sound(k: int, seen_um: float) -> float:
    """What a sensor says that does not fail."""
    return seen_um


def main() -> None:
    """Print each bar with its figure."""
    loaded = driven(resting_um(), sound, LOAD_UM).off_um
    print(
        f"feedback of {BANDWIDTH_HZ:g} Hz, model 5 % off, load of {1e3 * LOAD_UM:g} nm: {1e3 * loaded[LOAD_AT]:.1f} nm"
    )
    print(f"  at once, {1e3 * float(np.sqrt(np.mean(loaded[650:700] ** 2))):.2f} nm rms from 50 ms after it on")
    print(f"  (bar {3e3 * NOISE_UM:g} nm)")
    allowed_v, without_v = _SLEW_V_PER_S * PERIOD_S, driven(swinging_um(), sound).largest_step_v
    print(
        f"largest step of the voltage in a period, the target swinging: {1e3 * without_v:.2f} mV with a sound sensor;"
    )
    print(f"  the slew limit allows {1e3 * allowed_v:g} mV")
    for name, sensor in FAILURES.items():
        failed = driven(swinging_um(), sensor)
        opened = f"open {failed.opened_after} periods after it began"
        print(f"  {name}: {1e3 * failed.largest_step_v:.2f} mV, {opened}")


if __name__ == "__main__":
    main()
