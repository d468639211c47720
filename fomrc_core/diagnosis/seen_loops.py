"""Whether a model's loops are wide enough to be seen: a bend before the elements is told from one behind by them alone.

Where displacement is a curve of the drive the two are one curve, and no record says on which side it bends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.compute.least_squares import shortest_weights
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.residual import rms

_DEGREE = 3  # of the curve that a stage without loops moves on: as the warp of a drive


def loops_are_seen(model: TrialModel, split: DataSplit) -> bool:
    """Return whether the loops of a model stand out of the noise in the training records.

    The loops are what the thresholds of its plays make of the displacement beyond a curve of what it would be without.

    Args:
        model: the model.
        split: records, and the noise from sample to sample.
    """
    without = replace(model, columns=replace(model.columns, thresholds_v=np.zeros(model.columns.thresholds_v.size)))
    loops = []
    for index, record in enumerate(split.train):
        curve_um = predict(without, record, index)[record.is_used]
        moved_um = predict(model, record, index)[record.is_used]
        span_um = float(np.ptp(curve_um))
        if not span_um > 0.0:
            continue
        columns = np.vander((curve_um - np.min(curve_um)) / span_um, _DEGREE + 1)
        loops.append(moved_um - columns @ shortest_weights(columns, moved_um))
    return bool(loops) and rms(np.concatenate(loops)) > split.noise_um
