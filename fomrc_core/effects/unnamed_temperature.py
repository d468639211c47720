"""What no cause explains and what follows the temperature: a few terms, and no name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.effect import Parameter
from fomrc_core.effects.base.signal_terms import SignalTerms, column_terms, parameters_of
from fomrc_core.effects.base.term_scales import TermScales


@dataclass(frozen=True)
class UnnamedTemperature(SignalTerms):
    """Displacement plus terms of the temperature, of what it changed of late, and of products with the displacement."""

    name: ClassVar[str] = "unnamed_temperature"
    order: ClassVar[float] = 1020.0
    parameters: ClassVar[tuple[Parameter, ...]] = parameters_of("degC", "the signal whose change is meant")
    covariate: ClassVar[Covariate | None] = Covariate.TEMPERATURE
    meaning: ClassVar[str] = "The temperature acts, and not as any cause in the library does; these terms follow it."
    signature: ClassVar[str] = "what is left follows the temperature, and no cause follows it"
    experiment: ClassVar[str] = "the same drive at two steady temperatures, and while it changes"
    inverse_note: ClassVar[str] = (
        "inverted where the temperature is known while running and its terms are less steep than the displacement"
    )
    signal_words: ClassVar[str] = "the temperature"

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedTemperature | None:
        """Return the terms of the column; None where it was not recorded in every record, or stands still."""
        if Covariate.TEMPERATURE not in scales.columns:
            return None
        found: UnnamedTemperature = cls.offering(scales, column_terms(scales), *scales.columns[Covariate.TEMPERATURE])
        return found
