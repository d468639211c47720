"""The literal model (20)-(22) against the simplified one where both must agree, and where they may not."""

import numpy as np
import pytest

from fomrc_core.errors import ParameterError
from fomrc_core.model.literal_model import LiteralModel
from fomrc_core.model.piezo_model import PiezoModel

KAPPA = np.array([8.0, 20.0, 15.0, 1.3])
SATURATION = np.array([0.04, 0.03, 0.05])
RNG = np.random.default_rng(2)
STEPS = RNG.uniform(1e-3, 3e-3, 2000)
DRIVE = 2.0 * np.sin(np.cumsum(STEPS) * 4.0) + 0.3 * np.interp(
    np.arange(2000), np.arange(0, 2000, 50), RNG.normal(size=40)
)


def test_without_creep_the_two_models_are_the_same():
    literal = LiteralModel(KAPPA, SATURATION, 0.0).simulate(STEPS, DRIVE)
    np.testing.assert_allclose(literal, PiezoModel(KAPPA, SATURATION, 0.0).simulate(STEPS, DRIVE), atol=1e-6)


def test_while_nothing_saturates_the_two_models_are_the_same():
    small = 0.01 * DRIVE
    wide = 100.0 * SATURATION
    literal = LiteralModel(KAPPA, wide, 0.03).simulate(STEPS, small)
    np.testing.assert_allclose(literal, PiezoModel(KAPPA, wide, 0.03).simulate(STEPS, small), atol=1e-12)


def test_inverse_and_forward_undo_each_other():
    model = LiteralModel(KAPPA, SATURATION, np.array([0.02, 0.01, 0.05, 0.015]))
    reached = model.simulate(STEPS, DRIVE)
    np.testing.assert_allclose(model.invert(STEPS, reached), DRIVE, atol=1e-11)


def test_no_element_exceeds_its_saturation_voltage_and_frozen_charge_relaxes():
    """One element, saturated, then the displacement held: its voltage falls by t^-alpha, as (18) says."""
    kappa, saturation, order = np.array([10.0, 1.0]), np.array([0.05]), 0.1
    model = LiteralModel(kappa, saturation, order)
    times = np.geomspace(1e-3, 100.0, 400)
    steps = np.diff(np.append(0.0, times))
    held = np.full(times.size, 3.0)
    total = model.invert(steps, held)
    alone = LiteralModel(np.array([1e9, 1.0]), np.array([1.0]), order).invert(steps, held)
    element = total - alone
    assert element.max() <= 0.05 * (1 + 1e-12)
    assert element[0] == pytest.approx(0.05, rel=1e-6)
    assert np.all(np.diff(element) < 1e-12)
    assert element[-1] < 0.7 * element[0]


def test_the_simplification_costs_less_than_a_permille_of_the_range():
    literal = LiteralModel(KAPPA, SATURATION, 0.015).simulate(STEPS, DRIVE)
    simplified = PiezoModel(KAPPA, SATURATION, 0.015).simulate(STEPS, DRIVE)
    apart = np.sqrt(np.mean((literal - simplified) ** 2)) / np.ptp(literal)
    assert 1e-6 < apart < 1e-3


def test_state_goes_on_where_it_stopped():
    model = LiteralModel(KAPPA, SATURATION, 0.02)
    state = model.initial_state()
    parts = [model.simulate(STEPS[:700], DRIVE[:700], state), model.simulate(STEPS[700:], DRIVE[700:], state)]
    np.testing.assert_array_equal(np.concatenate(parts), model.simulate(STEPS, DRIVE))


def test_bad_input_is_named():
    with pytest.raises(ParameterError, match="creep"):
        LiteralModel(KAPPA, SATURATION, 1.0)
    with pytest.raises(ParameterError, match="steps_s"):
        LiteralModel(KAPPA, SATURATION, 0.1).simulate(np.ones(3), np.ones(4))
