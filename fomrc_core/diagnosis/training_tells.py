"""Whether a cause that is no finding surely explains what is left.

Where a cause takes most of what is left of the training data and does no better held out, it is no finding: the model
beside it is wrong there, or another cause acts. Nor is it one where it takes most of both with parameters that no such
cause has: something else acts that it bends to. But noise it is not, however well it passes for some: nobody foresees
noise of another record.
"""

from __future__ import annotations

import math
from dataclasses import replace

from fomrc_core.diagnosis.acceptance import SIGNIFICANCE
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.judgement import Judgement
from fomrc_core.diagnosis.wander import gain_beyond_wander
from fomrc_core.model.causes import cause_classes

_MOST = 0.5  # of the power of what is left: less of the training data may be what it learned of their noise


def unless_training_tells(judgement: Judgement, runner_up: Candidate | None, split: DataSplit) -> Judgement:
    """Return the judgement, what is left no noise where a cause that is no finding surely explains most of it.

    Args:
        judgement: of what is left on held-out data.
        runner_up: best candidate of the last round that was no finding, if any.
        split: records.
    """
    if runner_up is None or not judgement.is_noise or runner_up.is_bound or runner_up.brings_plays:
        return judgement
    share, held_share = (_share(gain) for gain in (runner_up.train_log_gain, runner_up.score.log_gain))
    if not runner_up.is_plausible and (held_share < _MOST or not _is_sure(runner_up)):
        return judgement
    if share < _MOST or gain_beyond_wander(runner_up.fitted.model, runner_up.cause, split) <= SURE:
        return judgement
    unheard = "held-out data do not confirm it"
    impossible = f"{100.0 * held_share:.0f} % in held-out data, with parameters no such cause has"
    reason = (
        f"{runner_up.cause} explains {100.0 * share:.0f} % of its power in the data it was learned from, "
        f"and {unheard if runner_up.is_plausible else impossible}"
    )
    return replace(judgement, is_noise=False, reasons=(*judgement.reasons, reason))


def _share(log_gain: float) -> float:
    return 1.0 - math.exp(-max(log_gain, 0.0))


def _is_sure(candidate: Candidate) -> bool:
    return candidate.score.p_value < SIGNIFICANCE / len(cause_classes())
