"""Where a drive turns, how it begins, what of it is held out."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.records.drive import (
    begins_at_zero,
    held_out_blocks,
    is_settled,
    learned_blocks,
    longest_sweep,
    turning_points,
)


def test_a_drive_turns_where_it_goes_back_by_more_than_the_least_turn() -> None:
    voltage_v = np.array([0.0, 1.0, 2.0, 1.95, 2.5, 1.0, 1.0, 0.5, 3.0])
    assert turning_points(voltage_v, 0.1).tolist() == [0, 4, 7, 8]
    assert turning_points(voltage_v, 0.01).tolist() == [0, 2, 3, 4, 7, 8]
    assert turning_points(voltage_v, 1.6).tolist() == [0, 4, 7, 8]
    assert turning_points(voltage_v, 2.2).tolist() == [0, 8]


def test_a_level_top_turns_once_and_rest_never() -> None:
    assert turning_points(np.array([0.0, 1.0, 1.0, 1.0, 0.0]), 0.1).tolist() == [0, 1, 4]
    assert turning_points(np.full(5, 2.0), 0.0).tolist() == [0]


def test_noise_of_a_measured_voltage_neither_turns_the_drive_nor_cuts_its_sweeps() -> None:
    rng = np.random.default_rng(0)
    rise = np.concatenate((np.linspace(0.0, 1.0, 500), np.linspace(1.0, 0.0, 250)[1:]))
    noisy = rise + 1e-3 * rng.standard_normal(rise.size)
    assert turning_points(noisy, 0.02).size == 3
    assert longest_sweep([rise]) == 499
    assert longest_sweep([rise, noisy]) == pytest.approx(499, abs=5)


def test_a_sweep_counts_only_samples_that_move() -> None:
    stairs = np.repeat(np.concatenate((np.arange(11.0), np.arange(10.0)[::-1])), 100)
    assert longest_sweep([stairs]) == 10
    assert longest_sweep([np.ones(7)]) == 0


def test_a_record_begins_at_zero_volts_or_its_first_fiftieth_says_nothing() -> None:
    time_s = 5.0 + 0.01 * np.arange(1000)
    wave = np.sin(time_s - time_s[0])
    assert begins_at_zero(wave)
    assert begins_at_zero(wave + 0.01)
    assert not begins_at_zero(wave + 0.1)
    assert is_settled(time_s, wave).all()
    assert np.flatnonzero(is_settled(time_s, wave + 0.1))[0] == 20


@pytest.mark.parametrize("n_samples", [200, 1000, 12345])
def test_what_is_held_out_is_not_learned_from(n_samples: int) -> None:
    held, learned = held_out_blocks(n_samples), learned_blocks(n_samples)
    assert not np.any(held & learned)
    assert np.mean(learned) == pytest.approx(13 / 20, abs=0.02)
    assert np.mean(held) == pytest.approx(0.8 * 7 / 20, abs=0.02)
    # between what is learned from and what is scored lies a tenth of a block
    assert np.min(np.abs(np.flatnonzero(held)[:, None] - np.flatnonzero(learned)[None, :])) >= 0.1 * n_samples / 20 - 1
