"""One acceptance of a search."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

_WITHOUT = 6  # iterations of a fit without one of the causes


@dataclass(frozen=True, eq=False)
class Step:
    """One acceptance.

    Attributes:
        before: the model before it.
        accepted: the candidate.
        tied: causes it could not be told from.
        tied_models: the models with those.
        rivals: candidates that did nearly as well while other causes were still unexplained.
        margin: by how much it is likelier than the next, in log likelihood [1]: at the end, beside all others, where it
            was looked at again, else when it was accepted; not a number where it was not compared.
        whitened_margin: the same where the noise is whitened; not a number where it was not compared either.
    """

    before: TrialModel
    accepted: Candidate
    tied: tuple[str, ...]
    tied_models: tuple[TrialModel, ...]
    rivals: tuple[Candidate, ...] = ()
    margin: float = math.nan
    whitened_margin: float = math.nan

    @property
    def is_beaten(self) -> bool:
        """Whether another cause, or none at all, is surely likelier beside all the others that were found.

        That other one is no finding either, or it would have taken the place: a model that is wrong is bent by both,
        and neither name rests on anything. One that is told as tied says so itself; what belongs to single records, or
        cannot be exchanged for another, is weighed when it is accepted, others still hidden, and not again.
        """
        is_looked_at_again = cause_classes()[self.accepted.cause].is_exchangeable and not self.accepted.is_bound
        return self.margin < -SURE and not self.tied and is_looked_at_again

    def left_out_of(self, model: TrialModel, split: DataSplit, executor: Executor | None = None) -> Refit:
        """Return the joint refit of a model without this cause, all others staying."""
        return refit(
            model.as_before(self.before, self.accepted.cause), split.train, n_iterations=_WITHOUT, executor=executor
        )

    def uncompared(self) -> Step:
        """Return the step without margins: what it was likelier than, others still hidden, says nothing beside them."""
        return replace(self, margin=math.nan, whitened_margin=math.nan)

    def tied_with(self, tied: list[Candidate]) -> Step:
        """Return the step with these ties."""
        return replace(self, tied=tuple(c.cause for c in tied), tied_models=tuple(c.fitted.model for c in tied))

    def tied_but_for(self, found: frozenset[str]) -> Step:
        """Return the step without ties with causes that were found as well: both act."""
        kept = [(n, m) for n, m in zip(self.tied, self.tied_models, strict=True) if n not in found]
        return replace(self, tied=tuple(n for n, _ in kept), tied_models=tuple(m for _, m in kept))
