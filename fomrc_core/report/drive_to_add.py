"""Which drive to record next: what recordings lack, as the line of ``fomrc excite`` that adds it, within limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fomrc_core.errors import ParameterError

_N_CYCLES = 8  # of a triangle that falls from the whole range to nothing
_DWELLS = 6  # levels of a staircase of rests
_REST_SHARE = 0.5  # of a rest beside all that was recorded: creep is told by decades of time
_FASTER = 30.0  # times the slowest motion there is
_USUAL_TIME_S = 120.0


@dataclass(frozen=True)
class DriveLimits:
    """What a drive must keep to.

    Args:
        voltage_v: largest voltage, of either sign [V].
        rate_v_per_s: fastest change [V/s].
        time_s: longest duration [s].

    Raises:
        ParameterError: one that is not positive.
    """

    voltage_v: float
    rate_v_per_s: float = math.inf
    time_s: float = math.inf

    def __post_init__(self) -> None:
        for name in ("voltage_v", "rate_v_per_s", "time_s"):
            if not getattr(self, name) > 0.0:
                where = f"largest {name}, --max-{name.split('_')[0]}"
                raise ParameterError("not positive", where=where, value=getattr(self, name), allowed="more than 0")


@dataclass(frozen=True)
class Addition:
    """A drive to record.

    Attributes:
        why: what it adds.
        command: that makes it; "" where the limits leave none.
    """

    why: str
    command: str

    def __str__(self) -> str:
        return f"{self.command or 'nothing within the limits'}   # {self.why}"


def additions(
    *,
    low_v: float,
    high_v: float,
    rate_hz: float,
    duration_s: float,
    slow_v_per_s: float,
    needs_loops: bool,
    needs_rests: bool,
    needs_rates: bool,
    needs_start: bool,
    needs_repeats: bool,
    limits: DriveLimits,
) -> tuple[Addition, ...]:
    """Return drives that add what is lacking.

    Args:
        low_v: lowest voltage recorded [V].
        high_v: highest voltage recorded [V].
        rate_hz: sample rate [Hz].
        duration_s: how long was recorded [s].
        slow_v_per_s: slow rate of what was recorded [V/s].
        needs_loops: whether loops of more widths and means are wanted.
        needs_rests: whether rests are wanted.
        needs_rates: whether more rates are wanted.
        needs_start: whether a known beginning is wanted.
        needs_repeats: whether a repeat is wanted.
        limits: to keep to.
    """
    # Many arguments: what there is and what is lacking, each given by name.
    low, high = max(low_v, -limits.voltage_v), min(high_v, limits.voltage_v)
    middle, swing = 0.5 * (low + high), 0.5 * (high - low)
    time_s = min(limits.time_s, max(duration_s, _USUAL_TIME_S))
    about = f" --offset {middle:.4g}" if abs(middle) > 0.01 * swing else ""
    at = f" --rate {rate_hz:.6g}"
    found: list[Addition] = []

    def add(why: str, command: str) -> None:
        found.append(Addition(why, f"fomrc excite {command}{at} --output {command.split()[0]}.csv" if command else ""))

    possible = swing > 0.0
    if needs_start:
        add("begins relaxed, so that the past is known; play it before each recording", _relax(swing, about, limits))
    if needs_loops:
        path_v = 2.0 * swing * (_N_CYCLES + 1)  # amplitudes fall evenly
        slope = min(max(slow_v_per_s, path_v / time_s), limits.rate_v_per_s)
        fits = possible and path_v / slope <= limits.time_s
        command = f"triangle --amplitude {swing:.4g}{about} --slope {slope:.4g} --cycles {_N_CYCLES}"
        add("loops of many widths: elements that are alike now are told apart", command if fits else "")
    if needs_rests:
        dwell_s = min(_REST_SHARE * duration_s, time_s / _DWELLS)
        levels = ",".join(f"{middle + share * swing:.4g}" for share in (0.6, 1.0, 0.2, -0.4, -1.0, 0.0))
        # a step is as steep as the amplifier lets it be
        fits = possible and math.isinf(limits.rate_v_per_s)
        command = f"steps --levels={levels} --dwell {dwell_s:.4g}"
        add("rests after steps: creep apart from hysteresis", command if fits else "")
    if needs_rates or needs_repeats:
        amplitude = 0.3 * swing
        top_hz = min(0.2 * rate_hz, _FASTER * slow_v_per_s / max(4.0 * swing, 1e-300), _top_hz(amplitude, limits))
        period_s = max(20.0 / max(top_hz, 1e-300), 4.0 / rate_hz)
        fits = possible and top_hz > 0.0 and 4.0 * period_s <= limits.time_s
        command = f"multisine --amplitude {amplitude:.4g}{about} --lowest {1.0 / period_s:.4g} --highest {top_hz:.4g} "
        command += f"--period {period_s:.4g} --periods 4"
        why = "many rates, repeated" if needs_rates else "a drive that repeats"
        add(f"{why}: lags apart from creep, noise apart from what a model misses", command if fits else "")
    return tuple(found)


def _relax(swing: float, about: str, limits: DriveLimits) -> str:
    amplitude = min(swing, limits.voltage_v)
    frequency_hz = min(1.0, limits.rate_v_per_s / max(6.3 * amplitude, 1e-300))
    return f"relax --amplitude {amplitude:.4g}{about} --frequency {frequency_hz:.4g}" if amplitude > 0.0 else ""


def _top_hz(amplitude_v: float, limits: DriveLimits) -> float:
    # a multisine of this amplitude moves at most as fast as one sine of its highest frequency
    return limits.rate_v_per_s / max(6.3 * amplitude_v, 1e-300)
