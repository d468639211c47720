"""One acceptance of a search."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.fitting.trial_model import TrialModel


@dataclass(frozen=True, eq=False)
class Step:
    """One acceptance.

    Attributes:
        before: the model before it.
        accepted: the candidate.
        tied: causes it could not be told from.
        tied_models: the models with those.
        rivals: candidates that did nearly as well while other causes were still unexplained.
        margin: by how much it was likelier than the next, in log likelihood, the lesser of when it was accepted and of
            the end [1]; not a number where it was not compared.
    """

    before: TrialModel
    accepted: Candidate
    tied: tuple[str, ...]
    tied_models: tuple[TrialModel, ...]
    rivals: tuple[Candidate, ...] = ()
    margin: float = math.nan

    def tied_with(self, tied: list[Candidate]) -> Step:
        """Return the step with these ties."""
        return replace(self, tied=tuple(c.cause for c in tied), tied_models=tuple(c.fitted.model for c in tied))

    def tied_but_for(self, found: frozenset[str]) -> Step:
        """Return the step without ties with causes that were found as well: both act."""
        kept = [(n, m) for n, m in zip(self.tied, self.tied_models, strict=True) if n not in found]
        return replace(self, tied=tuple(n for n, _ in kept), tied_models=tuple(m for _, m in kept))
