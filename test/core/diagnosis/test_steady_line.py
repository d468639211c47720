"""A steady line in what is left is no noise, of whatever colour noise is, and whatever the drive does at its place."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.remainder import DrivenRecord
from fomrc_core.diagnosis.steady_line import steady_line

_N = 3000


def _record(residual_um: Array, step_s: float = 1e-3) -> DrivenRecord:
    time_s = step_s * np.arange(_N)
    drive_v = np.sin(2.0 * np.pi * 40.0 * np.arange(_N) / _N)
    return DrivenRecord(time_s, drive_v, 1e3 * np.ptp(residual_um) * drive_v, residual_um, np.ones(_N, dtype=np.bool_))


def _flicker(rng: np.random.Generator) -> Array:
    spectrum = np.fft.rfft(rng.normal(size=_N))
    spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum, _N)


_NOISES: dict[str, Callable[[np.random.Generator], Array]] = {
    "white": lambda rng: rng.normal(size=_N),
    "behind a filter": lambda rng: lfilter([1.0], [1.0, -0.95], rng.normal(size=_N)),
    "flicker": _flicker,
    "wandering": lambda rng: np.cumsum(rng.normal(size=_N)),
    "growing": lambda rng: (1.0 + np.abs(np.sin(np.arange(_N) / 50.0))) * rng.normal(size=_N),
    "of heavy tails": lambda rng: rng.standard_t(3, size=_N),
}


@pytest.mark.parametrize("noise", _NOISES)
def test_noise_has_none(noise: str) -> None:
    told = 0
    for seed in range(200):
        found = steady_line([_record(_NOISES[noise](np.random.default_rng([3, seed])))])
        told += found.p_value < 0.01 and found.share > 0.1
    assert told <= 7  # of two hundred at one in a hundred: eight and more happen once in a thousand


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e4])
@pytest.mark.parametrize("step_s", [1e-6, 1e-3, 60.0])
def test_a_tone_is_found_with_its_share_of_the_power_at_any_scale(scale: float, step_s: float) -> None:
    noise = np.random.default_rng(5).normal(size=_N)
    tone = np.sqrt(2.0) * np.sin(2.0 * np.pi * 170.3 * np.arange(_N) / _N)  # as much power as the noise has
    found = steady_line([_record(scale * (noise + tone), step_s), _record(scale * noise, step_s)])
    assert found.p_value < 1e-6
    assert found.share == pytest.approx(1.0 / 3.0, abs=0.03)
    assert not found.is_of_drive
    told_hz = float(found.on.removeprefix("a steady line at ").removesuffix(" Hz"))
    assert told_hz == pytest.approx(170.3 / (_N * step_s), rel=3e-3)


def test_a_few_samples_and_an_exact_model_have_none() -> None:
    short = _record(np.zeros(_N))
    assert steady_line([short]).share == 0.0
    left_out = DrivenRecord(
        short.time_s, short.voltage_v, short.predicted_um, short.residual_um, np.zeros(_N, dtype=np.bool_)
    )
    assert steady_line([left_out]).p_value == 1.0
