"""What is slower than repeats can show is not held against a model, what they can show is."""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.remainder import DrivenRecord
from fomrc_core.diagnosis.slow_rest import is_slower_than_seen

_N, _STEP_S = 5000, 0.01
_SEEN_S = 2.0  # of 50


def _of(residual_um: Array) -> list[DrivenRecord]:
    time_s = _STEP_S * np.arange(_N)
    everything = np.ones(_N, dtype=np.bool_)
    return [DrivenRecord(time_s, np.sin(time_s), np.sin(time_s), residual_um, everything)]


def test_only_an_excess_that_is_slower_than_what_was_seen_is() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(size=_N)
    time_s = _STEP_S * np.arange(_N)
    wander = 0.08 * np.cumsum(rng.normal(size=_N))
    assert is_slower_than_seen(_of(noise + wander), 1.0, _SEEN_S)
    assert not is_slower_than_seen(_of(noise), 1.0, _SEEN_S), "nothing is left beyond the noise"
    quick = 2.0 * np.sin(2.0 * np.pi * time_s / (0.5 * _SEEN_S))
    assert not is_slower_than_seen(_of(noise + quick), 1.0, _SEEN_S), "repeats would have shown it"
    assert not is_slower_than_seen(_of(noise + wander + quick), 1.0, _SEEN_S)
    assert is_slower_than_seen(_of(1e-6 * (noise + wander)), 1e-6, _SEEN_S), "no scale is in it"
