"""Plays chosen anew from a grid: the same whichever way what the model gives now is known."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.fitting import base_fit
from fomrc_core.fitting.base_fit import rebased, threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import residuals
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording
from test.core.driven_plays import states_of_plays, sum_of_lines


def _model_and_records() -> tuple[TrialModel, tuple[FitRecord, ...]]:
    rng = np.random.default_rng(4)
    time_s = np.arange(1500) / 200.0
    drive_v = np.minimum(time_s, 1.0) * sum_of_lines(rng, time_s, 0.2, 2.0)
    moved_um = states_of_plays(np.array([0.0, 0.2, 0.5]), drive_v) @ np.array([1.2, 0.3, 0.2])
    record = FitRecord.of(Recording(time_s, drive_v, moved_um + rng.normal(0.0, 1e-3, time_s.size)))
    grid_v = threshold_grid((record,), 30)
    own = AsymmetricHysteresis((0.0, 0.3), (0.1, -0.2), (0.02, 0.05))
    columns = ColumnKinds.plays(grid_v[[0, 4, 9, 15]]).joined(ColumnKinds.plays_of(own))
    nothing = np.zeros(0)
    effects = (own.with_plays(nothing, nothing, nothing),)
    weights = np.array([1.1, 0.2, 0.3, 0.1, 0.02, 0.05])
    return TrialModel(columns, weights, 0.01, effects, ((),), grid_v=grid_v), (record,)


def test_plays_are_chosen_alike_from_the_grid_and_from_columns_of_the_model_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, records = _model_and_records()
    found = rebased(model, records)
    known = rebased(model, records, residuals(model, records))
    monkeypatch.setattr(base_fit, "_among", lambda *_: None)
    of_columns = rebased(model, records)
    for other in (known, of_columns):
        assert np.array_equal(found.columns.thresholds_v, other.columns.thresholds_v)
        assert other.weights == pytest.approx(found.weights, rel=1e-6, abs=1e-9)
    assert found.n_owned == 2


def test_plays_that_are_not_of_the_grid_have_columns_of_their_own() -> None:
    model, _ = _model_and_records()
    assert model.grid_v is not None
    weights = base_fit._among(model, model.grid_v, model.grid_v.size + 2)
    assert weights is not None
    assert weights[[0, 4, 9, 15, -2, -1]] == pytest.approx(model.weights)
    assert base_fit._among(model, model.grid_v + 1e-9, model.grid_v.size + 2) is None
