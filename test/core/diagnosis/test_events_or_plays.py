"""One past before every record is told by what it is, and not by plays that bend to it; an asymmetric loop by plays.

The truth of these records are plays that had been driven before, or that count more on one side, made with numpy alone.
"""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidates_for
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.events_or_plays import events_in_place_of_plays
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording
from test.core.driven_plays import states_of_plays, sum_of_lines

_RATE_HZ, _N, _NOISE_UM = 200.0, 2400, 0.004
_THRESHOLDS_V = np.array([0.0, 0.3, 0.6, 0.9, 1.3])
_WEIGHTS = np.array([1.0, 0.2, 0.2, 0.2, 0.2])


def _measured(seed: int, extreme_v: float, one_sided: float) -> Recording:
    """Return a stage that had gone to a voltage and back before, or whose plays count more above zero."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(_N) / _RATE_HZ
    drive_v = 0.35 * np.minimum(time_s / 6.0, 1.0) * sum_of_lines(rng, time_s, 0.2, 2.0)
    plays_v = states_of_plays(_THRESHOLDS_V, drive_v, extreme_v)
    moved_um = plays_v @ _WEIGHTS + one_sided * np.sum(np.maximum(plays_v[:, 1:4], 0.0), axis=1)
    return Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, _N))


def _told(extreme_v: float, one_sided: float) -> tuple[Candidate, Candidate]:
    """Return the cause with plays of its own as a candidate, and what is to be accepted in the end."""
    split = split_data(
        tuple(_measured(k, extreme_v, one_sided) for k in (1,)),
        *(_measured(k, extreme_v, one_sided) for k in (2, 3)),
        _NOISE_UM,
    )
    base = TrialModel(ColumnKinds.plays(_THRESHOLDS_V), _WEIGHTS, 0.0, (), ((), (), ()))
    present = PresentModel.of(fit_until_still(base, split.train).model, split)
    screened = screen(present, ("asymmetric_hysteresis", "initial_state"), held_view(present.model, split))
    candidates = candidates_for(present, split, screened, None)
    plays = next(candidate for candidate in candidates if candidate.cause == "asymmetric_hysteresis")
    assert plays.brings_plays
    return plays, events_in_place_of_plays(plays, candidates, present, split, 30, None)


def test_one_past_before_every_record_is_a_past() -> None:
    plays, told = _told(extreme_v=1.0, one_sided=0.0)
    assert plays.train_log_gain > 0.5, "plays bend to it"
    assert told.cause == "initial_state"
    assert told.fitted.squared_error < 1.2 * _NOISE_UM**2 * _N
    pasts = [cause for _, cause in told.fitted.model.found(0)]
    assert pasts[0].to_mapping()["extreme_v"] == pytest.approx(1.0, rel=0.1)


def test_a_loop_that_is_not_symmetric_stays_one() -> None:
    plays, told = _told(extreme_v=0.0, one_sided=0.1)
    assert plays.score.log_gain > 1.0
    assert told is plays
