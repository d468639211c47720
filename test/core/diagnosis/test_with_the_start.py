"""Loads that come with the beginnings of all records are no loads; those that come at any time, or at rest, are."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.with_the_start import comes_with_the_start
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

_DURATIONS_S = (10.0, 6.0, 8.0)
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((), (), ()))


def _split(rests_s: float, unit_s: float = 1.0) -> DataSplit:
    rng = np.random.default_rng(1)
    records = []
    for duration in _DURATIONS_S:
        time_s = np.arange(int(200 * duration)) / 200.0
        drive_v = np.sin(3.0 * np.maximum(time_s - rests_s, 0.0))
        records.append(Recording(unit_s * time_s, drive_v, 2.0 * drive_v + rng.normal(0.0, 1e-3, time_s.size)))
    return split_data((records[0],), records[1], records[2], 1e-3)


def _loads(*shares: float, unit_s: float = 1.0) -> TrialModel:
    model = _PLAIN
    for index, (share, duration_s) in enumerate(zip(shares, _DURATIONS_S, strict=False)):
        model = model.with_cause(ExternalLoad(0.1, share * duration_s * unit_s), index)
    return model


@pytest.mark.parametrize("unit_s", [1.0, 1e-5, 1e4])
def test_moments_soon_after_every_beginning_are_not_by_chance(unit_s: float) -> None:
    split = _split(0.0, unit_s)
    assert comes_with_the_start(_loads(0.02, 0.05, 0.07, unit_s=unit_s), split, "external_load")
    assert not comes_with_the_start(_loads(0.02, 0.5, 0.4, unit_s=unit_s), split, "external_load")


def test_uniform_moments_are_taken_for_it_about_once_in_a_hundred_times() -> None:
    split, rng = _split(0.0), np.random.default_rng(2)
    n = sum(comes_with_the_start(_loads(*rng.uniform(size=3)), split, "external_load") for _ in range(2000))
    assert 8 <= n <= 35


def test_where_the_drive_still_rests_or_one_record_tells_it_is_a_load() -> None:
    assert not comes_with_the_start(_loads(0.02, 0.05, 0.07), _split(2.0), "external_load")
    assert not comes_with_the_start(_loads(0.001), _split(0.0), "external_load")
    drift = _PLAIN.with_cause(ThermalDrift(um_per_s=1e-3), 0).with_cause(ThermalDrift(um_per_s=1e-3), 1)
    assert not comes_with_the_start(drift, _split(0.0), "thermal_drift")
