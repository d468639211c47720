"""What no cause explains and what swings with the displacement: a few terms, and no name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Stage
from fomrc_core.effects.base.linear_terms import LinearTerms, offered_terms
from fomrc_core.effects.base.term_scales import TermScales

_DAMPING_RATIOS = (0.3, 0.1)  # of what is offered: a fit moves it
_WHERE_IT_RINGS = (0.1, 0.03)  # the same where what is left has most power: a light swing answers to little else
_ABOUT = np.linspace(0.85, 1.15, 11)  # of a peak's frequency, known to a bin of a spectrum: within a light swing's band


@dataclass(frozen=True)
class UnnamedRinging(LinearTerms):
    """Displacement plus what swings in it."""

    name: ClassVar[str] = "unnamed_ringing"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    meaning: ClassVar[str] = "Something that the stage moves swings, and not as any cause in the library does."
    signature: ClassVar[str] = "what is left swings after each step of the displacement, and no cause follows it"
    experiment: ClassVar[str] = (
        "small steps about two places, and with a known mass on the stage: what swings with it gets slower"
    )
    inverse_note: ClassVar[str] = "inverted where part of it comes through at once and its inverse does not grow"
    signal_words: ClassVar[str] = "the displacement"

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedRinging:
        """Return swings of all periods, well damped, and lightly where what is left rings."""
        everywhere = offered_terms((), scales.swings_s, _DAMPING_RATIOS)
        if not scales.ringing_hz:
            return cls(*everywhere)
        periods_s = [1.0 / (share * f) for f in scales.ringing_hz for share in _ABOUT]
        ringing = offered_terms((), periods_s, _WHERE_IT_RINGS)
        return cls(*(own + more for own, more in zip(everywhere, ringing, strict=True)))
