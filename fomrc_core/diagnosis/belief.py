"""How sure a name is: the probability that it is the cause, and not another, nor one that is not in the library.

Three things speak for a name: by how much it is likelier than the next, how little of what the base missed is left,
and how much of what is left still follows the drive. They are weighed by a logistic regression (Platt, 1999) whose
weights come from hidden causes of development seeds of the second world (test/hidden/study_calibration.py).
"""

from __future__ import annotations

import math
from dataclasses import replace

from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import Judgement

_ENOUGH_MARGIN = 1e4  # a difference in log likelihood beyond which more says nothing
# Of 161 names in 127 cases of development seeds (python test/hidden/study_calibration.py --seeds 1): in five folds left
# out 32 names were told 90 % and more, and 94 % of them were right. Run again two changes of the search later, of 190
# names in 127 cases 31 were told 90 % and more, 94 % of them right, and weights fitted anew told no better.
_INTERCEPT = -0.68
_PER_LOG_MARGIN = 0.34
_PER_UNEXPLAINED = 0.14
_PER_DEPENDENCE = -0.94
_OF_NOISE = 0.43
_PER_TIE = 0.50
# Where nothing was found, of the same cases: of 10 that left noise 2 had something hidden, of 15 that did not 14 had
# (a cause not in the library, another form of hysteresis, a clock that jitters).
_UNKNOWN_WHERE_NOISE = 0.2
_UNKNOWN_WHERE_NOT = 0.93
_WEIGHTS = (_PER_LOG_MARGIN, _PER_UNEXPLAINED, _PER_DEPENDENCE, _OF_NOISE, _PER_TIE)


def with_probabilities(
    findings: tuple[Finding, ...], judgement: Judgement, tied: tuple[str, ...]
) -> tuple[Finding, ...]:
    """Return the findings with how sure each is.

    Args:
        findings: causes in order of acceptance.
        judgement: of what all of them together leave.
        tied: causes the last cannot be told from.
    """
    believed = []
    for number, finding in enumerate(findings):
        n_tied = len(tied) if number == len(findings) - 1 else 0
        evidence = evidence_of(finding, judgement, n_tied)
        log_odds = _INTERCEPT + sum(weight * value for weight, value in zip(_WEIGHTS, evidence, strict=True))
        believed.append(replace(finding, probability=_logistic(log_odds)))
    return tuple(believed)


def evidence_of(finding: Finding, judgement: Judgement, n_tied: int) -> tuple[float, ...]:
    """Return what speaks for and against a name.

    The logarithm of one more than its margin where what is left is noise (of two models that are both wrong the
    likelier one says nothing of a cause), the share that is unexplained, the share of what is left that follows the
    drive, whether what is left is noise, and the logarithm of one more than the number of causes it cannot be told
    from: all of them numbers without a unit.
    """
    # not compared with any other it has no margin
    is_compared = judgement.is_noise and not math.isnan(finding.margin)
    margin = math.log1p(min(max(finding.margin, 0.0), _ENOUGH_MARGIN)) if is_compared else 0.0
    followed = max((d.share for d in judgement.dependences if d.p_value < 0.01), default=0.0)
    return (margin, judgement.unexplained_share, followed, float(judgement.is_noise), math.log1p(n_tied))


def probability_of_unknown(judgement: Judgement, findings: tuple[Finding, ...]) -> float:
    """Return the probability that something acts that is not in the library [1]."""
    if not findings:
        return _UNKNOWN_WHERE_NOISE if judgement.is_noise else _UNKNOWN_WHERE_NOT
    return 1.0 - min(finding.probability for finding in findings)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))
