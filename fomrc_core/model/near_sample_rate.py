"""What rings near the sample rate: no voltage straight between samples holds it there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fomrc_core.effects import Effect, Stage

# A mode beyond this share of the sample rate is set ringing by what a voltage at the samples cannot give: a step of
# 15 ms leaves 0.06 % of itself up to here, 0.1 to 0.3 % at four tenths, 0.6 % at half of it, damped by a hundredth.
_RINGS_FROM, _RINGS_TO, _RINGS_ABOVE = 0.35, 1.25, 2.0
# Of the sample rate: slower swings hardly feel what happens within a sample, and nearer to half of it voltages cannot
# tell a swing from its image.
_STRUCK_FROM, _STRUCK_TO = 0.05, 0.45


def ringing_notes(effects: Iterable[Effect], step_s: float, remedy: str) -> list[str]:
    """Return a line for each effect that rings near the sample rate.

    Args:
        effects: of the model.
        step_s: distance of the samples [s].
        remedy: option or parameter that sets the rate, named before the rate that would do.
    """
    rate_hz = 1.0 / step_s
    frequency_hz = rate_hz * np.linspace(_RINGS_FROM, _RINGS_TO, 2001)
    notes = []
    for effect in effects:
        gain = effect.response(frequency_hz)
        if gain is None or np.max(np.abs(gain)) < _RINGS_ABOVE:
            continue
        peak = int(np.argmax(np.abs(gain)))
        if peak == 0:
            continue  # the flank of one that is held
        at_hz = float(frequency_hz[peak])
        notes.append(
            f"{effect.name} rings at {at_hz:.4g} Hz, near the sample rate of {rate_hz:.4g} Hz: between samples "
            f"it is not held; {remedy} {at_hz / _RINGS_FROM:.3g} or more holds it"
        )
    return notes


def is_struck_within_samples(effects: Iterable[Effect], step_s: float) -> bool:
    """Return whether a stage swings so fast that bends of hysteresis within a sample strike it, and can yet be held.

    Args:
        effects: of the model.
        step_s: distance of the samples [s].
    """
    frequency_hz = np.linspace(_STRUCK_FROM, _STRUCK_TO, 2001) / step_s
    gains = (effect.response(frequency_hz) for effect in effects if effect.stage is Stage.MECHANICAL and effect.rings)
    return any(gain is not None and float(np.max(np.abs(gain))) >= _RINGS_ABOVE for gain in gains)
