"""Whether data that were learned from surely show a cause that held-out data do not confirm.

Where a cause takes most of what is left of the training data and does no better held out, it is no finding: the model
beside it is wrong there, or another cause acts. But noise it is not, however well it passes for some.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.judgement import Judgement
from fomrc_core.diagnosis.wander import gain_beyond_wander

_MOST = 0.5  # of the power of what is left of the training data: less may be what it learned of their noise


def unless_training_tells(judgement: Judgement, runner_up: Candidate | None, split: DataSplit) -> Judgement:
    """Return the judgement, what is left no noise where a cause surely explains most of it in training.

    Args:
        judgement: of what is left on held-out data.
        runner_up: best candidate of the last round that was no finding, if any.
        split: records.
    """
    if runner_up is None or not judgement.is_noise or not runner_up.is_plausible or runner_up.is_bound:
        return judgement
    share = 1.0 - math.exp(-max(runner_up.train_log_gain, 0.0))
    if (
        share < _MOST
        or runner_up.brings_plays
        or gain_beyond_wander(runner_up.fitted.model, runner_up.cause, split) <= SURE
    ):
        return judgement
    reason = (
        f"{runner_up.cause} explains {100.0 * share:.0f} % of its power in the data it was learned from, "
        "and held-out data do not confirm it"
    )
    return replace(judgement, is_noise=False, reasons=(*judgement.reasons, reason))
