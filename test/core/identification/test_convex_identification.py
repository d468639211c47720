"""Identification against truths computed another way: implicit slip elements, product-integration creep."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.errors import ParameterError, RecordingError
from fomrc_core.identification.convex import identify
from fomrc_core.identification.fit import Fit, FitOutcome
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.paper_stage import CREEP_ORDER, KAPPA_UM_PER_V, SATURATION_V
from fomrc_core.records.excitation import concatenate, staircase, triangle
from fomrc_core.records.recording import Recording
from test.hidden.creep import fractional_integral
from test.hidden.hysteresis import MaxwellChain

KAPPA = np.array(KAPPA_UM_PER_V)
NOISE_UM = 1e-3


def measured(voltage_v: np.ndarray, seed: int, offset_um: float = 3.0) -> Recording:
    moved = MaxwellChain(1.0 / KAPPA[:-1], SATURATION_V, 1.0 / KAPPA[-1]).run(voltage_v)
    displacement_um = fractional_integral(moved, CREEP_ORDER, 1e-3)
    noise = NOISE_UM * np.random.default_rng(seed).standard_normal(voltage_v.size)
    return Recording(np.arange(voltage_v.size) * 1e-3, voltage_v, displacement_um + noise + offset_um, name="truth")


@pytest.fixture(scope="module")
def drive_v() -> np.ndarray:
    slow = triangle(2.5, slope_v_per_s=1.2, n_cycles=5)
    return concatenate(slow, staircase(2.5, dwell_s=0.8, n_cycles=2)).voltage_v[:60_000]


@pytest.fixture(scope="module")
def fit(drive_v: np.ndarray) -> Fit:
    return identify(measured(drive_v, 1), n_elements=10)


def test_reaches_the_noise_without_start_values(fit: Fit) -> None:
    assert fit.rms_um <= 1.02 * NOISE_UM
    assert fit.noise_um == pytest.approx(NOISE_UM, rel=0.05)
    assert fit.outcome is not FitOutcome.COARSE


def test_finds_the_creep_order(fit: Fit) -> None:
    assert fit.model.creep_order == pytest.approx(CREEP_ORDER, rel=0.02)
    assert abs(fit.model.creep_order - CREEP_ORDER) < 10.0 * fit.creep_order_standard_error


def test_finds_the_offset(fit: Fit) -> None:
    assert fit.offsets_um[0] == pytest.approx(3.0, abs=0.05)


def test_predicts_a_drive_it_has_not_seen(fit: Fit) -> None:
    other = triangle(2.1, slope_v_per_s=7.0, n_cycles=3).voltage_v
    truth = measured(other, 2)
    predicted = fit.model.simulate(truth.steps_s, truth.voltage_v)
    left = truth.measured_um - predicted
    assert np.std(left) <= 1.2 * NOISE_UM


def test_automatic_count_does_as_well_on_held_out_data(drive_v: np.ndarray) -> None:
    other = measured(triangle(2.3, slope_v_per_s=4.0, n_cycles=4).voltage_v, 3)
    found = identify(measured(drive_v, 1), n_elements="auto", test=other)
    assert found.test_nrmse_percent <= 1.05 * 100.0 * NOISE_UM / np.ptp(other.measured_um)
    assert 6 <= found.model.n_elements <= 25


def test_two_records_share_one_model(drive_v: np.ndarray) -> None:
    first, second = measured(drive_v[:30_000], 4, 1.0), measured(triangle(2.5, slope_v_per_s=3.0).voltage_v, 5, -7.0)
    found = identify([first, second])
    assert found.rms_um <= 1.05 * NOISE_UM
    assert found.offsets_um[0] - found.offsets_um[1] == pytest.approx(8.0, abs=0.05)


def test_a_drive_that_cannot_tell_says_so() -> None:
    small = measured(triangle(0.15, slope_v_per_s=0.5, n_cycles=2).voltage_v, 6)
    found = identify(small, n_elements=10)
    assert found.outcome is FitOutcome.UNDETERMINED
    assert found.undetermined_elements
    assert "not determined" in found.reason


def test_a_lag_the_model_lacks_is_called_coarse() -> None:
    drive = triangle(2.5, slope_v_per_s=20.0, n_cycles=5).voltage_v
    late = np.convolve(drive, np.exp(-np.arange(200) / 20.0) / np.sum(np.exp(-np.arange(200) / 20.0)))[: drive.size]
    record = measured(late, 7)
    found = identify(Recording(record.time_s, drive, record.measured_um))
    assert found.outcome in (FitOutcome.COARSE, FitOutcome.UNDETERMINED)
    assert found.rms_um > 3.0 * NOISE_UM


def test_progress_rises(drive_v: np.ndarray) -> None:
    shares: list[float] = []
    identify(measured(drive_v[:8000], 8), n_elements=4, progress=lambda share, text: shares.append(share))
    assert shares == sorted(shares)
    assert len(shares) >= 3


@pytest.mark.parametrize(
    ("changed", "named"),
    [({"n_elements": 0}, "n_elements"), ({"n_elements": "many"}, "n_elements"), ({"method": "guess"}, "method")],
)
def test_bad_options_are_named(changed: dict[str, object], named: str, drive_v: np.ndarray) -> None:
    with pytest.raises(ParameterError, match=named):
        identify(measured(drive_v[:2000], 9), **changed)  # type: ignore[arg-type]


def test_constant_voltage_is_refused() -> None:
    with pytest.raises(RecordingError, match="voltage is constant"):
        identify(Recording(np.arange(500) * 1e-3, np.full(500, 1.0), np.random.default_rng(0).normal(size=500)))


def test_the_model_is_a_model(fit: Fit) -> None:
    again = PiezoModel.from_mapping(fit.model.to_mapping())
    voltage = np.linspace(0.0, 2.0, 50)
    steps = np.full(50, 1e-3)
    np.testing.assert_array_equal(again.simulate(steps, voltage), fit.model.simulate(steps, voltage))
