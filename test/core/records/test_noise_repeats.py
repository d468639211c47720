"""Repeats of a drive: planted ones are found at any place and lag, none are invented."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fomrc_core.errors import DataUnavailableError
from fomrc_core.records.repeats import Repeat, find_repeats
from fomrc_core.storage.measured_examples import fsm, pea_1hz


def multisine(rng: np.random.Generator, n: int, top: int) -> np.ndarray:
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[1:top] = np.exp(2j * np.pi * rng.random(top - 1))
    wave = np.fft.irfft(spectrum, n)
    return wave / np.max(np.abs(wave))


def triangle(n: int) -> np.ndarray:
    return 1.0 - 2.0 * np.abs(2.0 * ((np.arange(n) / n + 0.25) % 1.0) - 1.0)


def walk(rng: np.random.Generator, n: int) -> np.ndarray:
    values = np.cumsum(rng.standard_normal(n))
    return values / np.max(np.abs(values))


def holds(found: tuple[Repeat, ...], start: int, stop: int, lag: int) -> bool:
    """Whether one of the repeats has this lag and covers nearly all of a stretch."""
    slack = (stop - start) // 20
    return any(r.period_samples == lag and r.start <= start + slack and r.stop >= stop - slack for r in found)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_wave=st.sampled_from([300, 1000, 4000]),
    n_between=st.integers(0, 6000),
    surroundings=st.sampled_from(["rest", "walk", "slow walk"]),
    read_back=st.sampled_from([0.0, 1e-5, 1e-4]),
    scale=st.sampled_from([1e-2, 1.0, 5e3]),
)
def test_a_planted_repeat_is_found(
    seed: int, n_wave: int, n_between: int, surroundings: str, read_back: float, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    wave = multisine(rng, n_wave, n_wave // 20)
    around = {
        "rest": lambda n: np.full(n, wave[-1]),
        "walk": lambda n: walk(rng, n) if n else np.zeros(0),
        "slow walk": lambda n: np.convolve(walk(rng, n + 50), np.ones(50) / 50.0, "same")[:n] if n else np.zeros(0),
    }[surroundings]
    before = rng.integers(0, 5000)
    drive = np.concatenate((around(before), wave, around(n_between), wave, around(1000)))
    drive = scale * (drive + read_back * rng.standard_normal(drive.size)) + 3.0 * scale
    highest, lowest = int(np.argmax(wave)), int(np.argmin(wave))
    found = find_repeats(drive)
    if n_wave - max(highest, lowest) > 64:
        assert holds(found, before, before + n_wave, n_wave + n_between)
    for repeat in found:
        copies = drive[repeat.start + repeat.period_samples : repeat.stop + repeat.period_samples]
        assert np.max(np.abs(copies - drive[repeat.start : repeat.stop])) <= 20.0 * scale * max(read_back, 1e-12)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["walk", "white", "smooth", "levels", "chirp"]))
def test_none_is_invented(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(500, 20_000))
    drive = {
        "walk": lambda: walk(rng, n),
        "white": lambda: rng.standard_normal(n),
        "smooth": lambda: multisine(rng, n, max(3, n // 100)),
        "levels": lambda: np.repeat(rng.random(n // 100 + 2), 100),
        "chirp": lambda: np.sin(2.0 * np.pi * np.arange(n) ** 2 * 0.05 / n),
    }[kind]()
    assert find_repeats(drive) == ()


def test_growing_triangles_and_a_staircase_do_not_repeat() -> None:
    assert find_repeats(np.concatenate([a * triangle(800) for a in np.linspace(0.2, 1.0, 8)])) == ()
    assert find_repeats(np.repeat(np.concatenate((np.arange(9.0), np.arange(7.0, -1.0, -1.0))), 200)) == ()


@pytest.mark.parametrize("read_back", [0.0, 1e-4])
def test_two_periods_of_a_multisine_after_a_rest(read_back: float) -> None:
    # the record in which half of all steps are zero
    rng = np.random.default_rng(1)
    wave = multisine(rng, 2000, 100)
    drive = np.concatenate((np.zeros(3000), wave, wave, np.full(4000, wave[-1])))
    drive += read_back * rng.standard_normal(drive.size)
    assert holds(find_repeats(drive), 3000, 5000, 2000)


@pytest.mark.parametrize("read_back", [0.0, 1e-4])
def test_triangles_with_holds_are_one_repeat(read_back: float) -> None:
    rng = np.random.default_rng(2)
    period = np.concatenate((triangle(800), np.zeros(300)))
    drive = np.concatenate((np.zeros(500), np.tile(period, 6)))
    drive += read_back * rng.standard_normal(drive.size)
    (repeat,) = find_repeats(drive)
    assert repeat.period_samples == 1100
    assert repeat.stop == drive.size - 1100
    assert repeat.n_periods == pytest.approx(6.0, abs=0.5)
    assert repeat.mismatch_v == pytest.approx(np.sqrt(2.0) * read_back, rel=0.1, abs=1e-12)


def test_a_raster_with_a_growing_level_repeats_only_on_its_fast_axis() -> None:
    fast = np.tile(triangle(500), 10)
    assert holds(find_repeats(fast), 0, 4500, 500)
    assert find_repeats(fast + np.linspace(0.0, 1.0, fast.size)) == ()


def test_few_samples_a_period() -> None:
    (repeat,) = find_repeats(np.sin(2.0 * np.pi * np.arange(5000) / 12.0))
    assert repeat.period_samples == 12


def test_from_the_settled_sample_on_the_extremes_have_passed() -> None:
    wave = multisine(np.random.default_rng(3), 1000, 30)
    (repeat,) = find_repeats(np.concatenate((np.zeros(100), np.tile(wave, 3))))
    assert repeat.settled >= 100 + max(int(np.argmax(wave)), int(np.argmin(wave)))


def test_measured_drives() -> None:
    try:
        model, test = pea_1hz()
        read_back = fsm(amplitude_mv=100).voltage_v
    except DataUnavailableError as error:
        pytest.skip(str(error))
    assert holds(find_repeats(model.voltage_v), 0, model.n_samples - 200, 200)
    assert all(r.mismatch_v == 0.0 for r in find_repeats(test.voltage_v))
    (repeat,) = find_repeats(read_back)
    assert (repeat.start, repeat.stop, repeat.period_samples) == (0, 8192, 8192)
    assert 1e-5 < repeat.mismatch_v < 1e-4


def test_a_million_samples_take_seconds() -> None:
    drive = np.random.default_rng(4).standard_normal(1_000_000)
    drive[600_000:603_000] = drive[100_000:103_000]
    started = time.process_time()
    assert holds(find_repeats(drive), 100_000, 103_000, 500_000)
    assert time.process_time() - started < 20.0
