"""Whether a candidate is a finding: not by chance on held-out data, and more than noise that wanders."""

from __future__ import annotations

import math

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.moved_times import with_times_moved_in_all
from fomrc_core.diagnosis.wander import gain_beyond_wander
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.model.causes import cause_classes

SIGNIFICANCE = 0.01  # of one search, shared by the causes it tries (Bonferroni)
# In the logarithm of the mean squared error: twice as much of it is near as long as other causes are hidden, a sixth
# no difference from one held-out stretch to another.
NEARLY, HARDLY = 0.7, 0.15
# Held-out gain of a cause with dozens of plays of its own: they mend what a grid of thresholds gets wrong of any loop,
# so that less is no finding.
RICH_GAIN = 0.16
_MOVED = 6  # iterations of a fit whose times have been moved
_LEAST_LEARNT = 0.003  # logarithmic gain in training: less has only shaken the base


def is_accepted(candidate: Candidate, n_causes: int) -> bool:
    """Return whether a candidate is a finding, among this number of causes tried."""
    return (
        candidate.is_plausible
        and candidate.is_distinguishable
        and is_learnt(candidate)
        and candidate.score.p_value < SIGNIFICANCE / n_causes
        and candidate.score.is_worthwhile()
        and (candidate.score.log_gain >= RICH_GAIN or not candidate.brings_plays)
    )


def is_learnt(candidate: Candidate) -> bool:
    """Return whether training speaks for a candidate: what teaches nothing has only shaken the base.

    One without anything to fit has nothing to learn: of it held-out data, which no fit has seen, say as much, unless
    training says more against it. A hold beside the delay that had taken its time is told by another sampling rate.
    """
    if candidate.train_log_gain >= _LEAST_LEARNT:
        return True
    has_nothing_to_learn = candidate.n_free == 0 and not candidate.brings_plays
    return has_nothing_to_learn and candidate.log_likelihood_gain > SURE


def is_no_wander(candidate: Candidate, split: DataSplit, cause: str = "") -> bool:
    """Return whether a candidate surely explains more than noise that wanders might, or a cause in its model does."""
    return _gain_beyond_wander(candidate, cause or candidate.cause, split) > SURE


def is_finding(candidate: Candidate, split: DataSplit, n_causes: int) -> bool:
    """Return whether a candidate is a finding, and more than noise that wanders.

    Whichever of the two is surer pays for the number of causes tried: while another cause is hidden, few blocks of the
    held-out data are independent, and they may say no more than that the gain is not by chance.
    """
    if not is_accepted(candidate, 1):
        return False
    is_sure_held = is_accepted(candidate, n_causes)
    if is_sure_held and is_foreseen_apart(candidate, split):
        return True
    gain = _gain_beyond_wander(candidate, candidate.cause, split)
    return gain > (SURE if is_sure_held else SURE + math.log(n_causes))


def is_foreseen_apart(candidate: Candidate, split: DataSplit) -> bool:
    """Return whether what a candidate learnt in one record takes half of what is left of another.

    Noise of one record foresees nothing of another: where the score is not by chance it is no noise that wanders.
    """
    return split.is_apart and not candidate.is_bound and candidate.score.log_gain >= NEARLY


def _gain_beyond_wander(candidate: Candidate, cause: str, split: DataSplit) -> float:
    """Return what a cause of a candidate's model gains beyond noise that wanders, its times where they are best.

    A load that comes some samples late leaves its whole jump twice, from sample to sample as much as none at all.
    """
    model = candidate.fitted.model
    gain = gain_beyond_wander(model, cause, split)
    if gain > SURE or not cause_classes()[cause].has_own_times():
        return gain
    moved = with_times_moved_in_all(model, split.train)
    if moved is model:
        return gain
    return max(gain, gain_beyond_wander(refit(moved, split.train, n_iterations=_MOVED).model, cause, split))
