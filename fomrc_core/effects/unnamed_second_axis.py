"""What no cause explains and what follows the second axis: a few terms, and no name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.effect import Parameter
from fomrc_core.effects.base.signal_terms import SignalTerms, column_terms, parameters_of
from fomrc_core.effects.base.term_scales import TermScales


@dataclass(frozen=True)
class UnnamedSecondAxis(SignalTerms):
    """Displacement plus terms of the second axis, of what it changed of late, and of products with the displacement."""

    name: ClassVar[str] = "unnamed_second_axis"
    order: ClassVar[float] = 1030.0
    parameters: ClassVar[tuple[Parameter, ...]] = parameters_of("um or V", "the signal whose change is meant")
    covariate: ClassVar[Covariate | None] = Covariate.SECOND_AXIS
    meaning: ClassVar[str] = (
        "The second axis acts on this one, and not as any cause in the library does; these terms follow it."
    )
    signature: ClassVar[str] = "what is left follows the second axis, and no cause follows it"
    experiment: ClassVar[str] = "move the second axis alone, slowly and quickly, at two places of this one"
    inverse_note: ClassVar[str] = (
        "inverted where the second axis is known while running and its terms are less steep than the displacement"
    )
    signal_words: ClassVar[str] = "the second axis"

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedSecondAxis | None:
        """Return the terms of the column; None where it was not recorded in every record, or stands still."""
        if Covariate.SECOND_AXIS not in scales.columns:
            return None
        found: UnnamedSecondAxis = cls.offering(scales, column_terms(scales), *scales.columns[Covariate.SECOND_AXIS])
        return found
