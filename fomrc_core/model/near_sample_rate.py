"""What rings near the sample rate: no voltage straight between samples holds it there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fomrc_core.effects import Effect

# A mode beyond this share of the sample rate is set ringing by the corners of a voltage straight between samples, whose
# images lie around the sample rate: twenty times what the samples hold, at a quarter of it and damping of a hundredth.
_RINGS_FROM, _RINGS_TO, _RINGS_ABOVE = 0.25, 1.25, 2.0


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
        at_hz = float(frequency_hz[int(np.argmax(np.abs(gain)))])
        notes.append(
            f"{effect.name} rings at {at_hz:.4g} Hz, near the sample rate of {rate_hz:.4g} Hz: between samples "
            f"it is not held; {remedy} {at_hz / _RINGS_FROM:.3g} or more holds it"
        )
    return notes
