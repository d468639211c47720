"""Loops are seen where they are wider than the noise; a lag's are none, and without any nothing bends them."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import implausible_in
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.seen_loops import loops_are_seen
from fomrc_core.effects import effect_classes
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

NOISE_UM = 0.01


def _split() -> DataSplit:
    time_s = np.arange(2000) / 100.0
    voltage_v = np.sin(2.0 * np.pi * 0.3 * time_s) * np.minimum(time_s, 1.0)
    moved_um = np.random.default_rng(1).normal(0.0, NOISE_UM, time_s.size) + 2.0 * voltage_v
    record = Recording(time_s, voltage_v, moved_um)
    return split_data((record,), record, None, NOISE_UM)


def _stage(width_um: float) -> TrialModel:
    """Return a stage whose loops are some half as high as told."""
    plays = ColumnKinds.plays(np.array([0.0, 0.25]))
    return TrialModel(plays, np.array([2.0, width_um / 0.25]), 0.0, (), ((), ()))


@pytest.mark.parametrize(("width_um", "are_seen"), [(0.0, False), (0.3 * NOISE_UM, False), (20.0 * NOISE_UM, True)])
def test_loops_are_seen_where_they_are_wider_than_the_noise(width_um: float, are_seen: bool) -> None:
    assert loops_are_seen(_stage(width_um), _split()) is are_seen


def test_the_loop_of_a_lag_is_none() -> None:
    lag = effect_classes()["transport_delay"].proposed([{"delay_s": 0.1}])[0]
    assert not loops_are_seen(_stage(0.0).with_cause(lag), _split())


@pytest.mark.parametrize(("width_um", "is_shown"), [(0.0, False), (20.0 * NOISE_UM, True)])
def test_a_bend_of_loops_is_implausible_where_there_are_none(width_um: float, is_shown: bool) -> None:
    bend = effect_classes()["asymmetric_hysteresis"].proposed([{"warp_per_v": 0.1}])[0]
    assert (implausible_in(_stage(width_um).with_cause(bend), _split()) == frozenset()) is is_shown
