"""What hysteresis does where the drive of a held-out record goes beyond all that were learned from.

A play wider than any drive of the training records reaches stands still in them, so that no fit knows its weight: it
is no fault of a model that it does not know either. Where a held-out drive goes farther, such plays are fitted to what
each model leaves there, and what they explain is taken out before it is scored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import gram_of, whitening_of
from fomrc_core.fitting.base_fit import widest_play_v
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import Tangent, centred, record_columns
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel

# Of the widest play learned. Loops widen about as the square of the drive: beyond by a hundredth they differ from those
# that were learned by less than a ten thousandth of the stroke.
_AS_WIDE = 0.01
_STEP = 0.04  # of the widest play learned, between those that were not: their sum bends no faster than the loop does
_MOST_PLAYS = 12


@dataclass(frozen=True)
class BeyondLearned:
    """A held-out record whose drive goes beyond that of the training records.

    Attributes:
        name: of the record.
        widest_v: threshold of the widest play its drive moves [V].
        learned_v: the same of all training records together [V].
    """

    name: str
    widest_v: float
    learned_v: float

    @classmethod
    def of(cls, learned: tuple[FitRecord, ...], record: FitRecord) -> BeyondLearned:
        """Return how far a record's drive goes beyond those learned from."""
        return cls(record.recording.name, widest_play_v((record,)), widest_play_v(learned))

    def __str__(self) -> str:
        return (
            f"{self.name}: its drive moves plays of up to {self.widest_v:.4g} V, the training records none above "
            f"{self.learned_v:.4g} V; no model is judged by what those beyond do, and the errors told hold it"
        )


def untaught_plays(learned: tuple[FitRecord, ...], record: FitRecord) -> Array:
    """Return thresholds of plays that a drive moves and those learned from do not [V], the least first.

    Args:
        learned: records a fit learns from.
        record: another.

    Returns:
        Shape (n_plays,), none where the drive goes no farther.
    """
    taught_v, reached_v = widest_play_v(learned), widest_play_v((record,))
    if not reached_v > (1.0 + _AS_WIDE) * taught_v:
        return np.zeros(0)
    n = min(max(math.ceil((reached_v - taught_v) / (_STEP * taught_v)), 1), _MOST_PLAYS)
    return np.linspace(taught_v, reached_v, n + 1)[:-1]


def untaught_directions(trial: TrialModel, record: FitRecord, index: int, plays_v: Array) -> Tangent:
    """Return what plays that were not learned can do in a record.

    Args:
        trial: the model, whose creep and causes the plays go through.
        record: the record.
        index: its number among all records.
        plays_v: thresholds of the plays [V], shape (n_plays,).
    """
    only = ColumnKinds.plays(plays_v)
    beyond = replace(trial, columns=only, weights=np.zeros(plays_v.size))
    columns = centred(record_columns(beyond, record, index, trial), record.is_used)
    return Tangent((columns,), whitening_of(gram_of(((columns, record.is_used),))))


def with_untaught(trial: TrialModel, plays_v: Array) -> TrialModel:
    """Return the model with plays that were not learned beside its own, their weights still zero."""
    columns = trial.columns.joined(ColumnKinds.plays(plays_v))
    return replace(trial, columns=columns, weights=np.concatenate((trial.weights, np.zeros(plays_v.size))))
