"""What is quick shows beside what is slow, however little it is of all that is left; noise that wanders does not."""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.data_split import SUBSTEPS, DataSplit, split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import Screened, screen
from fomrc_core.diagnosis.worth_a_refit import worth_a_refit
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.9, 6)), np.linspace(1.0, 0.1, 6), 0.02, (), ((), ()))
N, STEP_S, NOISE_UM = 6000, 1e-3, 1e-3
TIME_S = np.arange(N) * STEP_S
HUM_HZ = 50.0


def _split(beside_um: np.ndarray) -> DataSplit:
    drive_v = np.repeat(np.random.default_rng(2).uniform(-2.0, 2.0, N // 40), 40)
    moved_um = predict(PLAIN, FitRecord.of(Recording(TIME_S, drive_v, drive_v), substeps=SUBSTEPS), 0)
    noise_um = np.random.default_rng(3).normal(0.0, NOISE_UM, N)
    record = Recording(TIME_S, drive_v, moved_um + beside_um + noise_um)
    return split_data((record,), record, None, NOISE_UM)


def _screened(split: DataSplit) -> tuple[PresentModel, tuple[Screened, ...]]:
    present = PresentModel.of(PLAIN, split)
    return present, screen(present, ("mains_hum", "slow_relaxation", "amplifier_bandwidth"))


def test_a_line_is_asked_for_beside_a_drift_many_times_as_large() -> None:
    drift_um = 0.3 * (TIME_S / TIME_S[-1]) ** 2
    split = _split(drift_um + 5.0 * NOISE_UM * np.sin(2.0 * np.pi * HUM_HZ * TIME_S))
    present, screened = _screened(split)
    (hum,) = (trial for trial in screened if trial.name == "mains_hum")
    # as a part of all that is left it is next to nothing, and so slow a residual has few independent samples
    assert hum.explained < 0.01 * present.squared_error
    assert hum.beside_slow > 250.0
    asked = {trials[0].name for trials in worth_a_refit(present, split, (hum,))}
    assert asked == {"mains_hum"}


def test_what_a_walk_does_to_be_like_a_cause_is_foreseen() -> None:
    for seed in range(6):
        walk_um = np.cumsum(np.random.default_rng(seed).normal(0.0, 3e-4, N))
        _, screened = _screened(_split(walk_um))
        assert max(trial.beside_slow for trial in screened) < 25.0
