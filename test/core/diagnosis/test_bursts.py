"""A few samples that stand far out of all others are no noise, whatever its colour."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.bursts import bursts
from fomrc_core.diagnosis.remainder import DrivenRecord

_N = 6000
_TIME_S = np.arange(_N) / 1e3
_DRIVE_V = np.sin(2.0 * np.pi * 0.7 * _TIME_S)


def _left(residual_um: np.ndarray, is_used: np.ndarray | None = None) -> DrivenRecord:
    used = np.ones(_N, dtype=np.bool_) if is_used is None else is_used
    return DrivenRecord(_TIME_S, _DRIVE_V, _DRIVE_V, residual_um, used)


def _noise(kind: str, rng: np.random.Generator) -> np.ndarray:
    white = rng.normal(0.0, 1e-3, _N)
    if kind == "walk":
        return np.asarray(np.cumsum(white))
    if kind == "proportional":
        return np.asarray(white * (0.1 + np.abs(_DRIVE_V)))
    if kind == "quantised":
        return np.asarray(np.round(white / 1e-2) * 1e-2)
    if kind == "heavy-tailed":
        return np.asarray(rng.laplace(0.0, 1e-3, _N))
    return white


@pytest.mark.parametrize("kind", ["white", "walk", "proportional", "quantised", "heavy-tailed"])
@pytest.mark.parametrize("scale", [1e-6, 1e4])
def test_noise_has_none_at_any_scale(kind: str, scale: float) -> None:
    for seed in range(20):
        found = bursts([_left(scale * _noise(kind, np.random.default_rng(seed)))])
        assert found.share == 0.0
        assert found.p_value == 1.0


@pytest.mark.parametrize("kind", ["white", "walk", "heavy-tailed"])
def test_openings_are_seen_and_not_where_they_are_not_looked_at(kind: str) -> None:
    residual_um = _noise(kind, np.random.default_rng(1))
    opened = np.zeros(_N, dtype=np.bool_)
    for at in (700, 2600, 4100):
        opened[at : at + 6] = True
    residual_um[opened] += 60.0 * np.std(residual_um)
    found = bursts([_left(residual_um)])
    assert found.share > 0.5
    assert found.p_value < 1e-10
    assert not found.is_of_drive
    assert bursts([_left(residual_um, ~opened)]).share == 0.0


def test_of_nothing_and_of_readings_that_are_alike_nothing_is_said() -> None:
    assert bursts([]).p_value == 1.0
    assert bursts([_left(np.zeros(_N))]).p_value == 1.0
    nothing = np.zeros(_N, dtype=np.bool_)
    assert bursts([_left(np.ones(_N), nothing)]).p_value == 1.0
