"""The noise floor: from differences, from repeats, with hum and drift beside it."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.held_out_score import held_out_score, loses_to
from fomrc_core.records.noise import NoiseFloor, autocorrelation_inflation, known_noise, noise_floor
from fomrc_core.records.noise_estimate import estimate_noise
from fomrc_core.records.recording import Recording
from fomrc_core.records.repeats import find_repeats

RATE_HZ = 1000.0


def repeated_drive(rng: np.random.Generator, n_periods: int = 5) -> np.ndarray:
    spectrum = np.zeros(1001, dtype=complex)
    spectrum[1:200] = np.exp(2j * np.pi * rng.random(199))
    wave = np.fft.irfft(spectrum, 2000)
    return np.concatenate((np.zeros(500), np.tile(wave / np.max(np.abs(wave)), n_periods), np.linspace(0.0, 1.0, 3000)))


def record(drive: np.ndarray, noise: np.ndarray) -> Recording:
    return Recording(np.arange(drive.size) / RATE_HZ, drive, 3.0 * drive + noise)


@pytest.mark.parametrize("level_um", [3e-4, 1e-3, 1e-2])
def test_white_noise_is_measured_both_ways(level_um: float) -> None:
    rng = np.random.default_rng(0)
    drive = repeated_drive(rng)
    floor = noise_floor([record(drive, level_um * rng.standard_normal(drive.size))])
    assert floor.differences_um == pytest.approx(level_um, rel=0.1)
    assert floor.repeats_um == pytest.approx(level_um, rel=0.1)


def test_repeats_see_slow_noise_that_differences_do_not() -> None:
    rng = np.random.default_rng(1)
    drive = repeated_drive(rng)
    slow = np.empty(drive.size)
    slow[0] = 0.0
    for k in range(1, drive.size):
        slow[k] = 0.8 * slow[k - 1] + 0.6e-3 * rng.standard_normal()
    floor = noise_floor([record(drive, slow)])
    assert floor.differences_um < 0.6e-3
    assert floor.repeats_um == pytest.approx(1e-3, rel=0.15)
    assert floor.floor_um == floor.repeats_um


@pytest.mark.parametrize("repeats", [True, False])
def test_readings_that_stand_while_the_drive_moves_on_are_no_surer_than_their_step(repeats: bool) -> None:
    step_um = 0.05
    drive = repeated_drive(np.random.default_rng(4), 5 if repeats else 1)
    plain = record(drive, np.zeros(drive.size))
    read = Recording(plain.time_s, plain.voltage_v, step_um * np.round(plain.measured_um / step_um))
    assert noise_floor([read]).floor_um < 0.5 * step_um / np.sqrt(12.0)  # two readings of one place are alike
    assert known_noise([read]).floor_um == pytest.approx(step_um / np.sqrt(12.0), rel=1e-6)
    # what noise stirs shows its rounding itself
    stirred_um = plain.measured_um + 2.0 * step_um * np.random.default_rng(5).standard_normal(drive.size)
    stirred = Recording(plain.time_s, plain.voltage_v, step_um * np.round(stirred_um / step_um))
    assert known_noise([stirred]).floor_um == pytest.approx(noise_floor([stirred]).floor_um)


def test_hum_is_not_noise() -> None:
    rng = np.random.default_rng(2)
    drive = repeated_drive(rng)
    t = np.arange(drive.size) / RATE_HZ
    floor = noise_floor([record(drive, 1e-3 * rng.standard_normal(t.size) + 5e-3 * np.sin(2 * np.pi * 50.3 * t))])
    assert floor.floor_um < 1.6e-3


def test_what_happens_once_in_one_copy_of_a_repeat_is_no_noise() -> None:
    rng = np.random.default_rng(11)
    drive = repeated_drive(rng, 3)
    noise = 1e-3 * rng.standard_normal(drive.size)
    stands = record(drive, noise).measured_um.copy()
    stands[3300:3380] = stands[3300] + noise[3300:3380]  # a lead opens, and the stage jumps where it should have been
    opened = Recording(np.arange(drive.size) / RATE_HZ, drive, stands)
    loaded = record(drive, noise + 0.5 * (np.arange(drive.size) >= 3300))
    for each in (opened, loaded):
        assert noise_floor([each]).floor_um == pytest.approx(1e-3, rel=0.2)
        assert estimate_noise([each]).rms_um == pytest.approx(1e-3, rel=0.2)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", ["white", "flicker", "walk", "of the place", "in steps", "behind a filter"])
def test_noise_of_any_kind_is_known_from_repeats(kind: str, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    spectrum = np.zeros(151, dtype=complex)
    spectrum[1:20] = np.exp(2j * np.pi * rng.random(19))
    drive = np.concatenate((np.zeros(40), np.tile(np.fft.irfft(spectrum, 300) * 100.0, 2)))
    white = rng.standard_normal(drive.size)
    lines = np.fft.rfft(white)
    lines[1:] /= np.sqrt(np.arange(1, lines.size))
    x = 3.0 * drive
    read = {
        "white": x + 1e-3 * white,
        "flicker": x + 1e-2 * np.fft.irfft(lines, drive.size),
        "walk": x + 1e-3 * np.cumsum(white),
        "of the place": x + 1e-3 * white * (0.05 + np.abs(x) / np.max(np.abs(x))),
        "in steps": 3e-3 * np.round((x + 5e-4 * white) / 3e-3),
        "behind a filter": x + 1e-3 * np.convolve(white, np.ones(12) / 12.0, "same"),
    }[kind]
    time_s = np.arange(drive.size) / RATE_HZ
    assert np.isfinite(noise_floor([Recording(time_s, drive, read)]).repeats_um)
    # what a model leaves of readings in steps is on no steps
    assert np.isfinite(noise_floor([Recording(time_s, drive, read - x)]).repeats_um)


def test_repeats_are_found_where_they_are() -> None:
    drive = repeated_drive(np.random.default_rng(3))
    starts = [(r.start, r.period_samples) for r in find_repeats(drive)]
    assert any(period == 2000 and abs(start - 500) <= 2 for start, period in starts)


def test_without_repeats_the_differences_serve() -> None:
    rng = np.random.default_rng(4)
    drive = np.cumsum(rng.standard_normal(4000)) * 1e-3
    floor = noise_floor([record(drive, np.zeros(4000))])
    assert np.isnan(floor.repeats_um)
    assert floor.floor_um == floor.differences_um


def test_inflation_of_white_noise_is_one_and_of_correlated_noise_is_its_sum() -> None:
    rng = np.random.default_rng(5)
    white = rng.standard_normal(50_000)
    assert autocorrelation_inflation(white) == pytest.approx(1.0, abs=0.15)
    red = np.empty(white.size)
    red[0] = 0.0
    for k in range(1, red.size):
        red[k] = 0.9 * red[k - 1] + white[k]
    assert autocorrelation_inflation(red) == pytest.approx(19.0, rel=0.25)


def test_a_real_gain_is_worthwhile_and_none_is_not() -> None:
    rng = np.random.default_rng(6)
    noise = rng.standard_normal(20_000)
    wave = np.sin(np.arange(20_000) / 50.0)
    real = held_out_score([noise + wave], [noise])
    assert real.is_worthwhile()
    assert real.p_value < 1e-4
    none = held_out_score([noise], [noise + 0.05 * wave])
    assert not none.is_worthwhile()
    assert none.p_value > 0.05


def test_a_gain_at_a_few_moments_is_seen() -> None:
    rng = np.random.default_rng(7)
    noise = rng.standard_normal(20_000)
    bump = np.zeros(20_000)
    for start in range(500, 20_000, 1500):
        bump[start : start + 8] = 6.0
    score = held_out_score([noise + bump], [noise])
    assert score.local_log_gain > 1.0
    assert score.is_worthwhile()
    assert score.p_value < 1e-3


def test_equal_models_do_not_lose_to_each_other() -> None:
    rng = np.random.default_rng(8)
    noise = rng.standard_normal(20_000)
    assert loses_to([noise], [noise + 1e-3 * rng.standard_normal(20_000)]) > 0.01
    assert loses_to([noise], [noise + 0.5 * np.sin(np.arange(20_000) / 30.0)]) < 1e-6


def test_one_jump_that_a_model_misses_does_not_hide_that_it_loses_everywhere() -> None:
    rng = np.random.default_rng(12)
    noise, n = rng.standard_normal(20_000), 400
    late = 0.7 * np.sin(np.arange(20_000) / 30.0)
    late[9_000:9_030] += 400.0
    assert loses_to([noise], [noise + late]) < 1e-6
    # where nothing but the jump is missed one moment is all there is
    jump = np.where(np.abs(np.arange(20_000) - 9_015) < 15, 400.0, 0.0)
    assert loses_to([noise], [noise + jump]) > 0.01
    # of two that are equally good, bursts and all, as many lose as the level says
    lost = 0
    for _ in range(n):
        one, two = (rng.standard_normal(4_000) * np.where(rng.random(4_000) < 0.01, 20.0, 1.0) for _ in range(2))
        lost += loses_to([one], [two]) < 0.05
    assert lost < 0.05 * n + 3.0 * np.sqrt(0.05 * 0.95 * n)


@pytest.mark.parametrize(
    ("share", "error", "told"),
    [
        (1.8, 0.5, 1.0),  # of a power of two degrees of freedom 4 % are as large: the differences, which are surer
        (2.3, 0.5, 2.3),  # and of this 0.5 %
        (0.1, 0.5, 0.1),  # as few are as small as that; half a standard error more than nothing would have been alike
        (0.1, 0.6, 1.0),  # of 1.4 degrees of freedom 3 % are: that says nothing
        (0.9, 0.2, 1.0),
    ],
)
def test_few_repeats_are_taken_for_the_noise_of_the_differences_where_they_may_be_it(
    share: float, error: float, told: float
) -> None:
    assert NoiseFloor(1.0, share, unseen_share=0.9, repeats_error=error).floor_um == told
    # what sees slow noise as well is taken as it is
    assert NoiseFloor(1.0, share, unseen_share=0.0, repeats_error=error).floor_um == share
