"""Many actuators stepped together answer as each would alone."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.errors import ParameterError
from fomrc_core.model.actuator_array import ActuatorArray
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.influence_matrix import InfluenceMatrix
from fomrc_core.model.piezo_model import PiezoModel

N_SAMPLES = 300


def models(n: int = 9) -> list[PiezoModel]:
    """Different elements, different numbers of them, none among them, and creep orders from none to an integrator."""
    rng = np.random.default_rng(4)
    orders = [0.0, 1.0, *rng.uniform(0.005, 0.05, n - 2)]
    counts = [0, 3, *rng.integers(1, 12, n - 2)]
    return [
        PiezoModel(rng.uniform(1.0, 40.0, count + 1), rng.uniform(0.02, 0.2, count), order)
        for count, order in zip(counts, orders, strict=True)
    ]


@pytest.fixture(scope="module")
def array() -> ActuatorArray:
    return ActuatorArray(models())


def signals(n_actuators: int) -> tuple[np.ndarray, np.ndarray]:
    """Steps of two lengths and of any, and a random walk with rests for each actuator."""
    rng = np.random.default_rng(7)
    steps = np.where(np.arange(N_SAMPLES) % 100 < 70, 1e-3, 2.5e-3)
    steps[200:] = 1e-3 * rng.uniform(0.2, 5.0, 100)
    walk = np.cumsum(rng.standard_normal((N_SAMPLES, n_actuators)), axis=0)
    walk[50:60] = walk[50]
    return steps, 2.0 * walk / np.max(np.abs(walk), axis=0)


def test_each_answers_as_it_would_alone(array) -> None:
    steps, voltage = signals(array.n_actuators)
    moved = array.simulate(steps, voltage)
    back = array.compensate(steps, moved)
    for k, model in enumerate(array.models):
        alone = model.simulate(steps, voltage[:, k])
        assert np.max(np.abs(moved[:, k] - alone)) <= 1e-12 * np.max(np.abs(alone))
        wanted = Compensator(model).run(steps, moved[:, k])
        assert np.max(np.abs(back[:, k] - wanted)) <= 1e-11 * np.max(np.abs(wanted))
    assert np.max(np.abs(back - voltage)) <= 1e-10


@pytest.mark.parametrize("is_inverse", [False, True])
def test_step_by_step_and_after_a_pause_in_a_file(array, is_inverse) -> None:
    steps, values = signals(array.n_actuators)
    run = array.compensate if is_inverse else array.simulate
    whole = run(steps, values)
    state = array.initial_state(is_inverse=is_inverse)
    for k in range(N_SAMPLES):
        if k == 120:
            state = array.restore(json.loads(json.dumps(state.to_mapping())))
        answer = array.advance(state, values[k], float(steps[k]))
        assert np.max(np.abs(answer - whole[k])) <= 1e-11 * np.max(np.abs(whole))
    state = array.initial_state(is_inverse=is_inverse)
    parts = [run(steps[:77], values[:77], state), run(steps[77:], values[77:], state)]
    assert np.max(np.abs(np.concatenate(parts) - whole)) <= 1e-11 * np.max(np.abs(whole))


def test_a_copy_goes_its_own_way(array) -> None:
    state = array.initial_state()
    array.advance(state, np.ones(array.n_actuators), 1e-3)
    copy = state.copy()
    first = array.advance(state, np.zeros(array.n_actuators), 1e-3)
    assert np.array_equal(array.advance(copy, np.zeros(array.n_actuators), 1e-3), first)


def test_what_does_not_fit_is_named(array) -> None:
    n = array.n_actuators
    steps, voltage = signals(n)
    with pytest.raises(ParameterError, match="no actuator"):
        ActuatorArray([])
    with pytest.raises(ParameterError, match=r"models\[1\].*gain_drift"):
        ActuatorArray([models()[2], models()[3].with_effects(GainDrift(1e-3))])
    with pytest.raises(ParameterError, match="do not fit"):
        array.simulate(steps, voltage[:, :3])
    with pytest.raises(ParameterError, match="number of values"):
        array.advance(array.initial_state(), np.zeros(n + 1), 1e-3)
    for bad_step in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="step is not positive"):
            array.advance(array.initial_state(), np.zeros(n), bad_step)
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(ParameterError, match="not finite"):
            array.compensate(steps, np.where(voltage == voltage[9], bad, voltage))
    with pytest.raises(ParameterError, match="state of a simulation"):
        array.compensate(steps, voltage, array.initial_state())
    saved = array.initial_state().to_mapping()
    for change, words in (
        ({"plays": [[0.0]]}, "another array"),
        ({"step_s": -1.0}, "not finite"),
        ({"is_inverse": 3}, "not a saved state"),
        ({"modes": "all"}, "not a saved state"),
    ):
        with pytest.raises(ParameterError, match=words):
            array.restore({**saved, **change})
    with pytest.raises(ParameterError, match="not a saved state"):
        array.restore({})
    assert str(array).startswith("array of 9 actuators: 0 to 1")


def test_modes_of_a_surface_are_reached_through_the_actuators() -> None:
    rng = np.random.default_rng(5)
    places, points = rng.uniform(-1.0, 1.0, (40, 2)), rng.uniform(-0.8, 0.8, (300, 2))
    distance = np.linalg.norm(places[:, None] - points[None], axis=2)
    influence = np.exp(-((distance / 0.35) ** 2))
    x, y = points.T
    modes = np.vstack((np.ones_like(x), x, y, x**2 + y**2))
    plain = InfluenceMatrix(influence, modes, regularisation=0.0)
    wanted = np.array([0.3, -0.2, 0.1, 0.25])
    error = plain.surface_um(plain.displacements_um(wanted)) - wanted @ modes
    exact = np.linalg.lstsq(influence.T, wanted @ modes, rcond=None)[0]
    assert np.linalg.norm(error) == pytest.approx(np.linalg.norm(influence.T @ exact - wanted @ modes), rel=1e-6)
    # regularised: against the normal equations
    soft = InfluenceMatrix(influence, modes, regularisation=0.05)
    weight = 0.05 * np.linalg.svd(influence, compute_uv=False)[0]
    normal = np.linalg.solve(influence @ influence.T + weight**2 * np.eye(40), influence @ (wanted @ modes))
    assert soft.displacements_um(wanted) == pytest.approx(normal, rel=1e-8)
    assert np.linalg.norm(soft.displacements_um(wanted)) < np.linalg.norm(plain.displacements_um(wanted))
    # many targets at once, and each point a target of its own
    many = soft.displacements_um(np.stack((wanted, 2.0 * wanted)))
    assert many[1] == pytest.approx(2.0 * many[0])
    by_points = InfluenceMatrix(influence, regularisation=0.05)
    assert by_points.displacements_um(wanted @ modes) == pytest.approx(soft.displacements_um(wanted), rel=1e-6)


def test_targets_in_modes_then_compensated_for_each_actuator() -> None:
    array = ActuatorArray(models()[2:])
    influence = InfluenceMatrix(np.random.default_rng(8).uniform(0.0, 1.0, (array.n_actuators, 5)))
    t = 1e-3 * np.arange(1, N_SAMPLES + 1)
    targets = 0.2 * np.sin(np.outer(t, [5.0, 9.0, 12.0, 20.0, 31.0]))
    desired = influence.displacements_um(targets)
    steps = np.full(N_SAMPLES, 1e-3)
    reached = array.simulate(steps, array.compensate(steps, desired))
    assert influence.surface_um(reached) == pytest.approx(influence.surface_um(desired), abs=1e-9)
    plain = array.simulate(steps, desired)
    assert np.max(np.abs(influence.surface_um(plain) - influence.surface_um(desired))) > 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((np.zeros(3),), "not a matrix"),
        ((np.zeros((0, 3)),), "not a matrix"),
        ((np.full((2, 2), np.nan),), "not finite"),
        ((np.ones((2, 3)), np.ones((4, 2))), "number of points"),
        ((np.ones((2, 3)), None, -1.0), "regularisation"),
    ],
)
def test_an_influence_that_does_not_fit_is_named(arguments, words) -> None:
    with pytest.raises(ParameterError, match=words):
        InfluenceMatrix(*arguments)


def test_targets_that_do_not_fit_are_named() -> None:
    with pytest.raises(ParameterError, match="number of targets"):
        InfluenceMatrix(np.ones((2, 3))).displacements_um(np.zeros(2))
