"""Whether anything of what a search has left follows the drive: where it is noise, no two causes explain it either.

The same tests as of the end (``judgement.py``), on the data the search works with. They say nothing of what belongs to
single records, which follows no drive: that is sought by itself in each round.
"""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit, HeldOut
from fomrc_core.diagnosis.judgement import LARGEST_SLOW
from fomrc_core.diagnosis.remainder import DrivenRecord, dependences
from fomrc_core.diagnosis.unevenness import slow_unevenness, unevenness
from fomrc_core.fitting.linear_part import centred
from fomrc_core.fitting.trial_model import TrialModel, predict

_DOUBTFUL = 0.05  # of the hypothesis that nothing is left, for all tests together: a doubt is enough to go on


def nothing_is_left(model: TrialModel, split: DataSplit) -> bool:
    """Return whether no test finds anything that follows the drive in what a model leaves of all records, or of one.

    More than slow noise of a sensor comes to is something, whatever the tests say: few large steps say little to them.

    Args:
        model: fitted to the training records.
        split: records.
    """
    apart = {part.index: part for part in split.held if part.index >= len(split.train)}
    parts = [*(HeldOut(record, index) for index, record in enumerate(split.train)), *apart.values()]
    left = [_driven(model, part) for part in parts]
    power_um2 = np.mean(np.concatenate([each.residual_um[each.is_used] for each in left]) ** 2)
    if power_um2 > LARGEST_SLOW**2 * split.noise_um**2:
        return False
    together = [left, *([each] for each in left)] if len(left) > 1 else [left]
    tests = [test for some in together for test in (*dependences(some), unevenness(some), slow_unevenness(some))]
    return min(test.p_value for test in tests) * len(tests) > _DOUBTFUL


def _driven(model: TrialModel, part: HeldOut) -> DrivenRecord:
    record = part.record
    predicted_um = predict(model, record, part.index)
    residual_um = centred(record.measured_um - predicted_um, record.is_used)
    return DrivenRecord(record.time_s, record.voltage_v, predicted_um, residual_um, record.is_used)
