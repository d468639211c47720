"""What a model leaves of all records, and whether that is noise: every measure a judgement asks for, taken at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.bursts import bursts
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.judgement import Judgement, judge
from fomrc_core.diagnosis.record_view import RecordView, record_views
from fomrc_core.diagnosis.remainder import dependences
from fomrc_core.diagnosis.slow_rest import is_slower_than_seen
from fomrc_core.diagnosis.steady_line import steady_line
from fomrc_core.diagnosis.unevenness import slow_unevenness, unevenness
from fomrc_core.fitting.linear_part import residuals
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.noise import NoiseFloor, rounding_of
from fomrc_core.records.residual import rms


@dataclass(frozen=True, eq=False)
class JudgedRest:
    """What a model leaves, and what that is taken for.

    Attributes:
        records: every record before and after.
        floor_um: noise floor, what was found taken out, no less than the quoted readings are rounded to [um].
        after_um: rms of the model on quoted data, what nothing taught it taken out [um].
        learned_um: rms of the model on the data it learned from [um].
        judgement: whether it is noise.
    """

    records: tuple[RecordView, ...]
    floor_um: float
    after_um: float
    learned_um: float
    judgement: Judgement

    @classmethod
    def of(
        cls, model: TrialModel, base: TrialModel, split: DataSplit, noise: NoiseFloor, learning_excess: float
    ) -> JudgedRest:
        """Return what a model leaves, judged.

        Args:
            model: the model.
            base: model without causes.
            split: records.
            noise: floor known before any model.
            learning_excess: see ``judge``.
        """
        records, worst_um, floor_um = record_views(split, base, model, noise)
        rounding_um = rounding_of([h.record.measured_um[h.record.is_used] for h in split.report])
        floor_um = max(floor_um, rounding_um)
        before_um, after_um = (rms(np.concatenate(held_residuals(each, split.report))) for each in (base, model))
        driven = [view.driven() for view in records]
        tests = (*dependences(driven), steady_line(driven), bursts(driven))
        sees_slow = noise.sees_slow_noise and not is_slower_than_seen(driven, floor_um, noise.slowest_seen_s)
        if not sees_slow:
            tests = (*tests, unevenness(driven), slow_unevenness(driven))
        learned_um = max(rms_learned(model, split), rounding_um)
        is_flexible = model.n_owned > base.n_owned
        judgement = judge(
            floor_um, sees_slow, before_um, after_um, worst_um, tests, learning_excess, learned_um, is_flexible
        )
        return cls(records, floor_um, after_um, learned_um, judgement)

    @property
    def worst_um(self) -> float:
        """Largest rms of any record that was not learned from [um]."""
        return max(rms(v.residual_after_um[v.is_scored]) for v in self.records if v.role != "train")


def rms_learned(model: TrialModel, split: DataSplit) -> float:
    """Return the rms of a model on the samples it learned from [um]."""
    left_um: list[Array] = [v[r.is_used] for v, r in zip(residuals(model, split.train), split.train, strict=True)]
    return rms(np.concatenate(left_um))
