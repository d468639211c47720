"""The slope of a sum of terms, exactly: as differences of the sum give it, whatever the terms remember."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from fomrc_core.effects.base.slopes import slope_by_differences
from fomrc_core.effects.unnamed import Unnamed

SPAN_UM = 4.0
TIME_S = 2e-3 * np.arange(1, 3001)
STEPS_S = np.full(TIME_S.size, 2e-3)
# beyond what terms are learned from at its largest, where they go on as at the edge
MOVED_UM = 3.9 * np.sin(2.0 * np.pi * 1.3 * TIME_S) + 0.9 * np.sin(2.0 * np.pi * 7.1 * TIME_S)
CHANGES = np.column_stack([np.sin(2.0 * np.pi * line_hz * TIME_S + line_hz) for line_hz in (0.3, 2.7, 11.0)])


@pytest.mark.parametrize("lag_power", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("threshold", [0.0, 0.1])
def test_the_slope_is_that_of_differences(lag_power: float, threshold: float) -> None:
    powers, lags_s = zip(*product((0.0, 1.0, 3.0), (0.05, 0.5)), strict=True)
    n = len(powers)
    terms = Unnamed((0.2,) * n, powers, lags_s, (lag_power,) * n, (threshold,) * n, SPAN_UM)
    assert np.max(np.abs(MOVED_UM)) > 1.1 * SPAN_UM
    about = slope_by_differences(terms, CHANGES, STEPS_S, MOVED_UM, SPAN_UM)
    exact = terms.linearized(CHANGES, STEPS_S, MOVED_UM)
    assert np.max(np.abs(about - CHANGES)) > 0.05, "the terms have a slope"
    # differences cut the corner where a play or the edge is reached: there, for a sample, the two may differ
    apart = np.abs(about - exact)
    assert np.quantile(apart, 0.99) < 1e-6
    assert np.sqrt(np.mean(apart**2)) < 1e-3
