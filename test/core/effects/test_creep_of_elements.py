"""What the model's elements have switched creeps the more the wider they are: by hand, in a fit, and in a diagnosis."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.linear_part import record_columns
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.known_target import KnownTarget
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import multisine
from fomrc_core.records.recording import Recording
from fomrc_core.storage import read_model, write_model

_THRESHOLDS_V, _WEIGHTS = (0.5, 2.0), (3.0, 1.0)
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, *_THRESHOLDS_V])), np.array([1.5, *_WEIGHTS]), 0.02, (), ((),))
_EFFECT = AmplitudeDependentCreep(0.0, 2.0, elements_per_decade=0.1, steepness=1.5, reach_v=3.0)


def _record(rate_hz: float = 50.0, seed: int = 0) -> FitRecord:
    rng = np.random.default_rng(seed)
    voltage_v = np.repeat(rng.uniform(-3.0, 3.0, 40), 25)
    voltage_v[0] = 0.0
    return FitRecord.of(Recording(np.arange(voltage_v.size) / rate_hz, voltage_v, voltage_v))


@pytest.mark.parametrize("order", [0.0, 0.03])
def test_each_element_grows_by_its_threshold_and_by_the_law_of_creep(order) -> None:
    effect = _EFFECT.beside_elements(np.array(_THRESHOLDS_V), np.array(_WEIGHTS), order)
    steps_s = np.diff(np.geomspace(1e-2, 1e3, 200), prepend=0.0)
    steps_s[0] = 1e-7
    found = effect.run(effect.initial_state(), np.zeros(200), steps_s, np.full(200, 2.5))
    after_s = np.cumsum(steps_s)[1:] - 0.5e-7
    grown = np.log10(after_s / 2.0) if order == 0.0 else ((after_s / 2.0) ** order - 1.0) / (order * math.log(10.0))
    # moved by 2.5 V: the plays by what is beyond their half widths
    shares = sum(w * 0.1 * (r / 3.0) ** 1.5 * (2.5 - r) for r, w in zip(_THRESHOLDS_V, _WEIGHTS, strict=True))
    # the power begins at a ten-thousandth of the onset, which a hundred times later is a hundredth
    late = after_s > 0.02
    np.testing.assert_allclose(found[1:][late], shares * grown[late], atol=0.01 * shares)


def test_without_the_drive_or_without_elements_nothing_is_added() -> None:
    effect, values, steps_s = _EFFECT, np.linspace(0.0, 2.0, 30), np.full(30, 0.1)
    assert np.array_equal(effect.run(effect.initial_state(), values, steps_s, values), values)
    beside = effect.beside_elements(np.array(_THRESHOLDS_V), np.array(_WEIGHTS), 0.0)
    assert np.array_equal(beside.run(beside.initial_state(), values, steps_s), values)
    with pytest.raises(ParameterError, match="lists differ"):
        AmplitudeDependentCreep(0.0, 1.0, thresholds_v=(1.0,))


def test_the_columns_of_a_fit_are_what_the_chain_gives_for_their_weights() -> None:
    record, model = _record(), _PLAIN.with_cause(_EFFECT)
    columns = record_columns(model, record, 0)
    np.testing.assert_allclose(columns @ model.weights, predict(model, record, 0), atol=1e-9)
    assert not np.allclose(columns, record_columns(_PLAIN, record, 0), atol=1e-2)


def test_in_a_fit_it_is_of_the_elements_there_are() -> None:
    (effect,) = _PLAIN.with_cause(_EFFECT).effects_in(0)
    assert effect.thresholds_v == _THRESHOLDS_V
    assert effect.weights_um_per_v == _WEIGHTS
    assert effect.creep_order == _PLAIN.creep_order
    assert _EFFECT.free_names() == ("elements_per_decade", "steepness")


def test_a_file_keeps_it_and_an_old_file_is_read_as_before(tmp_path) -> None:
    effect = _EFFECT.beside_elements(np.array(_THRESHOLDS_V), np.array(_WEIGHTS), 0.02)
    model = PiezoModel([1.0, 2.0, 0.5], [0.5, 0.7], 0.02, (effect,))
    write_model(model, tmp_path / "model.yaml")
    (read,) = read_model(tmp_path / "model.yaml").effects
    assert read == effect
    old = {"per_decade_per_um": 0.0, "onset_s": 0.1, "switched_per_decade": 0.02, "reach_um": 3.0}
    found = AmplitudeDependentCreep.from_mapping(old, "here")
    assert not found.follows_elements
    assert found.run(found.initial_state(), np.ones(5), np.ones(5)).shape == (5,)


def _settling_relays(voltage_v: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return the motion [um] of relays that flip at once by half, and then settle: the wider, the more they have to.

    Of three widths alone. They settle by one exponential a decade, from a sample to longer than the record: no plays
    here, and no power of time.
    """
    half_widths_v, centres_v = (g.ravel() for g in np.meshgrid([0.3, 1.0, 2.1], np.linspace(-2.9, 2.9, 1500)))
    states = np.where(centres_v > 0.0, -1.0, 1.0)
    gone = [math.exp(-1.0 / (rate_hz * time_s)) for time_s in np.geomspace(0.5 / rate_hz, 5e3 / rate_hz, 5)]
    late = np.zeros(5)
    out = np.empty(voltage_v.size)
    share = 0.01 + 0.12 * (half_widths_v / 3.0) ** 1.3
    for k, u in enumerate(voltage_v):
        states = np.where(u > centres_v + half_widths_v, 1.0, np.where(u < centres_v - half_widths_v, -1.0, states))
        target = float(share @ states)
        late = np.array([g * z + (1.0 - g) * target for g, z in zip(gone, late, strict=True)])
        out[k] = float(states.sum()) + float(late.sum())
    return 2e-3 * out + 2.0 * voltage_v


@pytest.fixture(scope="module", name="settling")
def _settling() -> tuple[Recording, Recording]:
    rate_hz, records = 100.0, []
    for seed in (3, 4):
        rng = np.random.default_rng(seed)
        levels = np.concatenate([[0.0], rng.uniform(-2.9, 2.9, 60)])
        swept = multisine(2.9, lowest_hz=0.2, highest_hz=2.0, period_s=10.0, n_periods=1, rate_hz=rate_hz).voltage_v
        slow = np.repeat(levels, rng.integers(10, 60, levels.size))
        voltage_v = np.concatenate([swept, slow])
        measured_um = _settling_relays(voltage_v, rate_hz) + rng.normal(0.0, 8e-3, voltage_v.size)
        records.append(Recording(np.arange(voltage_v.size) / rate_hz, voltage_v, measured_um))
    return records[0], records[1]


def test_relays_that_settle_the_more_the_wider_they_are_are_told(settling) -> None:
    found = diagnose(settling[0], test=settling[1])
    first = found.findings[0]
    assert first.cause == "amplitude_dependent_creep"
    assert first.parameters["elements_per_decade"] > 0.0


def test_a_fit_of_it_leaves_less_than_one_of_plays_of_the_displacement(settling) -> None:
    records = (FitRecord.of(settling[0]),)
    grid_v = np.linspace(0.0, 3.0, 31)
    base = TrialModel(ColumnKinds.plays(grid_v), np.full(31, 0.1), 0.01, (), ((),), grid_v)
    ways = (AmplitudeDependentCreep(0.0, 0.5, elements_per_decade=0.01, reach_v=3.0),)
    ways += (AmplitudeDependentCreep(0.0, 0.01, switched_per_decade=0.01, reach_um=6.0),)
    errors = [fit_until_still(base.with_cause(way), records).squared_error for way in ways]
    assert errors[0] < 0.7 * errors[1]


def test_a_target_known_as_a_whole_is_reached_beside_it() -> None:
    plain = PiezoModel([1.5, 3.0, 1.0], [1.5, 2.0], 0.02)
    effect = _EFFECT.beside_elements(plain.play_form.thresholds, plain.play_form.weights, plain.creep_order)
    time_s = 1e-2 * np.arange(800)
    desired_um = 3.0 * np.sin(0.5 * np.pi * time_s) * np.minimum(1.0, time_s)
    found = DynamicInverse(plain.with_effects(effect)).run(KnownTarget(time_s, 1e-2, desired_um))
    assert not found.not_inverted
    assert np.max(np.abs(found.reached_um - desired_um)[found.n_first :]) < 1e-3
