"""How sure a name is: the probability that it is the cause, and not another, nor one that is not in the library.

Three things speak for a name: by how much it is likelier than the next, by how much once the noise is whitened, and
whether what all causes together leave is noise. Two speak against it: that its form follows most of what other causes
do and that it mends little, and that what is left follows the drive, however little it is. Of two models that both
leave something else the likelier one says little, of two of which one leaves noise it says how likely they are: the
margin counts by itself, and more where what is left is noise. They are weighed by a logistic regression (Platt, 1999)
whose weights come from hidden causes of seeds that are not reported (test/hidden/study_calibration.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import LEAST_OF_BENDING, LEAST_OF_EACH, Judgement
from fomrc_core.model.causes import cause_classes

# A difference in log likelihood beyond which more says nothing: what may be wrong then is the model of all causes, and
# not the choice among them.
_ENOUGH_MARGIN = 300.0
_ENOUGH_WHITENED = 1e4  # the same where the noise is whitened, of which every sample counts
# Of 435 names in 275 cases of the second world (seeds from 420000 and 430000, used up by it), about the weights
# learned before of 312 names of an earlier search, these as if they were thirty of today's. In ten folds left out 309
# names were told 90 % and more, and 98 % of them were right; 59 were told 60 to 90 %, and 80 % were (the weights
# before told 46 so, of which 91 % were right). The mean logarithm of what is told of the truth is -0.209 (-0.236).
_INTERCEPT = 0.446
_PER_LOG_MARGIN = 0.233
_PER_LOG_WHITENED = 0.125
_PER_LOG_MARGIN_OF_NOISE = 0.358
# Where nothing was found, of cases from 170000: of 33 that left noise 7 had something hidden, of 20 that did not 19 had
# (a cause not in the library, another form of hysteresis, a clock that jitters).
_UNKNOWN_WHERE_NOISE = 0.2
_UNKNOWN_WHERE_NOT = 0.93
# What bends to most of what others do mends a little of whatever the others get wrong, by any margin: what it takes of
# the power left where it acts counts, up to two thirds of it. Of 49 likely names of such causes beside which noise was
# left 37 of 41 were right that took half and more, and 3 of 8 that took less. Others say no less where they mend
# little.
_ENOUGH_GAIN = 1.0
_PER_GAIN_OF_BENDING = 7.895
# What is left may be far below anything that matters and follow the drive all the same, surely: then the form is not
# quite that of what acts.
_ENOUGH_SURENESS = 6.0  # decades of the p-value; in long records any form is surely not quite right
_PER_DECADE = -0.274
_WEIGHTS = (
    _PER_LOG_MARGIN,
    _PER_LOG_WHITENED,
    _PER_LOG_MARGIN_OF_NOISE,
    _PER_GAIN_OF_BENDING,
    _PER_DECADE,
)


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


class Named(Protocol):
    """What carries a name and how sure it is: a finding of a stage or of several axes."""

    @property
    def cause(self) -> str:
        """Its name."""

    @property
    def probability(self) -> float:
        """That it is the cause [1]."""


def sureness_of(findings: Sequence[Named]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return how sure each name is, and how sure it must be at least in an explanation [1]."""
    return tuple(f.probability for f in findings), asked_of([f.cause for f in findings])


def asked_of(causes: Sequence[str]) -> tuple[float, ...]:
    """Return how sure each of these names must be at least in an explanation [1]."""
    known = cause_classes()
    return tuple(LEAST_OF_BENDING if c in known and known[c].bends_to_much else LEAST_OF_EACH for c in causes)


def evidence_of(finding: Finding, judgement: Judgement) -> tuple[float, ...]:
    """Return what speaks for and against a name.

    The logarithm of one more than either margin, with the margin's sign (of two models that are both wrong the likelier
    one says less of a cause, but a name that another surely beats is not the cause), and the first logarithm again
    where what is left is noise and the causes are the same in held-out data: numbers without a unit. A cause that has
    an equal has no margin. Then by how much less than enough the power left falls where a cause is taken in whose form
    bends to much, and how surely what is left follows the drive, in decades.
    """
    margin, is_noise = _logarithm(finding.margin, _ENOUGH_MARGIN), float(judgement.is_noise)
    whitened = _logarithm(finding.whitened_margin, _ENOUGH_WHITENED)
    gain = _gain(finding) - _ENOUGH_GAIN if cause_classes()[finding.cause].bends_to_much else 0.0
    return (margin, whitened, margin * is_noise, gain, _sureness(judgement))


def probability_of_unknown(judgement: Judgement, findings: tuple[Finding, ...]) -> float:
    """Return the probability that something acts that is not in the library [1]."""
    if not findings:
        return _UNKNOWN_WHERE_NOISE if judgement.is_noise else _UNKNOWN_WHERE_NOT
    return 1.0 - min(finding.probability for finding in findings)


def _sureness(judgement: Judgement) -> float:
    """Return how surely what is left follows the drive by the surest of the tests, in decades of its p-value."""
    least = min((test.p_value for test in judgement.dependences if test.is_of_drive), default=1.0)
    return min(-math.log10(least), _ENOUGH_SURENESS) if least > 0.0 else _ENOUGH_SURENESS


def _gain(finding: Finding) -> float:
    before, after = finding.nrmse_percent_test_before, finding.nrmse_percent_test_after
    gain = 2.0 * math.log(before / after) if before > 0.0 and after > 0.0 else _ENOUGH_GAIN
    if finding.own_log_gain is not None:
        # What befell one record mends little of another, and nothing of one in which it is not; and what is taken in
        # while others are hidden mends little of what those leave.
        gain = max(gain, finding.own_log_gain)
    return min(max(gain, 0.0), _ENOUGH_GAIN)


def _logarithm(margin: float, most: float) -> float:
    # not compared with any other it has no margin
    size = 0.0 if math.isnan(margin) else min(abs(margin), most)
    return math.copysign(math.log1p(size), margin)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))
