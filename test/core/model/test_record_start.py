"""The beginning of a record: state and offset found from the first samples, the rest predicted from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.record_start import estimate_start, relaxed_start, simulate_from
from fomrc_core.records.recording import Recording

_STEP_S = 1e-3
_MODEL = PiezoModel([10.0, 25.0, 50.0, 1.3], [0.05, 0.1, 0.04], 0.015)  # type: ignore[arg-type]


def _record(past_v: list[float], past_s: float, offset_um: float = -120.0) -> tuple[Recording, np.ndarray]:
    """A sine about 1 V after some past, measured with 1 nm of noise; and what moved."""
    state = _MODEL.initial_state()
    if past_v:
        past = np.concatenate([np.linspace(a, b, 200) for a, b in zip([0.0, *past_v], past_v, strict=False)])
        _MODEL.simulate(np.full(past.size, _STEP_S), past, state)
        _MODEL.simulate(np.full(50, past_s / 50), np.full(50, past[-1]), state)
    time_s = np.arange(20_000) * _STEP_S
    voltage_v = 1.0 + np.sin(2.0 * np.pi * 0.3 * time_s)
    if not past_v:
        voltage_v = voltage_v - 1.0
    moved_um = _MODEL.simulate(np.full(time_s.size, _STEP_S), voltage_v, state)
    noise_um = np.random.default_rng(5).normal(0.0, 1e-3, time_s.size)
    return Recording(time_s, voltage_v, moved_um + offset_um + noise_um), moved_um + offset_um


@pytest.mark.parametrize(
    ("past_v", "past_s", "expected"),
    [
        ([], 1.0, "relaxed"),
        ([1.0], 1000.0, "rested at 1 V"),
        ([2.0, 1.0], 0.5, "come just from 2 V to 1 V"),
        ([2.0, 1.0], 1000.0, "come long ago from 2 V to 1 V"),
    ],
)
def test_the_start_is_told_from_the_others_and_the_rest_predicted(
    past_v: list[float], past_s: float, expected: str
) -> None:
    record, truth_um = _record(past_v, past_s)
    start = estimate_start(_MODEL, record)
    assert start.description == expected
    assert start.n_samples == 2000
    predicted_um = simulate_from(_MODEL, record, start)
    # 10 nm on a stroke of 2.5 um: the past is only like the one tried, and its creep goes on.
    np.testing.assert_allclose(predicted_um[2000:], truth_um[2000:], atol=1e-2)


def test_a_wrong_start_costs_what_the_estimate_saves() -> None:
    record, truth_um = _record([2.0, 1.0], 0.5)
    relaxed = simulate_from(_MODEL, record, relaxed_start(_MODEL, record))
    found = simulate_from(_MODEL, record, estimate_start(_MODEL, record))
    assert np.std(relaxed - truth_um) > 5.0 * np.std(found - truth_um)


def test_the_offset_is_the_mean_difference_of_the_first_samples() -> None:
    record, _ = _record([], 1.0, offset_um=7.0)
    assert relaxed_start(_MODEL, record).offset_um == pytest.approx(7.0, abs=1e-4)


def test_without_displacement_there_is_nothing_to_choose() -> None:
    record, _ = _record([], 1.0)
    start = estimate_start(_MODEL, Recording(record.time_s, record.voltage_v))
    assert (start.description, start.offset_um, start.n_samples) == ("relaxed", 0.0, 0)


def test_the_models_own_initial_state_is_used() -> None:
    record, truth_um = _record([2.0, 1.0], 0.5)
    model = _MODEL.with_start(Prehistory(2.0, 1.0, 0.2, 0.5))
    start = estimate_start(model, record)
    assert start.description == "as the model's initial_state says"
    np.testing.assert_allclose(simulate_from(model, record, start), truth_um, atol=5e-3)


def test_simulating_leaves_the_start_as_it_is() -> None:
    record, _ = _record([1.0], 10.0)
    start = estimate_start(_MODEL, record)
    np.testing.assert_array_equal(simulate_from(_MODEL, record, start), simulate_from(_MODEL, record, start))
    np.testing.assert_array_equal(simulate_from(_MODEL, record, start, 50), simulate_from(_MODEL, record, start)[:50])


@pytest.mark.parametrize("cut", [3456, 5678, 6543, 7890, 9999])
def test_a_record_that_begins_in_mid_motion_is_predicted_from_its_first_sample(cut: int) -> None:
    time_s = np.arange(20_000) * _STEP_S
    voltage_v = 1.0 + (0.6 + 0.4 * np.cos(2.0 * np.pi * 0.07 * time_s)) * np.sin(2.0 * np.pi * 0.9 * time_s)
    truth_um = _MODEL.simulate(np.full(time_s.size, _STEP_S), voltage_v)
    noise_um = np.random.default_rng(cut).normal(0.0, 1e-3, time_s.size)
    record = Recording(time_s[cut:], voltage_v[cut:], (truth_um + noise_um)[cut:] - 120.0)
    start = estimate_start(_MODEL, record)
    left_um = simulate_from(_MODEL, record, start) - (truth_um[cut:] - 120.0)
    # of a stroke of 2.5 um, from the first sample on; a rest or one excursion leave up to 42 nm
    assert float(np.max(np.abs(left_um))) < 0.012
    assert float(np.sqrt(np.mean(left_um[:2000] ** 2))) < 4e-3
    assert start.description.startswith("in motion, about")


def test_a_spike_in_the_first_samples_changes_no_start() -> None:
    record, _ = _record([2.0, 1.0], 0.5)
    spoilt = record.measured_um.copy()
    spoilt[[20, 300]] += 50.0
    masked = np.ones(record.n_samples, dtype=bool)
    masked[[20, 300]] = False
    found = estimate_start(_MODEL, replace(record, displacement_um=spoilt, is_valid=masked))
    assert found.offset_um == pytest.approx(estimate_start(_MODEL, record).offset_um, abs=1e-4)
