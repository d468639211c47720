"""The past of an actuator is where a model starts: a field of its own, and a block of a model file like an effect's."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.errors import InputError
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory

_MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)  # type: ignore[arg-type]
_PAST = Prehistory(extreme_v=2.0, resting_v=-0.3, held_s=3.0, resting_s=10.0)
_STEPS_S = np.full(400, 1e-3)
_VOLTAGE_V = np.round(np.sin(np.cumsum(_STEPS_S) * 25.0) - 0.3, 3)


def test_a_start_is_what_its_drive_leaves() -> None:
    found = _MODEL.with_start(_PAST).simulate(_STEPS_S, _VOLTAGE_V)
    # the same past on a fine uniform grid: two ramps of 0.2 s and the two holds
    up, down = np.linspace(0.01, 2.0, 200), np.linspace(2.0 - 0.0115, -0.3, 200)
    before = np.concatenate((up, np.full(3000, 2.0), down, np.full(10_000, -0.3)))
    steps_s = np.concatenate((np.full(before.size, 1e-3), _STEPS_S))
    wanted = _MODEL.simulate(steps_s, np.concatenate((before, _VOLTAGE_V)))
    assert np.max(np.abs(found - wanted[before.size :])) <= 1e-5 * np.ptp(wanted)


def test_a_start_moves_what_lasts_and_no_clock_of_the_record() -> None:
    effects = (AmplifierBandwidth(40.0), SlowRelaxation(0.1, 0.05), ClockSkew(300.0), GainDrift(0.01))
    state = _MODEL.with_effects(*effects).with_start(_PAST).initial_state()
    assert np.all(state.effects["amplifier_bandwidth"] != 0.0)
    assert np.all(state.effects["slow_relaxation"] != 0.0)
    assert not np.any(state.effects["clock_skew"])
    assert not np.any(state.effects["gain_drift"])


def test_a_file_names_it_among_the_effects_as_ever() -> None:
    model = _MODEL.with_effects(SlowRelaxation(0.1, 0.05), AmplifierBandwidth(40.0)).with_start(_PAST)
    mapping = model.to_mapping()
    assert mapping["effects"] == ["amplifier_bandwidth", "initial_state", "slow_relaxation"]
    assert mapping["initial_state"] == {"extreme_v": 2.0, "resting_v": -0.3, "held_s": 3.0, "resting_s": 10.0}
    back = PiezoModel.from_mapping(json.loads(json.dumps(mapping)))
    assert back.start == _PAST
    assert back.effects == model.effects
    assert "initial_state" in dict(Compensator(back).not_inverted)


@pytest.mark.parametrize(
    ("block", "named"),
    [
        ({"extreme_v": "a"}, "initial_state.extreme_v"),
        ({"held_s": 0.0}, "initial_state.held_s"),
        ({"held": 1.0}, "held"),
        (3.0, "model.initial_state"),
    ],
)
def test_a_bad_block_is_named(block: object, named: str) -> None:
    mapping = {**_MODEL.to_mapping(), "effects": ["initial_state"], "initial_state": block}
    with pytest.raises(InputError, match=named):
        PiezoModel.from_mapping(mapping)


def test_it_stands_among_the_causes_behind_the_hysteresis() -> None:
    names = list(cause_classes())
    assert names.index("asymmetric_hysteresis") < names.index("initial_state") < names.index("slow_relaxation")
    assert cause_classes()["initial_state"] is Prehistory


def test_what_is_shorter_than_a_sample_is_no_past() -> None:
    step_s, duration_s = 2e-5, 0.01
    assert not Prehistory(-11.2, 0.0, 1e-6, 3e-6).is_plausible(duration_s, step_s)
    assert Prehistory(-11.2, 0.0, 1e-6, 3e-4).is_plausible(duration_s, step_s)
    assert Prehistory(-11.2, 0.0, 1e-3, 3e-6).is_plausible(duration_s, step_s)
    assert Prehistory.long_rest(1.0).is_plausible(duration_s, 1e4), "a plain rest is no excursion, however long"
