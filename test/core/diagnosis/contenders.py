"""Candidates made up for tests of how several are compared: each leaves white noise of a size it is told."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.held_out_score import HeldOutScore
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

BEFORE_UM = 0.016


def split_of_triangles() -> DataSplit:
    """Return a record of three triangles with white noise of 1 nm."""
    drive = triangle(1.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=500.0)
    noise_um = np.random.default_rng(1).normal(0.0, 1e-3, drive.voltage_v.size)
    record = Recording(drive.time_s, drive.voltage_v, 2.0 * drive.voltage_v + noise_um)
    return split_data((record,), None, None, 1e-3)


def contender(split: DataSplit, cause: str, train_gain: float, held_gain: float, n_free: int = 1) -> Candidate:
    """Return a candidate that leaves white noise of the size its training gain says."""
    size_um = BEFORE_UM * math.exp(-0.5 * train_gain)
    n = split.train[0].time_s.size
    left = np.random.default_rng(2).normal(0.0, size_um, n)
    chain = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))
    squared_error = float(np.sum(left[split.train[0].is_used] ** 2))
    fitted = Refit(chain, squared_error, (), (np.zeros((n, 0)),), (left,), True)
    rms_um = BEFORE_UM * math.exp(-0.5 * held_gain)
    score = HeldOutScore(held_gain, 0.0, 1e-20, BEFORE_UM, rms_um)
    return Candidate(cause, fitted, score, train_gain, (), n_free)
