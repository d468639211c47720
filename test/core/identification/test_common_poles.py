"""Poles common to records: those of the modes, and no end where more are placed than there are modes."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.identification.axes.periodic import PeriodicRecord, periodic_record
from fomrc_core.identification.axes.rational import common_poles

_RATE_HZ = 1000.0


def _record(n: int, top_hz: float, noise_um: float, seed: int, noise: np.random.Generator) -> PeriodicRecord:
    """Two periods of a multisine up to some frequency, through a mode of 75 Hz."""
    hz = np.fft.rfftfreq(n, 1.0 / _RATE_HZ)
    mode = 1.0 / (1.0 - (hz / 75.0) ** 2 + 0.04j * hz / 75.0)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, round(top_hz * n / _RATE_HZ))
    turns = 2.0 * np.pi * np.arange(1, phases.size + 1)[:, None] * np.arange(n) / n
    v = np.sum(0.05 * np.cos(turns + phases[:, None]), axis=0)
    moved_um = np.tile(np.fft.irfft(np.fft.rfft(v) * mode, n), 2) + noise_um * noise.normal(size=2 * n)
    voltage_v, displacement_um = (x.reshape(2, n, 1).transpose(1, 2, 0) for x in (np.tile(v, 2), moved_um))
    return periodic_record(voltage_v, displacement_um, _RATE_HZ, name=str(seed))


# With more poles than modes and hardly any noise some follow single lines, and end upon them.
@pytest.mark.parametrize(("n", "top_hz", "n_poles", "noise_um"), [(500, 100.0, 12, 1e-9), (400, 50.0, 14, 1e-4)])
def test_poles_that_end_upon_a_line_do_no_harm(n: int, top_hz: float, n_poles: int, noise_um: float) -> None:
    noise = np.random.default_rng(0)
    records = tuple(_record(n, top_hz, noise_um, seed, noise) for seed in range(2))
    hz, damping = common_poles(records, n_poles, 0.85 / _RATE_HZ)
    assert np.all(np.isfinite(hz))
    assert np.all(np.isfinite(damping))
    if top_hz > 75.0:
        nearest = int(np.argmin(np.abs(hz - 75.0)))
        assert abs(hz[nearest] - 75.0) < 0.01
        assert abs(damping[nearest] - 0.02) < 1e-3
