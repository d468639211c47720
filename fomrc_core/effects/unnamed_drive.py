"""What no cause explains and what acts on the drive before hysteresis: a few terms, and no name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.effect import Stage
from fomrc_core.effects.base.linear_terms import LinearTerms, offered_terms
from fomrc_core.effects.base.term_scales import TermScales

_DAMPING_RATIOS = (0.3,)  # of what is offered: its band is wide, and a fit moves it


@dataclass(frozen=True)
class UnnamedDrive(LinearTerms):
    """Drive plus what it remembers and what swings in it, before hysteresis."""

    name: ClassVar[str] = "unnamed_drive"
    stage: ClassVar[Stage] = Stage.DRIVE
    meaning: ClassVar[str] = (
        "Something between command and ceramic remembers or swings, and not as any cause in the library does."
    )
    signature: ClassVar[str] = "what is left follows the past of the drive, hysteresis with it, and no cause follows it"
    experiment: ClassVar[str] = "record the voltage at the ceramic beside the command"
    inverse_note: ClassVar[str] = "inverted where part of it comes through at once and its inverse does not grow"
    signal_words: ClassVar[str] = "the drive"

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedDrive:
        """Return memories of all lengths, and swings that are well damped."""
        return cls(*offered_terms(scales.memories_s, scales.swings_s, _DAMPING_RATIOS))
