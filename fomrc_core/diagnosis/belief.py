"""How sure a name is: the probability that it is the cause, and not another, nor one that is not in the library.

Three things speak for a name: by how much it is likelier than the next, how little of what the base missed is left,
and how much of what is left still follows the drive. They are weighed by a logistic regression (Platt, 1999) whose
weights come from hidden causes of the development seeds of both worlds (docs/decisions/0007-probabilities.md); what
they are worth is read from the reporting seeds (docs/study.md, reliability).
"""

from __future__ import annotations

import math
from dataclasses import replace

from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import Judgement

_ENOUGH_MARGIN = 20.0  # a difference in log likelihood beyond which more says nothing
_INTERCEPT = -1.5
_PER_LOG_MARGIN = 1.2
_PER_UNEXPLAINED = -5.0
_PER_DEPENDENCE = -2.0
_OF_NOISE = 1.0
_OF_TIE = 0.5  # two causes alike share what one of them would have


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
        probability = _logistic(evidence(finding, judgement))
        if tied and number == len(findings) - 1:
            probability *= 1.0 / (1.0 + _OF_TIE * len(tied) * 2.0)
        believed.append(replace(finding, probability=probability))
    return tuple(believed)


def evidence(finding: Finding, judgement: Judgement) -> float:
    """Return the log odds that a finding is the cause [1]."""
    margin = math.log1p(min(max(finding.margin, 0.0), _ENOUGH_MARGIN))
    followed = max((d.share for d in judgement.dependences if d.p_value < 0.01), default=0.0)
    return (
        _INTERCEPT
        + _PER_LOG_MARGIN * margin
        + _PER_UNEXPLAINED * judgement.unexplained_share
        + _PER_DEPENDENCE * followed
        + _OF_NOISE * judgement.is_noise
    )


def probability_of_unknown(judgement: Judgement, findings: tuple[Finding, ...]) -> float:
    """Return the probability that something acts that is not in the library [1]."""
    if judgement.is_noise and not findings:
        return _logistic(_INTERCEPT - _OF_NOISE)
    least = min((finding.probability for finding in findings), default=0.0)
    return 1.0 - least if findings else 1.0 - _logistic(-_OF_NOISE)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))
