"""Of the forms of one cause that is taken which earns its parameters, wherever its fit began."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import candidates_for, held_view
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import screen
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_NOISE_UM = 2e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.8, 10)), np.linspace(1.0, 0.1, 10), 0.02, (), ((), ()))
_TWO_CLOSE = CreepLaw(first_share=0.02, first_s=0.8, second_share=0.02, second_s=2.4)


def _recorded(seed: int, slope_v_per_s: float) -> Recording:
    drive = triangle(2.0, slope_v_per_s=slope_v_per_s, n_cycles=6, rate_hz=50.0)
    blank = Recording(drive.time_s, drive.voltage_v, drive.voltage_v)
    moved_um = predict(_PLAIN.with_cause(_TWO_CLOSE), FitRecord.of(blank), 0)
    return Recording(
        drive.time_s, drive.voltage_v, moved_um + np.random.default_rng(seed).normal(0.0, _NOISE_UM, drive.time_s.size)
    )


def test_two_relaxations_close_together_are_found_and_no_third() -> None:
    split = split_data((_recorded(1, 4.0),), _recorded(2, 9.0), None, _NOISE_UM)
    base = fit_until_still(rebased(_PLAIN, split.train), split.train).model
    present = PresentModel.of(base, split)
    screened = screen(present, ("creep_law", "slow_relaxation"), held_view(base, split))
    found = {candidate.cause: candidate for candidate in candidates_for(present, split, screened, None)}
    best = found["creep_law"]
    (law,) = (effect for effect in best.fitted.model.effects if effect.name == "creep_law")
    assert isinstance(law, CreepLaw)
    assert best.is_plausible
    assert law.third_share == 0.0, "a third does not earn its parameters"
    times_s = sorted((law.first_s, law.second_s))
    assert times_s == pytest.approx([0.8, 2.4], rel=0.5)
    assert best.fitted.squared_error < 1.1 * _NOISE_UM**2 * split.n_used
    assert best.fitted.squared_error < found["slow_relaxation"].fitted.squared_error
