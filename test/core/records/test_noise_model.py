"""The noise model: level, colour, growth, steps, and what it says of a residual."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from benchmarks.noise_accuracy import DRIVES, NOISES, displacement_um, rms_less_cubic
from fomrc_core.errors import RecordingError
from fomrc_core.records.noise_estimate import estimate_noise, noise_from_residual
from fomrc_core.records.noise_model import NoiseModel, NoiseSource
from fomrc_core.records.recording import Recording
from fomrc_core.records.sensor_step import sensor_step_um, unquantised_variance_um2
from fomrc_core.records.spectral_lines import without_lines
from fomrc_core.records.whitening import burg, levinson, process_of

N_SEEDS = 4


def measured(drive: str, noise: str, seed: int, level_um: float = 1e-3) -> tuple[Recording, np.ndarray]:
    rng = np.random.default_rng([7, seed])
    drive_v = DRIVES[drive](rng)
    error = level_um * NOISES[noise](drive_v.size, rng)
    return Recording(np.arange(drive_v.size) / 1e3, drive_v, displacement_um(drive_v) + error), error


@functools.cache
def ratios(drive: str, noise: str) -> tuple[float, list[NoiseModel], list[np.ndarray]]:
    models, errors, found = [], [], []
    for seed in range(N_SEEDS):
        record, error = measured(drive, noise, seed)
        models.append(estimate_noise([record]))
        errors.append(error)
        found.append(models[-1].rms_um / rms_less_cubic(error))
    return float(np.median(found)), models, errors


REPEATING = ("four periods", "two periods in rests", "two bursts apart", "triangles with holds", "one long rest")


@pytest.mark.parametrize("drive", REPEATING)
@pytest.mark.parametrize("noise", ["white", "AR(1) 0.3", "AR(1) 0.6", "AR(1) 0.9"])
def test_white_and_first_order_noise_within_ten_percent(drive: str, noise: str) -> None:
    ratio, models, _ = ratios(drive, noise)
    assert ratio == pytest.approx(1.0, abs=0.1)
    assert all(m.source is not NoiseSource.DIFFERENCES for m in models)


@pytest.mark.parametrize("drive", REPEATING)
@pytest.mark.parametrize("noise", ["flicker", "walk", "white + walk"])
def test_slow_noise_within_a_quarter_or_its_interval_says_so(drive: str, noise: str) -> None:
    ratio, models, errors = ratios(drive, noise)
    assert ratio == pytest.approx(1.0, abs=0.25)
    inside = [
        m.rms_interval_um[0] <= rms_less_cubic(e) <= m.rms_interval_um[1] for m, e in zip(models, errors, strict=True)
    ]
    assert sum(inside) >= N_SEEDS - 1


@pytest.mark.parametrize("noise", ["AR(1) 0.9", "flicker", "walk"])
def test_without_repeats_and_rests_slow_noise_is_not_claimed_to_be_seen(noise: str) -> None:
    _, models, _ = ratios("fading triangles", noise)
    for model in models:
        assert model.source is NoiseSource.DIFFERENCES
        assert not model.sees_slow_noise
        assert model.rms_interval_um[1] > 2.0 * model.rms_interval_um[0]


def test_short_rests_do_not_claim_to_see_a_walk() -> None:
    _, models, errors = ratios("staircase", "white + walk")
    for model, error in zip(models, errors, strict=True):
        assert model.source is NoiseSource.RESTS
        assert not model.sees_slow_noise
        assert model.rms_interval_um[0] <= rms_less_cubic(error) <= model.rms_interval_um[1]


@pytest.mark.parametrize("noise", ["white", "AR(1) 0.6", "AR(1) 0.9", "flicker"])
def test_noise_is_consistent_with_itself_and_a_model_error_is_not(noise: str) -> None:
    _, models, errors = ratios("four periods", noise)
    consistent, white = [], []
    for model, error in zip(models, errors, strict=True):
        consistent.append(model.consistency_p_value(error))
        white.append(model.whiteness(error).p_value)
        wrong = error + 3e-3 * np.sin(np.arange(error.size) / 40.0)
        assert model.consistency_p_value(wrong) < 0.01
        assert not model.is_white(wrong)
    assert np.median(consistent) > 0.05
    assert np.median(white) > 0.05


def test_p_values_of_white_noise_are_even() -> None:
    # 200 residuals, each judged by a noise model of its own
    rng = np.random.default_rng(11)
    rms, whiteness = [], []
    for _ in range(200):
        model = noise_from_residual(rng.standard_normal(500), 1e-3)
        residual = rng.standard_normal(2000)
        rms.append(model.consistency_p_value(residual))
        whiteness.append(model.whiteness(residual).p_value)
    for values in (rms, whiteness):
        assert np.mean(np.array(values) < 0.05) < 0.1
    assert 0.35 < np.median(rms) < 0.65


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e4])
@pytest.mark.parametrize("rate_hz", [0.1, 1e5])
def test_units_and_rates_do_not_matter(scale: float, rate_hz: float) -> None:
    record, _ = measured("four periods", "AR(1) 0.6", 0)
    model = estimate_noise([record])
    other = Recording(np.arange(record.n_samples) / rate_hz, 40.0 * record.voltage_v, scale * record.measured_um)
    scaled = estimate_noise([other])
    assert scaled.rms_um == pytest.approx(scale * model.rms_um, rel=1e-6)
    assert scaled.lowest_frequency_hz == pytest.approx(model.lowest_frequency_hz * rate_hz / 1e3, rel=1e-6)


def test_growth_with_displacement_is_seen_where_there_is_some() -> None:
    rng = np.random.default_rng(5)
    drive_v = DRIVES["four periods"](rng)
    clean = displacement_um(drive_v)
    noise = NOISES["AR(1) 0.6"](drive_v.size, rng)
    even = estimate_noise([Recording(np.arange(clean.size) / 1e3, drive_v, clean + 1e-3 * noise)])
    assert even.growth_per_um == 0.0
    growing = np.sqrt(1.0 + (0.5 * clean) ** 2)
    model = estimate_noise([Recording(np.arange(clean.size) / 1e3, drive_v, clean + 1e-3 * growing * noise)])
    assert model.factor(clean) / model.factor(np.zeros(1)) == pytest.approx(growing, rel=0.15)
    white = model.whiten(1e-3 * growing * noise, clean)
    outer = np.abs(clean) > np.quantile(np.abs(clean), 0.8)
    assert np.std(white[outer]) == pytest.approx(1.0, abs=0.1)
    assert np.std(white) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_noise_at_one_place_says_nothing_of_growth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drive_v = np.concatenate((np.zeros(500), 0.01 * np.cumsum(rng.standard_normal(4000)), np.zeros(300)))
    read_um = 3.0 * drive_v + 1e-3 * rng.standard_normal(drive_v.size)
    model = estimate_noise([Recording(np.arange(drive_v.size) / 1e3, drive_v, read_um)])
    assert model.growth_per_um == 0.0
    assert model.rms_um == pytest.approx(1e-3, rel=0.15)


@pytest.mark.parametrize("step_um", [1e-3, 5e-3])
@pytest.mark.parametrize("drive", ["four periods", "triangles with holds"])
def test_the_error_of_a_quantiser_is_in_the_noise(step_um: float, drive: str) -> None:
    record, error = measured(drive, "white", 1)
    read = np.round(record.measured_um / step_um) * step_um
    clean = record.measured_um - error
    model = estimate_noise([Recording(record.time_s, record.voltage_v, read)])
    assert model.step_um == pytest.approx(step_um, rel=1e-6)
    assert model.rms_um == pytest.approx(np.hypot(1e-3, step_um / np.sqrt(12.0)), rel=0.1)
    assert model.rms_um == pytest.approx(float(np.std(read - clean)), rel=0.25)


def test_steps_are_found_and_none_invented() -> None:
    rng = np.random.default_rng(6)
    x = np.cumsum(rng.standard_normal(5000))
    for step in (1e-4, 0.3, 7.0):
        assert sensor_step_um(np.round(x / step) * step + 17.3) == pytest.approx(step, rel=1e-6)
    assert np.isnan(sensor_step_um(x))


@pytest.mark.parametrize("spread", [0.05, 0.3, 1.0, 3.0])
def test_what_a_quantiser_hides_of_a_noise(spread: float) -> None:
    rng = np.random.default_rng(8)
    signal = rng.uniform(0.0, 1000.0, 400_000)
    one, other = (np.round(signal + spread * rng.standard_normal(signal.size)) for _ in range(2))
    seen = 0.5 * float(np.mean((one - other) ** 2))
    assert np.sqrt(unquantised_variance_um2(seen, 1.0)) == pytest.approx(spread, rel=0.05)


def test_lines_are_taken_out_and_named() -> None:
    rng = np.random.default_rng(9)
    t = np.arange(6000)
    noise = rng.standard_normal(t.size)
    cleaned, lines = without_lines(noise + 3.0 * np.sin(2.0 * np.pi * 0.0503 * t) + np.sin(2.0 * np.pi * 0.1509 * t))
    assert sorted(lines) == pytest.approx([0.0503, 0.1509], abs=2e-4)
    assert np.std(cleaned) == pytest.approx(1.0, abs=0.03)
    assert without_lines(noise)[1] == ()


def test_effective_counts() -> None:
    rng = np.random.default_rng(10)
    white = noise_from_residual(rng.standard_normal(20_000), 1e-3)
    assert white.inflation(20_000) == pytest.approx(1.0, rel=0.1)
    red = noise_from_residual(lfilter([1.0], [1.0, -0.9], rng.standard_normal(50_000)), 1e-3)
    assert red.inflation(50_000) == pytest.approx(19.0, rel=0.25)
    assert red.effective_count(50_000) == pytest.approx(50_000 / red.inflation(50_000))


def test_likelihood_is_the_gaussian_density() -> None:
    process = levinson(2.0 * 0.7 ** np.arange(12.0))
    values = np.array([0.3, -1.0, 0.8, 2.1, -0.4])
    covariance = toeplitz(2.0 * 0.7 ** np.arange(5.0))
    white = process.whiten(values)
    assert np.dot(white, white) == pytest.approx(values @ np.linalg.solve(covariance, values))
    assert process.log_determinant(5) == pytest.approx(np.linalg.slogdet(covariance)[1])
    columns = np.column_stack((values, 2.0 * values))
    assert process.whiten(columns) == pytest.approx(np.column_stack((white, 2.0 * white)))


def test_processes_and_their_filters_are_each_other() -> None:
    rng = np.random.default_rng(12)
    coefficients = np.array([1.0, -1.2, 0.5, 0.1])
    process = process_of(coefficients, 0.3)
    assert process.coefficients == pytest.approx(coefficients)
    assert process.innovation_um2 == pytest.approx(0.3)
    assert levinson(process.autocovariance(20)).coefficients == pytest.approx(coefficients)
    values = lfilter([np.sqrt(0.3)], coefficients, rng.standard_normal(20_000))
    found = burg([values[:9000], values[9000:]], 20)
    assert found.order == 3
    assert found.coefficients == pytest.approx(coefficients, abs=0.05)


def test_gaps_restart_the_filter() -> None:
    rng = np.random.default_rng(13)
    residual = lfilter([1.0], [1.0, -0.8], rng.standard_normal(5000))
    model = noise_from_residual(residual, 1e-3)
    usable = rng.random(5000) > 0.02
    spoilt = np.where(usable, residual, 1e6)
    white = model.whiten(spoilt, is_usable=usable)
    assert np.std(white[usable]) == pytest.approx(1.0, abs=0.05)
    assert model.whiteness(spoilt, is_usable=usable).p_value > 1e-3


def test_what_is_not_usable_is_not_noise() -> None:
    record, _ = measured("four periods", "white", 3)
    spiked = record.measured_um.copy()
    spikes = [3000, 5111, 7222]
    spiked[spikes] += 5.0
    usable = np.ones(spiked.size, dtype=bool)
    usable[spikes] = False
    model = estimate_noise([Recording(record.time_s, record.voltage_v, spiked)], [usable])
    assert model.rms_um == pytest.approx(1e-3, rel=0.1)


def test_no_record_and_too_few_samples_are_refused() -> None:
    with pytest.raises(RecordingError, match="no recording given"):
        estimate_noise([])
    with pytest.raises(RecordingError, match="too few samples"):
        noise_from_residual(np.zeros(5), 1e-3)


def test_a_silent_sensor_has_a_model_too() -> None:
    record, error = measured("four periods", "white", 4)
    silent = Recording(record.time_s, record.voltage_v, 3.0 * record.voltage_v)
    model = estimate_noise([silent])
    assert model.rms_um < 1e-9
    assert np.all(np.isfinite(model.whiten(error)))
