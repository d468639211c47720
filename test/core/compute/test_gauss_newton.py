"""The one descent of all fits, on problems with known answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from fomrc_core.compute.gauss_newton import Linearized, damped_step, descend
from fomrc_core.compute.least_squares import NormalEquations, normal_equations

# Misra1a of the NIST Statistical Reference Datasets (dental research, monomolecular adsorption): y against x,
# y = b1 (1 - exp(-b2 x)); certified values and the residual sum of squares.
_X = np.array([77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0])
_Y = np.array([10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.4, 75.47, 81.78])
_CERTIFIED, _CERTIFIED_SQUARES = (238.94212918, 5.5015643181e-4), 1.2455138894e-1


@dataclass(frozen=True, eq=False)
class _Point:
    at: np.ndarray
    residual: np.ndarray

    @property
    def squared_error(self) -> float:
        return float(self.residual @ self.residual)


def _linearize(
    residual: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    longest: float = math.inf,
) -> Callable[[_Point], Linearized[_Point]]:
    """Residual is data less model; the Jacobian is that of the model."""

    def about(point: _Point) -> Linearized[_Point]:
        everywhere = np.ones(point.residual.size, dtype=bool)
        equations = normal_equations([(jacobian(point.at), point.residual, everywhere)])

        def stepped(step: np.ndarray) -> _Point | None:
            at = point.at + step
            return _Point(at, residual(at)) if np.all(np.isfinite(residual(at))) else None

        return Linearized(equations, stepped, np.full(point.at.size, longest))

    return about


def _misra(at: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        return _Y - at[0] * -np.expm1(-at[1] * _X)


def _misra_jacobian(at: np.ndarray) -> np.ndarray:
    return np.column_stack((-np.expm1(-at[1] * _X), at[0] * _X * np.exp(-at[1] * _X)))


@pytest.mark.parametrize("start", [(500.0, 1e-4), (250.0, 5e-4)])
def test_certified_values_of_misra_are_reached_from_both_certified_starts(start: tuple[float, float]) -> None:
    at = np.array(start)
    found = descend(_Point(at, _misra(at)), _linearize(_misra, _misra_jacobian), n_iterations=100, least_gain=1e-15)
    assert found.is_converged
    assert found.point.at == pytest.approx(_CERTIFIED, rel=1e-8)
    assert found.point.squared_error == pytest.approx(_CERTIFIED_SQUARES, rel=1e-10)


def test_the_valley_of_rosenbrock_is_followed_to_its_end() -> None:
    def residual(at: np.ndarray) -> np.ndarray:
        return np.array([10.0 * (at[1] - at[0] ** 2), 1.0 - at[0]])

    def jacobian(at: np.ndarray) -> np.ndarray:
        return -np.array([[-20.0 * at[0], 10.0], [-1.0, 0.0]])

    at = np.array([-1.2, 1.0])
    found = descend(_Point(at, residual(at)), _linearize(residual, jacobian), n_iterations=200, least_gain=1e-12)
    assert found.point.at == pytest.approx([1.0, 1.0], abs=1e-6)


def test_no_step_is_longer_than_allowed() -> None:
    visited = []

    def residual(at: np.ndarray) -> np.ndarray:
        visited.append(float(at[0]))
        return 100.0 - at

    linearize = _linearize(residual, lambda at: np.eye(1), longest=1.0)
    found = descend(_Point(np.zeros(1), np.full(1, 100.0)), linearize, n_iterations=5, least_gain=0.0)
    assert found.point.at[0] == pytest.approx(5.0)
    assert not found.is_converged
    assert np.max(np.diff(np.unique(visited))) <= 1.0 + 1e-12


def test_a_linearization_that_leads_nowhere_is_renewed_once_and_then_given_up() -> None:
    wrong = [True]

    def linearize(point: _Point) -> Linearized[_Point]:
        sign = -1.0 if wrong[0] else 1.0
        return _linearize(lambda at: 3.0 - at, lambda at: sign * np.eye(1))(point)

    def renew(point: _Point) -> _Point | None:
        if not wrong[0]:
            return None
        wrong[0] = False
        return point

    found = descend(_Point(np.zeros(1), np.full(1, 3.0)), linearize, n_iterations=20, least_gain=1e-9, renew=renew)
    assert found.point.at[0] == pytest.approx(3.0, rel=1e-4)
    wrong[0] = True
    stuck = descend(_Point(np.zeros(1), np.full(1, 3.0)), linearize, n_iterations=20, least_gain=1e-9)
    assert stuck.is_converged
    assert stuck.n_iterations == 1
    assert stuck.point.at[0] == 0.0


def test_old_directions_that_mend_nothing_are_made_anew_before_a_step_is_damped() -> None:
    tried: list[np.ndarray] = []

    def linearize(point: _Point) -> Linearized[_Point]:
        def stepped(step: np.ndarray) -> _Point:
            tried.append(step)
            at = point.at + step
            # what follows along old directions adds to the error, however short the step
            return _Point(at, np.array([5.0 if is_old[0] else at[0] - 3.0]))

        equations = NormalEquations(np.eye(1), 3.0 - point.at)
        return Linearized(equations, stepped, np.full(1, np.inf), further_gain=1.0, is_old=is_old[0])

    def renew(point: _Point) -> _Point | None:
        if not is_old[0]:
            return None
        is_old[0] = False
        return point

    is_old = [True]
    found = descend(_Point(np.zeros(1), np.full(1, 3.0)), linearize, n_iterations=9, least_gain=1e-9, renew=renew)
    assert found.point.at[0] == pytest.approx(3.0, rel=1e-4)
    assert np.count_nonzero(tried[0])
    assert not np.any(tried[1]), "after a refusal no step at all is asked"
    assert np.count_nonzero(tried[2]), "and then a step with new directions"


def test_a_hopeless_start_is_given_up_after_the_iterations_it_was_granted() -> None:
    linearize = _linearize(lambda at: 100.0 - at, lambda at: np.eye(1), longest=1.0)
    found = descend(
        _Point(np.zeros(1), np.full(1, 100.0)),
        linearize,
        n_iterations=50,
        least_gain=0.0,
        is_hopeless=lambda n_done, point: n_done >= 4 and point.squared_error > 10.0,
    )
    assert found.n_iterations == 4
    assert not found.is_converged


def test_a_fit_of_nothing_is_at_rest_and_one_of_no_iterations_is_refused() -> None:
    linearize = _linearize(lambda at: np.ones(3), lambda at: np.zeros((3, 0)))
    point = _Point(np.zeros(0), np.ones(3))
    assert descend(point, linearize, n_iterations=3, least_gain=1e-3).is_converged
    with pytest.raises(ValueError, match="n_iterations"):
        descend(point, linearize, n_iterations=0, least_gain=1e-3)


def test_a_direction_that_does_not_act_stays_and_units_do_not_matter() -> None:
    gram, moment = np.diag([4.0, 0.0, 9e-12]), np.array([8.0, 0.0, 27e-12])
    for damping in (1e-9, 1e-3):
        step = damped_step(NormalEquations(gram, moment), damping)
        assert step == pytest.approx(np.array([2.0, 0.0, 3.0]) / (1.0 + damping), rel=1e-12)


def test_a_descent_tells_how_much_its_last_step_gained() -> None:
    met: list[_Point] = []

    def note(n_done: int, point: _Point) -> bool:
        met.append(point)
        return False

    start = np.array([500.0, 1e-4])
    found = descend(
        _Point(start, _misra(start)),
        _linearize(_misra, _misra_jacobian),
        n_iterations=3,
        least_gain=1e-12,
        is_hopeless=note,
    )
    assert not found.is_converged
    before, after = met[-1].squared_error, found.point.squared_error
    assert found.last_log_gain == pytest.approx(math.log(before / after))
    assert found.last_log_gain > 0.1
