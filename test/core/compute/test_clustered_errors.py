"""Standard errors of least squares where residuals are not alike everywhere, and of what another draw would keep."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.compute.clustered_errors import Selection, clustered_covariance, undetermined
from fomrc_core.compute.least_squares import gram_of, normal_equations

_ALL = np.ones(400, dtype=bool)


def _drawn(rng: np.random.Generator, columns: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    """Return noise that is large where the first column is, and goes together within a cluster."""
    together = rng.normal(size=clusters.max() + 1)[clusters]
    return np.asarray((0.3 + 2.0 * np.abs(columns[:, 0])) * (together + 0.5 * rng.normal(size=clusters.size)))


def test_errors_over_draws_spread_by_what_is_told() -> None:
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(400, 3))
    clusters = np.repeat(np.arange(100), 4)
    gram = gram_of([(columns, _ALL)])
    found, told, alike = [], [], []
    for _ in range(300):
        target = _drawn(rng, columns, clusters)
        weights = normal_equations([(columns, target, _ALL)]).solution()
        left = target - columns @ weights
        kept = Selection(np.ones(3, dtype=bool), 0.0)
        covariance = clustered_covariance(gram, [(columns.reshape(100, 4, 3), left.reshape(100, 4))], kept)
        found.append(weights)
        told.append(np.sqrt(np.diag(covariance)))
        alike.append(np.sqrt(np.diag(np.linalg.inv(gram)) * left.var()))
    spread = np.sqrt(np.mean((np.array(found) / np.array(told)) ** 2, axis=0))
    assert spread == pytest.approx(1.0, abs=0.25)
    assert np.sqrt(np.mean((np.array(found) / np.array(alike)) ** 2, axis=0))[0] > 1.5  # one variance for all rows


def test_what_is_kept_in_some_draws_only_adds_its_share() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(400, 2))
    columns[:, 1] += 2.0 * columns[:, 0]
    gram = gram_of([(columns, _ALL)])
    both = normal_equations([(columns, np.zeros(400), _ALL)])
    assert both.gram == pytest.approx(gram)
    of_its_own = gram[1, 1] - gram[0, 1] ** 2 / gram[0, 0]
    found, told = [], []
    for _ in range(2000):
        target = rng.normal(size=400)
        alone = normal_equations([(columns[:, :1], target, _ALL)]).solution()
        more = normal_equations([(columns, target, _ALL)]).solution()
        found.append(more[0] if more[1] ** 2 * of_its_own > 1.0 else alone[0])
        if len(told) < 50:
            rest = (target - columns[:, :1] @ alone).reshape(400, 1)
            only = Selection(np.array([True, False]), 1.0)
            told.append(float(clustered_covariance(gram, [(columns.reshape(400, 1, 2), rest)], only)[0, 0]))
    assert np.sqrt(np.mean(told)) == pytest.approx(np.std(found), rel=0.07)
    assert np.std(found) > 1.5 / np.sqrt(gram[0, 0])


def test_what_the_data_leave_open_has_no_end() -> None:
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(400, 3))
    columns[:, 2] = columns[:, 1]
    gram = gram_of([(columns, _ALL)])
    assert undetermined(gram).tolist() == [False, True, True]
    rest = rng.normal(size=(400, 1))
    kept = Selection(np.ones(3, dtype=bool), 0.0)
    variances = np.diag(clustered_covariance(gram, [(columns.reshape(400, 1, 3), rest)], kept))
    assert np.isfinite(variances).tolist() == [True, False, False]
