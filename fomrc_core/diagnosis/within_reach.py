"""Which causes that have begun may still come to matter: the others are followed no further (racing).

A race among candidates ends for one where it is surely behind, whatever it may still gain (Maron and Moore, 1994:
Hoeffding races). One is a finding by what it explains of held-out data, and counts as a rival, as the first of a pair
or as what a name cannot be told from by what it explains in training: it is out of both that it must be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fomrc_core.diagnosis.held_out_score import SURE, WORTHWHILE_LOCAL_LOG_GAIN, WORTHWHILE_LOG_GAIN, HeldOutScore
from fomrc_core.fitting.joint_fit import Refit

MORE_ITERATIONS = 6  # of a start worth going on with
# In the logarithm of the mean squared error: twice the rms after some iterations is another valley, whatever is left.
_HOPELESS = math.log(4.0)
# The same beside one that is at rest, its plays chosen beside all that was found: who would take its place has to leave
# no more than it does, and all else is there by now that could hide how well it does.
_BESIDE_ONE_AT_REST = math.log(2.0)
# Of what the best explains: plays that have bent to it are chosen anew beside each cause, and so much may be theirs.
_MAY_BE_PLAYS = 0.5


def foreseen_gain(fitted: Refit) -> float:
    """Return by how much a fit would still lower the logarithm of its squared error, falling on as it fell last.

    One that has begun is compared with one at rest: what it has not reached says little while it falls fast, for the
    last steps of Gauss-Newton gain most (Domhan, Springenberg and Hutter, 2015: a run is ended by its foreseen end).
    """
    return fitted.last_log_gain * MORE_ITERATIONS


@dataclass(frozen=True)
class Reach:
    """How far behind the best of a round a cause may be and still come to matter.

    Attributes:
        before_um2: sum of squares of the model before [um^2].
        least_um2: the least sum of squares of all causes after their first iterations [um^2].
        n_independent: number of samples, counted as independent ones.
        is_beside_one_at_rest: whether the best is one at rest, in whose place the others are asked for.
    """

    before_um2: float
    least_um2: float
    n_independent: float
    is_beside_one_at_rest: bool = False

    @property
    def gained(self) -> float:
        """What the best of them gains, in the logarithm of the squared error."""
        return max(math.log(self.before_um2 / self.least_um2), 0.0)

    @property
    def is_of_little(self) -> bool:
        """Whether one at rest gains so little that no base has bent to it: a cause shows at once what it mends."""
        return self.is_beside_one_at_rest and self.gained < _BESIDE_ONE_AT_REST

    @property
    def log_ratio(self) -> float:
        """By how much more than the best one may leave, in the logarithm of the squared error."""
        sure = 2.0 * SURE / max(self.n_independent, 1.0)
        most = _BESIDE_ONE_AT_REST if self.is_beside_one_at_rest else _HOPELESS
        return min(max(sure, _MAY_BE_PLAYS * self.gained), most)

    def holds(self, fitted: Refit) -> bool:
        """Return whether a fit that goes on may come near the best in training."""
        foreseen = math.log(fitted.squared_error) - foreseen_gain(fitted)
        return foreseen <= math.log(self.least_um2) + self.log_ratio


def may_be_found(score: HeldOutScore, further: float) -> bool:
    """Return whether a cause is worthwhile on held-out data, gained as much more there as is foreseen in training.

    Args:
        score: of the fit as it has begun.
        further: logarithmic gain that is foreseen.
    """
    is_everywhere = score.log_gain + further >= WORTHWHILE_LOG_GAIN
    is_local = score.local_log_gain + further >= WORTHWHILE_LOCAL_LOG_GAIN and score.log_gain + further > 0.0
    return is_everywhere or is_local
