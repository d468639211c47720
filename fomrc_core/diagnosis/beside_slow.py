"""A cause that is quick beside something slow that nobody has found yet: told by what wandering noise leaves of both.

A drift, or creep of another law, may be many times what a lag leaves. Then few samples of what is left are
independent, in the held-out record as well, and the base fitted beside the lag may even follow the slow part worse
there. But what is not foreseen of it from one sample to the next is the lag's. The same test in training and held out,
both on the innovations (generalized least squares): what is taken out is slow, whatever it is, and nothing quick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fomrc_core.diagnosis.acceptance import RICH_GAIN, SIGNIFICANCE, is_learnt
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import likelier_by
from fomrc_core.diagnosis.held_out_score import SURE, WORTHWHILE_LOG_GAIN, HeldOutScore, held_out_score
from fomrc_core.diagnosis.wander import gain_beyond_wander, wander_beside


def found_beside_slow(candidates: Sequence[Candidate], split: DataSplit, n_causes: int) -> Candidate | None:
    """Return the likeliest cause that is a finding beside something slow, None where there is none.

    Of those that are as likely as the likeliest the one with the fewest parameters is taken.

    Args:
        candidates: fitted beside the present model.
        split: records.
        n_causes: how many causes were tried.
    """
    sure = [candidate for candidate in candidates if _is_finding(candidate, split, n_causes)]
    if not sure:
        return None
    best = sure[0]
    for other in sure[1:]:
        if likelier_by(best, other.fitted.residual, other.held, split) < 0.0:
            best = other
    alike = [c for c in sure if c is best or likelier_by(best, c.fitted.residual, c.held, split) <= SURE]
    return min(alike, key=lambda candidate: candidate.n_free)


def innovations_score(candidate: Candidate, split: DataSplit) -> HeldOutScore | None:
    """Return the score of what is not foreseen of the held-out data; None where not the same of them was kept."""
    before, after = candidate.held_before, candidate.held
    if [values.size for values in before] != [values.size for values in after]:
        return None
    noise = wander_beside(candidate.fitted.model, candidate.fitted.residual, split.train)
    return held_out_score([noise.innovations(v) for v in before], [noise.innovations(v) for v in after])


def _is_finding(candidate: Candidate, split: DataSplit, n_causes: int) -> bool:
    if not (candidate.is_plausible and candidate.is_distinguishable and is_learnt(candidate)):
        return False
    score = innovations_score(candidate, split)
    least = RICH_GAIN if candidate.brings_plays else WORTHWHILE_LOG_GAIN
    if score is None or score.log_gain < least or score.p_value >= SIGNIFICANCE / n_causes:
        return False
    return gain_beyond_wander(candidate.fitted.model, candidate.cause, split) > SURE + math.log(n_causes)
