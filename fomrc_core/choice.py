"""Which contender is accepted, which cannot be told from it, and which come near it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fomrc_core.acceptance import loses_to
from fomrc_core.bench import Bench, held_residuals
from fomrc_core.chain import Chain, PreparedRecord
from fomrc_core.contender import Contender
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.noise import autocorrelation_inflation
from fomrc_core.refit import Refit

SURE = 10.0  # difference in log likelihood that settles it
_SIGNIFICANCE = 0.01
_NEARLY, _HARDLY = 0.35, 0.15  # in the logarithm of the mean squared error
_TIE_P_VALUE = 0.05
_LEAST_LEARNT = 0.003


def is_accepted(contender: Contender, n_causes: int) -> bool:
    """Return whether a contender is a finding, among this number of causes tried."""
    return (
        contender.is_plausible
        and contender.is_told
        and contender.train_log_gain >= _LEAST_LEARNT  # what teaches nothing has only shaken the base
        and contender.score.p_value < _SIGNIFICANCE / n_causes
        and contender.score.is_worthwhile()
    )


def likelier(winner: Contender, contenders: list[Contender], bench: Bench, n_causes: int) -> Contender:
    """Return the contender that is surely likelier with no more parameters, unless held-out data speak up against it.

    How well the base itself carries over to held-out data differs from fit to fit: a little after a rich drive, much
    after a poor one, so that the two gains are weighed against each other.
    """
    for other in contenders:
        if other is winner or other.is_bound or other.cause == AsymmetricHysteresis.name:
            continue
        learnt = other.train_log_gain - winner.train_log_gain
        lost = winner.held_gain - other.held_gain
        if other.n_free > winner.n_free or learnt < 0.0 or lost > max(learnt, _HARDLY):
            continue
        if is_accepted(other, n_causes) and sure_gain(winner.fitted, other.fitted, bench) > SURE:
            return other
    return winner


def ties_of(winner: Contender, contenders: list[Contender], bench: Bench) -> list[Contender]:
    """Return the contenders that neither training nor held-out data tell from the winner."""
    n_effective = _n_effective(winner.fitted, bench)
    tied = []
    for other in contenders:
        if other is winner:
            continue
        if not other.score.is_worthwhile() or not other.is_plausible:
            continue
        loss = n_effective * math.log(other.fitted.squared_error / winner.fitted.squared_error)
        same_shape = len(other.held) == len(winner.held) and all(
            a.size == b.size for a, b in zip(other.held, winner.held, strict=True)
        )
        if loss < SURE and (not same_shape or loses_to(list(winner.held), list(other.held)) > _TIE_P_VALUE):
            tied.append(other)
    return tied


def still_tied(chain: Chain, tied: Sequence[Contender], bench: Bench) -> list[Contender]:
    """Return those of the tied contenders that another record does not tell apart either.

    What belongs to single records is scored on blocks of its own; once it has been fitted to the held-out record
    too, what belongs to the actuator can be compared with it there.
    """
    if not bench.is_apart:
        return list(tied)
    held = held_residuals(chain, bench.held)
    return [other for other in tied if other.is_bound or loses_to(held, list(other.held)) > _TIE_P_VALUE]


def rivals_of(winner: Contender, contenders: list[Contender]) -> tuple[Contender, ...]:
    """Return the contenders that did nearly as well."""
    return tuple(
        other
        for other in contenders
        if other is not winner
        and other.is_plausible
        and not other.is_bound
        and other.score.is_worthwhile()
        and other.score.log_gain > winner.score.log_gain - _NEARLY
        and other.train_log_gain > winner.train_log_gain - _NEARLY
    )


def sure_gain(final: Refit, other: Refit, bench: Bench) -> float:
    """Return the gain of another fit in log likelihood, its samples counted as independent ones."""
    return _n_effective(other, bench) * math.log(final.squared_error / other.squared_error)


def _n_effective(fitted: Refit, bench: Bench) -> float:
    return bench.n_used / residual_inflation(fitted, bench.train)


def residual_inflation(final: Refit, records: tuple[PreparedRecord, ...]) -> float:
    """Return by how much correlation of what is left widens standard errors."""
    return max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(final.residual, records, strict=True))
