"""Least squares over several records against numpy's and scipy's own, and the conditions of optimality."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.compute import least_squares
from fomrc_core.compute.least_squares import (
    chi_squared,
    covariance_of,
    non_negative_fit,
    non_negative_weights,
    normal_equations,
    product,
    signed_weights,
    variances_of,
    whitening_of,
)
from fomrc_core.compute.pulse import heard_by

_RNG = np.random.default_rng(7)


def _records() -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    return [
        (_RNG.standard_normal((n, 4)) * [1e-3, 1.0, 50.0, 1.0], _RNG.standard_normal(n), _RNG.random(n) < share)
        for n, share in ((60, 0.7), (45, 1.1))
    ]


def test_the_solution_is_that_of_the_stacked_used_samples() -> None:
    records = _records()
    stacked = np.vstack([c[u] for c, _, u in records])
    target = np.concatenate([t[u] for _, t, u in records])
    expected = np.linalg.lstsq(stacked, target, rcond=None)[0]
    assert normal_equations(records).solution() == pytest.approx(expected, rel=1e-9)


def test_weights_are_taken_in_the_order_in_which_each_explains_most() -> None:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((80, 9)) * np.geomspace(1e-4, 1e4, 9)
    columns[:, 5] = 0.0
    columns[:, 7] = 2.0 * columns[:, 1]  # the same direction twice: whichever is taken, the other adds nothing
    target = columns[:, [1, 4]] @ np.array([1.0 / columns[0, 1], 1.0 / columns[0, 4]]) + rng.standard_normal(80)
    equations = normal_equations([(columns, target, np.ones(80, dtype=np.bool_))])
    expected: list[int] = []
    for _ in range(7):
        # each with those before it, by numpy's own least squares
        left = {
            k: float(np.sum((target - c @ np.linalg.lstsq(c, target, rcond=None)[0]) ** 2))
            for k in range(9)
            if k not in (5, 7, *expected)
            for c in [columns[:, [*expected, k]] / np.linalg.norm(columns[:, [*expected, k]], axis=0)]
        }
        expected.append(min(left, key=lambda k: left[k]))
    taken = equations.taken_one_by_one(9)
    assert [1 if k == 7 else k for k in taken] == expected
    assert equations.taken_one_by_one(2) == taken[:2]
    assert equations.of(np.array([], dtype=np.int64)).taken_one_by_one(3) == []


@pytest.mark.parametrize("n_signals", [0, 1, 3, 4])
def test_a_product_is_that_of_the_used_samples_alone(n_signals: int) -> None:
    for columns, target, is_used in _records():
        signals = _RNG.standard_normal((target.size, n_signals)) if n_signals else target
        found = product(columns, signals, is_used)
        np.testing.assert_allclose(found, columns[is_used].T @ signals[is_used], rtol=1e-12, atol=1e-12)
        own = product(columns, columns, is_used)
        np.testing.assert_allclose(own, columns[is_used].T @ columns[is_used], rtol=1e-12, atol=1e-12)


def test_normal_equations_of_no_records_are_refused() -> None:
    with pytest.raises(ValueError, match="no records"):
        normal_equations(iter(()))


def test_whitened_columns_are_orthonormal_and_idle_or_doubled_ones_left_out() -> None:
    columns = _RNG.standard_normal((80, 3)) @ np.diag([1e-4, 1.0, 1e4])
    columns = np.column_stack((columns, np.zeros(80), columns[:, 1]))
    whitening = whitening_of(columns.T @ columns)
    assert whitening.shape == (5, 3)
    white = columns @ whitening
    assert white.T @ white == pytest.approx(np.eye(3), abs=1e-9)


def test_non_negative_weights_meet_the_conditions_of_karush_kuhn_and_tucker() -> None:
    columns = _RNG.standard_normal((200, 6)) + 0.5
    columns[:, 4] = 0.0
    target = columns @ np.array([1.0, -2.0, 0.5, -0.1, 0.0, 2.0]) + 0.1 * _RNG.standard_normal(200)
    gram, moment = columns.T @ columns, columns.T @ target
    for weights in (non_negative_weights(gram, moment), non_negative_fit([columns], [target])):
        slope = moment - gram @ weights
        scale = float(np.linalg.norm(moment))
        assert np.all(weights >= 0.0)
        assert weights[4] == 0.0
        assert np.all(slope <= 1e-7 * scale)
        assert np.abs(slope[weights > 0.0]).max() <= 1e-7 * scale


def test_weights_of_either_sign_are_free_and_the_marked_ones_not_negative() -> None:
    columns = _RNG.standard_normal((100, 3))
    target = columns @ np.array([1.0, -2.0, -3.0])
    gram, moment = columns.T @ columns, columns.T @ target
    free = signed_weights(gram, moment, np.zeros(3, dtype=bool))
    assert free == pytest.approx([1.0, -2.0, -3.0], rel=1e-6)
    part = signed_weights(gram, moment, np.array([True, True, False]))
    assert part[1] == 0.0
    assert part[2] < 0.0


def test_variances_are_those_of_the_inverse_and_large_where_columns_cannot_be_told_apart() -> None:
    columns = _RNG.standard_normal((300, 3)) * [1e-6, 1.0, 1e3]
    gram = columns.T @ columns
    assert variances_of(gram) == pytest.approx(np.diag(np.linalg.inv(gram)), rel=1e-6)
    alike = np.column_stack((columns, columns[:, 1], np.zeros(300)))
    variances = variances_of(alike.T @ alike)
    assert variances[[0, 2]] == pytest.approx(variances_of(gram)[[0, 2]], rel=0.02)
    assert np.all(variances[[1, 3]] > 1e6 * variances_of(gram)[1])
    assert variances[4] == np.inf


def test_of_columns_that_do_not_move_the_variance_is_without_end() -> None:
    assert covariance_of(np.diag([4.0, 0.0])).tolist() == [[0.25, 0.0], [0.0, np.inf]]
    assert covariance_of(np.zeros((2, 2))).tolist() == [[np.inf, 0.0], [0.0, np.inf]]


def test_weak_directions_are_left_out_at_the_tolerance_asked_for() -> None:
    columns = _RNG.standard_normal((100, 2))
    nearly = np.column_stack((columns[:, 0], columns[:, 0] + 1e-5 * columns[:, 1]))
    gram = nearly.T @ nearly
    assert whitening_of(gram).shape == (2, 2)
    assert whitening_of(gram, 1e-7).shape == (2, 1)


def test_rows_in_blocks_give_the_weights_of_all_at_once_and_are_heard(monkeypatch):
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(1000, 12))
    columns[:, 7] = columns[:, 6] + 1e-7 * rng.normal(size=1000)  # hardly told apart
    target = columns @ np.maximum(rng.normal(size=12), 0.0) + 1e-3 * rng.normal(size=1000)
    parts = ([columns[:300], columns[300:]], [target[:300], target[300:]])
    at_once = non_negative_fit(*parts)
    monkeypatch.setattr(least_squares, "_ROWS_TOGETHER", 90)
    heard = []
    with heard_by(lambda what, n: heard.append(n)):
        in_blocks = non_negative_fit(*parts)
    np.testing.assert_allclose(columns @ in_blocks, columns @ at_once, atol=1e-9)
    assert np.count_nonzero(at_once) > 3
    assert heard == [0] * 11 + [1]


def test_what_differs_together_differs_less_than_one_by_one() -> None:
    covariance = np.array([[4.0, 1.8], [1.8, 1.0]])
    apart = np.array([2.0, 0.9])
    assert chi_squared(apart, covariance) == pytest.approx(float(apart @ np.linalg.inv(covariance) @ apart))
    assert chi_squared(apart, covariance) < chi_squared(apart, np.diag(np.diag(covariance)))
    # in whatever units
    units = np.array([1e-9, 1e6])
    assert chi_squared(units * apart, covariance * np.outer(units, units)) == pytest.approx(
        chi_squared(apart, covariance)
    )
