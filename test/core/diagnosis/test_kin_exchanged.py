"""An amplifier and a mass that both ring, each taken for the other, change places; right ones stay."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.kin_exchanged import with_kin_exchanged
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 0.3, 0.8])), np.array([1.0, 0.4, 0.3]), 0.0, (), ((),))
_DRIVE, _MASS = DriveResonance(33.0, 0.34), MechanicalResonance(20.0, 0.065)


@pytest.fixture(name="split")
def _split() -> DataSplit:
    rate_hz, rng = 400.0, np.random.default_rng(2)
    drive_v = np.repeat(rng.uniform(-2.0, 2.0, 24), 60)
    time_s = np.arange(drive_v.size) / rate_hz
    model = _PLAIN.with_cause(_DRIVE).with_cause(_MASS)
    moved_um = predict(model, FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    return split_data(
        (Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, time_s.size)),), None, None, _NOISE_UM
    )


def test_two_that_stand_in_each_others_place_change_places(split: DataSplit) -> None:
    wrong = _PLAIN.with_cause(DriveResonance(20.0, 0.065)).with_cause(MechanicalResonance(33.0, 0.34))
    stuck = fit_until_still(wrong, split.train)
    found = with_kin_exchanged(stuck, split, None)
    drive, mass = sorted(found.model.effects, key=lambda effect: effect.name)
    assert isinstance(drive, DriveResonance)
    assert isinstance(mass, MechanicalResonance)
    assert drive.frequency_hz == pytest.approx(_DRIVE.frequency_hz, rel=0.01)
    assert mass.frequency_hz == pytest.approx(_MASS.frequency_hz, rel=0.01)
    assert found.squared_error < 0.5 * stuck.squared_error


def test_two_that_are_right_stay_and_so_does_one_alone(split: DataSplit) -> None:
    right = fit_until_still(_PLAIN.with_cause(_DRIVE).with_cause(_MASS), split.train)
    assert with_kin_exchanged(right, split, None) is right
    alone = fit_until_still(_PLAIN.with_cause(_MASS), split.train)
    assert with_kin_exchanged(alone, split, None) is alone
