"""Names are compared before more are sought where what is left is noise, and after everything else is.

The records are noise about a straight line; what a search would find in them is made up.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis import search
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.held_out_score import HeldOutScore
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

_NOISE_UM = 0.01


@pytest.fixture
def split() -> DataSplit:
    time_s = np.arange(600) / 100.0
    voltage_v = np.sin(2.0 * np.pi * 0.5 * time_s) * np.minimum(time_s, 1.0)
    records = [
        Recording(time_s, voltage_v, 2.0 * voltage_v + np.random.default_rng(k).normal(0.0, _NOISE_UM, time_s.size))
        for k in range(2)
    ]
    return split_data((records[0],), records[1], None, _NOISE_UM)


def _found(split: DataSplit) -> Candidate:
    chain = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((), ()))
    left = np.random.default_rng(2).normal(0.0, _NOISE_UM, split.train[0].time_s.size)
    fitted = Refit(chain, float(left @ left), (), (np.zeros((left.size, 0)),), (left,), True)
    return Candidate("transport_delay", fitted, HeldOutScore(4.0, 0.0, 1e-20, 1.0, math.exp(-2.0)), 4.0, (), 1)


@pytest.mark.parametrize(
    ("as_noise", "order"), [(1e9, ["asked", "look", "asked"]), (0.0, ["asked", "asked", "look"])], ids=["noise", "more"]
)
def test_where_noise_is_left_names_are_compared_before_more_are_sought(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, as_noise: float, order: list[str]
) -> None:
    monkeypatch.setattr(search, "AS_NOISE", as_noise)
    delay = _found(split)
    step = search.Step(delay.fitted.model, delay, (), ())
    compared = replace(step, margin=77.0)
    seen: list[str] = []
    found = iter([delay])

    def asked(state: SearchState, *_: object) -> tuple[list[Candidate], object]:
        seen.append("asked")
        candidate = next(found, None)
        return [], None if candidate is None else (state, candidate)

    def look(*_: object) -> search.LastLook:
        seen.append("look")
        return search.LastLook((compared,), None)

    monkeypatch.setattr(search, "_asked", asked)
    monkeypatch.setattr(search, "_last_look", look)
    monkeypatch.setattr(search, "screen", lambda *_: ())
    monkeypatch.setattr(search, "any_pair", lambda *_: None)
    monkeypatch.setattr(search, "with_finding", lambda state, *_: replace(state, steps=(step,)))
    result = search.search(delay.fitted.model, split, ("transport_delay",), lambda *_: None)
    assert seen == order
    assert result.steps == (compared,), "compared once, and so it stands"
