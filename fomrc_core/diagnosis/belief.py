"""How sure a name is: the probability that it is the cause, and not another, nor one that is not in the library.

Four things speak for a name: by how much it is likelier than the next, by how much once the noise is whitened, whether
what all causes together leave is noise, and by how much less is left with it. Of two models that both leave something
else the likelier one says little, of two of which one leaves noise it says how likely they are: the margin counts by
itself, and more where what is left is noise. They are weighed by a logistic regression (Platt, 1999) whose weights come
from hidden causes of seeds that are not reported (test/hidden/study_calibration.py).
"""

from __future__ import annotations

import math
from dataclasses import replace

from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import Judgement

# A difference in log likelihood beyond which more says nothing: what may be wrong then is the model of all causes, and
# not the choice among them.
_ENOUGH_MARGIN = 300.0
_ENOUGH_WHITENED = 1e4  # the same where the noise is whitened, of which every sample counts
# Of 219 names in 138 cases of development seeds of two worlds (the second and the third; 82 % of them right), about the
# weights learned before of 296 names (of a search that erred more often), these as if they were thirty of today's. In
# ten folds left out 122 names were told 90 % and more, and 99 % of them were right; the mean logarithm of what was told
# of the truth is -0.295 (-0.302 with the weights before). How closely a parameter is known to be the same held out, and
# by how many standard errors it is not, said no more of a name.
_INTERCEPT = -0.874
_PER_LOG_MARGIN = 0.209
_PER_LOG_WHITENED = 0.107
_OF_NOISE = 0.462
_PER_LOG_MARGIN_OF_NOISE = 0.470
# Where nothing was found, of the same cases: of 33 that left noise 7 had something hidden, of 20 that did not 19 had
# (a cause not in the library, another form of hysteresis, a clock that jitters).
_UNKNOWN_WHERE_NOISE = 0.2
_UNKNOWN_WHERE_NOT = 0.93
# A cause that mends little of what was left beside it may mend what the model of the others gets wrong: the gain counts
# up to where the power left is a third, by a weight learned beside the others, of 640 names in 627 cases of the second
# world (seeds from 90000 that had been reported before, and development scales). In ten folds left out the mean
# logarithm of what was told of the truth is -0.271, without it -0.284.
_ENOUGH_GAIN = 1.0
_PER_GAIN = 1.495
_WEIGHTS = (_PER_LOG_MARGIN, _PER_LOG_WHITENED, _OF_NOISE, _PER_LOG_MARGIN_OF_NOISE, _PER_GAIN)


def with_probabilities(findings: tuple[Finding, ...], judgement: Judgement) -> tuple[Finding, ...]:
    """Return the findings with how sure each is.

    Args:
        findings: causes in order of acceptance.
        judgement: of what all of them together leave.
    """
    believed = []
    for finding in findings:
        evidence = evidence_of(finding, judgement)
        log_odds = _INTERCEPT + sum(weight * value for weight, value in zip(_WEIGHTS, evidence, strict=True))
        believed.append(replace(finding, probability=_logistic(log_odds)))
    return tuple(believed)


def evidence_of(finding: Finding, judgement: Judgement) -> tuple[float, ...]:
    """Return what speaks for and against a name.

    The logarithm of one more than either margin, with the margin's sign (of two models that are both wrong the likelier
    one says less of a cause, but a name that another surely beats is not the cause), whether what is left is noise and
    the causes are the same in held-out data, and the first logarithm again where it is: numbers without a unit. A cause
    that has an equal has no margin. Last, by how much less than enough the
    power left falls where the cause is taken in.
    """
    margin, is_noise = _logarithm(finding.margin, _ENOUGH_MARGIN), float(judgement.is_noise)
    whitened = _logarithm(finding.whitened_margin, _ENOUGH_WHITENED)
    return (margin, whitened, is_noise, margin * is_noise, _gain(finding) - _ENOUGH_GAIN)


def probability_of_unknown(judgement: Judgement, findings: tuple[Finding, ...]) -> float:
    """Return the probability that something acts that is not in the library [1]."""
    if not findings:
        return _UNKNOWN_WHERE_NOISE if judgement.is_noise else _UNKNOWN_WHERE_NOT
    return 1.0 - min(finding.probability for finding in findings)


def _gain(finding: Finding) -> float:
    before, after = finding.nrmse_percent_test_before, finding.nrmse_percent_test_after
    gain = 2.0 * math.log(before / after) if before > 0.0 and after > 0.0 else _ENOUGH_GAIN
    return min(max(gain, 0.0), _ENOUGH_GAIN)


def _logarithm(margin: float, most: float) -> float:
    # not compared with any other it has no margin
    size = 0.0 if math.isnan(margin) else min(abs(margin), most)
    return math.copysign(math.log1p(size), margin)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))
