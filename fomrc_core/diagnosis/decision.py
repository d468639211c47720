"""Which of several candidates is taken, which cannot be told from it, and which come near it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.acceptance import HARDLY, NEARLY, SIGNIFICANCE, is_accepted
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score, loses_to
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.wander import wander_beside
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.noise import autocorrelation_inflation
from fomrc_core.records.whitening import burg

_MOST_RIVALS = 4  # each costs a fit at every later finding
_TIE_P_VALUE = 0.05  # of the hypothesis that two are equally good: the usual level
_MOST_ORDER = 16  # of the process that noise is: a sensor's filter and a slow wander
_AS_NOISE = 1.44  # times the noise's power: a fifth of its rms, what noise of repeats may be off


def likelier(winner: Candidate, candidates: list[Candidate], split: DataSplit, n_causes: int) -> Candidate:
    """Return the candidate that is surely likelier, unless held-out data speak up against it.

    It may have no more parameters, but for those in which it generalizes the other.

    How well the base itself carries over to held-out data differs from fit to fit: a little after a rich drive, much
    after a poor one, so that the two gains are weighed against each other.
    """
    for other in candidates:
        if other is winner or other.is_bound or not cause_classes()[other.cause].is_exchangeable:
            continue
        if winner.is_bound:
            if is_accepted(other, n_causes) and explains_events(other, winner, split):
                return other
            continue
        learnt = other.train_log_gain - winner.train_log_gain
        lost = winner.held_gain - other.held_gain
        generalizes = cause_classes()[other.cause].generalizes == winner.cause
        is_richer = other.n_free > winner.n_free and not generalizes
        if is_richer or learnt < 0.0 or lost > max(learnt, HARDLY):
            continue
        if generalizes and not is_surely_better(other, winner):
            continue
        # what training does not tell apart data that neither was fitted to may: twice as much left there is no noise
        is_told_held = -lost > NEARLY and _is_same_data(winner, other)
        if is_accepted(other, n_causes) and (is_told_held or sure_gain(winner.fitted, other.fitted, split) > SURE):
            return other
    return winner


def explains_events(other: Candidate, winner: Candidate, split: DataSplit) -> bool:
    """Return whether what belongs to the actuator leaves surely less than what befell records.

    It has no place in a record to choose. The other was scored on blocks of the records it was fitted to: of the two
    training speaks alone, and each parameter costs what it gains by itself (Schwarz, 1978). Plays bend to anything.
    """
    is_surely_less = sure_gain(winner.fitted, other.fitted, split) > SURE
    return is_surely_less and not other.brings_plays and is_likelier_with_fewer(other, winner, split)


def is_likelier_with_fewer(other: Candidate, winner: Candidate, split: DataSplit) -> bool:
    """Return whether training surely speaks for a candidate, each parameter costing what it gains (Schwarz, 1978)."""
    cost = 2.0 * _cost_of_parameters(winner, other, _n_effective(other.fitted, split))
    return sure_gain(winner.fitted, other.fitted, split) - cost > SURE


def is_surely_better(other: Candidate, winner: Candidate) -> bool:
    """Return whether what a candidate adds to another, which is a special case of it, would be a finding in itself.

    In training it cannot do worse, whatever the truth; data it was not fitted to speak for what it adds. Where
    something else hides it there, training speaks as well, if it surely takes half of what the other leaves, which no
    parameter takes by itself, and held-out data gain at least something.
    """
    if not _is_same_data(winner, other):
        return False
    added = held_out_score(list(winner.held), list(other.held))
    if added.p_value < SIGNIFICANCE and added.is_worthwhile():
        return True
    learnt = math.log(winner.fitted.squared_error / other.fitted.squared_error)
    n_independent = sum(left.size / autocorrelation_inflation(left) for left in other.fitted.residual)
    return learnt > NEARLY and 0.5 * n_independent * learnt > SURE and added.log_gain > 0.0


def ties_of(winner: Candidate, candidates: Sequence[Candidate], split: DataSplit) -> list[Candidate]:
    """Return the candidates that neither training nor held-out data tell from the winner.

    Where the winner leaves no more than noise its colour is known, and samples are compared that are whitened by it;
    of two models that both leave something else the likelier one says less.
    """
    n_effective = _n_effective(winner.fitted, split)
    leaves_noise = _leaves_noise(winner, split)
    tied = []
    for other in candidates:
        if other.cause == winner.cause:
            continue
        if not other.score.is_worthwhile() or not other.is_plausible:
            continue
        if cause_classes()[other.cause].generalizes == winner.cause:
            continue  # of course it does as well
        loss = n_effective * math.log(other.fitted.squared_error / winner.fitted.squared_error)
        is_same_data = _is_same_data(winner, other)
        if not is_same_data:
            loss += 2.0 * _cost_of_parameters(winner, other, n_effective)
        if loss >= SURE:
            continue
        if leaves_noise and likelier_by(winner, other.fitted.residual, other.held, split) > SURE:
            continue
        # of plays, which bend to whatever another gets wrong, data they were not fitted to speak
        asks_held = other.brings_plays or not leaves_noise
        if asks_held and is_same_data and loses_to(list(winner.held), list(other.held)) <= _TIE_P_VALUE:
            continue
        tied.append(other)
    return tied


def is_likelier_than(own: Candidate, other: Candidate, split: DataSplit) -> bool:
    """Return whether another candidate leaves noise and is surely likelier once that is whitened.

    Training and held-out data speak together, and each parameter more costs what it gains by itself (Schwarz, 1978).
    Of two that both leave something else the likelier one says less, and of plays of its own held-out data speak, for
    they bend to whatever the others get wrong. Twice as much left of the data that neither was fitted to is no noise,
    however it is whitened.
    """
    if other.brings_plays or not _leaves_noise(other, split) or not _is_same_data(own, other):
        return False
    if held_out_score(list(other.held), list(own.held)).log_gain > NEARLY:
        return False
    cost = _cost_of_parameters(own, other, _n_effective(other.fitted, split))
    return likelier_by(other, own.fitted.residual, own.held, split) > SURE + max(cost, 0.0)


def _leaves_noise(candidate: Candidate, split: DataSplit) -> bool:
    return candidate.fitted.squared_error < _AS_NOISE * split.noise_um2


def _behind(candidate: Candidate, other: Candidate, split: DataSplit) -> float:
    """Return by how much a candidate is behind another in log likelihood [1], the noise whitened as either leaves it.

    The mean of the two, so that no two are each likelier than the other.
    """
    if candidate is other:
        return 0.0
    ahead = likelier_by(candidate, other.fitted.residual, other.held, split)
    return 0.5 * (likelier_by(other, candidate.fitted.residual, candidate.held, split) - ahead)


def _compared_with(winner: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the plausible candidates of another name, which the winner's is not a special case of.

    An event that took the place of plays stands among them as it was before: it is no rival of its own.
    """
    plausible = [other for other in candidates if other.is_plausible and other.cause != winner.cause]
    return [other for other in plausible if cause_classes()[other.cause].generalizes != winner.cause]


def margin_of(winner: Candidate, candidates: Sequence[Candidate], split: DataSplit) -> float:
    """Return by how much the winner is likelier than the next plausible candidate, in log likelihood [1].

    That nothing acts at all is a candidate as well. Training and held-out data speak together, each sample counted as
    often as it is independent of its neighbours. Where the two were not scored on the same data training speaks alone,
    and each parameter costs what it gains there by itself (Schwarz, 1978).
    """
    n_train = _n_effective(winner.fitted, split)
    n_held = sum(mine.size / autocorrelation_inflation(mine) for mine in winner.held)
    margins = [0.5 * n_train * winner.train_log_gain + 0.5 * n_held * winner.score.log_gain]
    for other in _compared_with(winner, candidates):
        gained = 0.5 * n_train * math.log(other.fitted.squared_error / winner.fitted.squared_error)
        if not _is_same_data(winner, other):
            margins.append(gained + _cost_of_parameters(winner, other, n_train))
            continue
        for mine, its in zip(winner.held, other.held, strict=True):
            independent = mine.size / autocorrelation_inflation(mine)
            gained += 0.5 * independent * math.log(float(its @ its) / float(mine @ mine))
        margins.append(gained)
    return min(margins)


def _is_same_data(winner: Candidate, other: Candidate) -> bool:
    """Return whether two candidates were scored on the same held-out data."""
    return [mine.size for mine in winner.held] == [its.size for its in other.held]


def _cost_of_parameters(winner: Candidate, other: Candidate, n_effective: float) -> float:
    """Return what the other one's parameters gain more by themselves in training, in log likelihood [1]."""
    return 0.5 * math.log(max(n_effective, 1.0)) * (other.n_parameters - winner.n_parameters)


def whitened_margin_of(winner: Candidate, candidates: Sequence[Candidate], split: DataSplit) -> float:
    """Return the margin where the noise is whitened, in log likelihood [1].

    The noise is what the winner leaves of the training data, a random walk beside an autoregressive process, and each
    candidate is as likely as what it leaves is small once that is whitened: noise that wanders hides nothing of what is
    quick, and what wanders as it does says nothing.
    """
    margins = [likelier_by(winner, winner.before, winner.held_before, split)]
    for other in _compared_with(winner, candidates):
        margins.append(likelier_by(winner, other.fitted.residual, other.held, split))
    return min(margins)


def likelier_by(winner: Candidate, train_um: Sequence[Array], held_um: Sequence[Array], split: DataSplit) -> float:
    """Return by how much a candidate is likelier than another where the noise is whitened, in log likelihood [1].

    Args:
        winner: the candidate, from what it leaves of the training data the noise is known.
        train_um: what the other one leaves of the training records [um].
        held_um: the same of the held-out data.
        split: records.
    """
    own_um, others_um = (
        [v[r.is_used] - np.mean(v[r.is_used]) for v, r in zip(left, split.train, strict=True)]
        for left in (winner.fitted.residual, train_um)
    )
    # a process of some orders knows nothing of what wanders below white noise
    wander = wander_beside(winner.fitted.model, winner.fitted.residual, split.train)
    noise = burg([wander.innovations(values) for values in own_um], _MOST_ORDER)
    if not noise.innovation_um2 > 0.0:
        return math.nan
    compared = [(own_um, others_um)]
    if len(held_um) == len(winner.held):
        compared += [([a], [b]) for a, b in zip(winner.held, held_um, strict=True) if a.size == b.size]
    margin = 0.0
    for mine, its in compared:
        white, left = ([noise.whiten(wander.innovations(v)) for v in stretches] for stretches in (mine, its))
        n_independent = sum(v.size for v in white) / max(autocorrelation_inflation(v) for v in white)
        powers = [max(sum(float(v @ v) for v in many), 1e-300) for many in (left, white)]
        margin += 0.5 * n_independent * math.log(powers[0] / powers[1])
    return margin


def simplest(winner: Candidate, candidates: Sequence[Candidate], split: DataSplit, n_causes: int) -> Candidate:
    """Return the candidate of fewest parameters among the winner and those that nothing tells from it.

    Of several the likeliest, where what they leave is noise that can be whitened. A winner that holds another candidate
    as a special case must predict surely better than that one.
    """
    alike = [c for c in candidates if c.is_bound == winner.is_bound]
    special = next((c for c in alike if c.cause == cause_classes()[winner.cause].generalizes), None)
    if special is not None and is_accepted(special, n_causes) and not is_surely_better(winner, special):
        winner = special
    tied = [other for other in ties_of(winner, alike, split) if is_accepted(other, n_causes)]
    least = min(candidate.n_free for candidate in (winner, *tied))
    # what brings plays of its own is not as simple as it counts: their weights are not among its parameters
    simple = [c for c in (winner, *tied) if c.n_free == least and (c is winner or not c.brings_plays)]
    simple = simple or [c for c in tied if c.n_free == least]
    if len(simple) == 1 or not _leaves_noise(winner, split):
        return simple[0]
    return min(simple, key=lambda candidate: _behind(candidate, winner, split))


def still_tied(model: TrialModel, tied: Sequence[Candidate], split: DataSplit) -> list[Candidate]:
    """Return those of the tied candidates that another record does not tell apart either.

    What belongs to single records is scored on blocks of its own; once it has been fitted to the held-out record
    too, what belongs to the actuator can be compared with it there.
    """
    if not split.is_apart:
        return list(tied)
    held = held_residuals(model, split.held)
    return [other for other in tied if other.is_bound or loses_to(held, list(other.held)) > _TIE_P_VALUE]


def rivals_of(winner: Candidate, candidates: list[Candidate]) -> tuple[Candidate, ...]:
    """Return the few candidates that did nearly as well, the best first.

    What is not known yet may have hidden more of one than of the other.
    """
    near = (
        other
        for other in candidates
        if other.cause != winner.cause
        and other.is_plausible
        and not other.is_bound
        and other.score.is_worthwhile()
        and other.score.log_gain > winner.score.log_gain - NEARLY
        and other.train_log_gain > winner.train_log_gain - NEARLY
    )
    return tuple(sorted(near, key=lambda other: -other.total_gain)[:_MOST_RIVALS])


def sure_gain(final: Refit, other: Refit, split: DataSplit) -> float:
    """Return the gain of another fit in log likelihood, its samples counted as independent ones."""
    return _n_effective(other, split) * math.log(final.squared_error / other.squared_error)


def _n_effective(fitted: Refit, split: DataSplit) -> float:
    return split.n_used / residual_inflation(fitted.residual, split.train)
