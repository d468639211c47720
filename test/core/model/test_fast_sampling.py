"""A power law has no time scale: what holds at a millisecond a sample holds at a microsecond."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.errors import ParameterError
from fomrc_core.identification.convex import identify
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.creep import SHORTEST_TIME_S, shortest_time_for
from fomrc_core.records.recording import Recording

_ORDER = 0.03


def drive(n: int) -> np.ndarray:
    levels = np.random.default_rng(4).uniform(-2.0, 2.0, 60)
    return np.interp(np.arange(n), np.linspace(0, n, 60), np.concatenate(([0.0], levels[1:])))


@pytest.mark.parametrize("faster", [1.0, 30.0, 1e4])
def test_a_record_played_faster_is_the_same_record_but_for_a_factor(faster):
    step_s, voltage_v = 1e-3, drive(3000)
    slow = PiezoModel([2.0, 1.0], [0.5], _ORDER)
    quick = PiezoModel([2.0, 1.0], [0.5], _ORDER, shortest_time_s=shortest_time_for(step_s / faster))
    expected = slow.simulate(np.full(3000, step_s), voltage_v)
    found = quick.simulate(np.full(3000, step_s / faster), voltage_v)
    # s^-alpha: a record c times as fast is c^-alpha as high (Caputo's integral, scaled)
    np.testing.assert_allclose(found * faster**_ORDER, expected, rtol=0.0, atol=2e-5 * np.ptp(expected))


def test_a_model_of_fast_records_is_identified_inverted_and_stored_as_one():
    steps_s, voltage_v = np.full(4000, 1e-5), drive(4000)
    truth = PiezoModel([2.0, 1.0], [0.5], _ORDER, shortest_time_s=1e-7)
    moved_um = truth.simulate(steps_s, voltage_v)
    noise_um = 1e-4 * np.random.default_rng(1).standard_normal(4000)
    model = identify(Recording(np.cumsum(steps_s), voltage_v, moved_um + noise_um), n_elements=3).model
    assert model.creep_order == pytest.approx(_ORDER, abs=2e-4)
    assert PiezoModel.from_mapping(model.to_mapping()).shortest_time_s == model.shortest_time_s < 1e-5
    np.testing.assert_allclose(
        Compensator(model).run(steps_s, model.simulate(steps_s, voltage_v)), voltage_v, atol=1e-9
    )


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), 1.0, "short", True])
def test_a_shortest_time_that_is_none_is_refused(value):
    with pytest.raises(ParameterError, match="shortest_time_s"):
        PiezoModel([2.0, 1.0], [0.5], _ORDER, shortest_time_s=value)


def test_models_of_slow_records_are_stored_as_before():
    assert "shortest_time_s" not in PiezoModel([2.0, 1.0], [0.5], _ORDER).to_mapping()
    assert shortest_time_for(1e-3) == pytest.approx(SHORTEST_TIME_S)
