"""A model replaced while it runs: what the past has left is taken over, what the model is is the new one's."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.control.actuator_memory import ActuatorMemory, carried
from fomrc_core.effects import Effect
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.missing_hysteresis import MissingHysteresis
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

KAPPA, SATURATION_V, STEP_S = np.array([1.5, 3.0, 1.0]), np.array([1.0, 2.0]), 0.01


def stage_with(effect: Effect) -> PiezoModel:
    return PiezoModel(KAPPA, SATURATION_V, 0.02, (effect,))


def one_sided(weight: float) -> AsymmetricHysteresis:
    return AsymmetricHysteresis((0.0, 0.5), (0.2, 0.4), (weight, 0.1))


def further(weight: float) -> MissingHysteresis:
    return MissingHysteresis(1.0, (0.3, 0.6), (weight, 0.1))


def creeping(size: float) -> AmplitudeDependentCreep:
    return AmplitudeDependentCreep(0.0, 0.1, size, 2.0, size, thresholds_v=(0.5, 1.0), weights_um_per_v=(1.0, 2.0))


@pytest.mark.parametrize("kind", [one_sided, further])
def test_the_voltage_is_that_of_the_model_in_force_and_not_of_the_one_before(kind) -> None:
    old, new = Compensator(stage_with(kind(0.1))), Compensator(stage_with(kind(0.8)))
    taken, fresh = carried(old, new, ActuatorMemory.relaxed(old)), ActuatorMemory.relaxed(new)
    wanted_um = np.linspace(0.0, 2.0, 30)
    voltages = [[memory.advance(new, w, STEP_S) for w in wanted_um] for memory in (taken, fresh)]
    np.testing.assert_array_equal(*voltages)
    stays = ActuatorMemory.relaxed(old)
    assert abs(stays.advance(old, 2.0, STEP_S) - voltages[0][-1]) > 0.1, "another voltage than that of the one before"


@pytest.mark.parametrize("kind", [one_sided, further, creeping])
def test_where_the_plays_stand_is_taken_over_and_what_they_are_is_not(kind) -> None:
    before, after = kind(0.1), kind(0.8)
    steps_s, drive_v = np.full(40, STEP_S), 2.0 * np.sin(np.linspace(0.0, 4.0, 40))
    state = before.initial_state()
    before.run(state, drive_v, steps_s, drive_v)
    found = after.carried_state(state)
    # of the same size where it has just as well moved itself
    moved = after.initial_state()
    after.run(moved, drive_v, steps_s, drive_v)
    own = np.flatnonzero(after.initial_state())
    np.testing.assert_array_equal(found[own], after.initial_state()[own])
    plays = np.flatnonzero((after.initial_state() == 0.0) & (moved == state))
    assert np.any(found[plays] != 0.0)
    np.testing.assert_array_equal(found[plays], moved[plays])


def test_relaxations_that_were_not_there_begin_settled_where_the_stage_stands() -> None:
    old = CreepLaw(first_share=0.1, first_s=0.05)
    state = old.initial_state()
    old.run(state, np.full(400, 3.0), np.full(400, STEP_S))
    new = CreepLaw(first_share=0.1, first_s=0.05, second_share=0.2, second_s=5.0)
    crept_um = new.run(new.carried_state(state), np.array([3.0]), np.array([STEP_S]))
    assert crept_um == pytest.approx(3.0 * (1.0 + 0.1 + 0.2), rel=1e-6)
    more = CreepLaw(first_share=0.3, first_s=0.05)
    np.testing.assert_array_equal(more.carried_state(state), state)


def test_what_has_another_shape_begins_at_rest() -> None:
    for effect in (one_sided(0.1), further(0.1), creeping(0.1)):
        np.testing.assert_array_equal(effect.carried_state(np.ones(3)), effect.initial_state())
