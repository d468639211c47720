"""What a residual is looked at against, on signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.records.drive import is_settled
from fomrc_core.report.residual_views import (
    amplitude_density,
    binned,
    envelope,
    loop_phase_deg,
    time_since_motion_s,
)


def test_loops_of_any_size_and_mean_have_one_phase() -> None:
    large = np.concatenate((np.linspace(0.0, 4.0, 101), np.linspace(4.0, 0.0, 101)[1:]))
    phase = loop_phase_deg(np.concatenate((large, 1.0 + 0.25 * large[1:])))
    # up 0..180, down 180..360; the jump from 0 V to 1 V belongs to the second way up
    np.testing.assert_allclose(phase[1:100], np.arange(1, 100) * 1.8, atol=1e-9)
    np.testing.assert_allclose(phase[102:200], 180.0 + np.arange(2, 100) * 1.8, atol=1e-9)
    np.testing.assert_allclose(phase[302:400], 180.0 + np.arange(2, 100) * 1.8, atol=1e-9)


def test_ripple_does_not_turn_the_drive_and_rest_has_no_phase() -> None:
    drive = np.linspace(0.0, 1.0, 1001) + 0.005 * np.sin(np.arange(1001))
    assert np.nanmax(loop_phase_deg(drive)) <= 180.0
    drive[500:600] = drive[499]
    assert np.all(np.isnan(loop_phase_deg(drive)[500:600]))


def test_time_since_motion_counts_from_the_last_step() -> None:
    time_s = np.arange(300) * 0.01
    drive = np.where(np.arange(300) < 100, 0.0, np.where(np.arange(300) < 200, 1.0, 3.0))
    since = time_since_motion_s(time_s, drive)
    assert np.all(np.isnan(since[:101]))  # nothing is known of what went before
    np.testing.assert_allclose(since[101:200], np.arange(1, 100) * 0.01)
    assert np.isnan(since[200])
    np.testing.assert_allclose(since[201:], np.arange(1, 100) * 0.01)


@pytest.mark.parametrize("by_rank", [False, True])
def test_bins_hold_mean_and_spread(by_rank: bool) -> None:
    generator = np.random.default_rng(0)
    x = generator.uniform(-2.0, 2.0, 200_000)
    y = 3.0 * x + generator.normal(0.0, 0.5, x.size)
    x[::7] = np.nan
    bins = binned(x, y, by_rank=by_rank)
    assert bins.centres.size == 40
    np.testing.assert_allclose(bins.means, 3.0 * bins.centres, atol=0.05)
    np.testing.assert_allclose(bins.spreads, np.hypot(0.5, 3.0 * 0.1 / np.sqrt(12.0)), rtol=0.05)


def test_bins_of_nothing_are_empty() -> None:
    assert binned(np.full(50, np.nan), np.ones(50)).centres.size == 0
    assert binned(np.ones(50), np.ones(50)).centres.size == 0


def test_density_of_white_noise_is_level_and_of_known_height() -> None:
    time_s = np.arange(100_000) / 500.0
    noise = np.random.default_rng(1).normal(0.0, 2.0, time_s.size)
    frequency_hz, density = amplitude_density(time_s, noise)
    assert frequency_hz[-1] == pytest.approx(250.0)
    assert np.sqrt(np.mean(density**2)) == pytest.approx(2.0 / np.sqrt(250.0), rel=0.02)


def test_density_finds_a_hum_though_samples_are_missing() -> None:
    time_s = np.delete(np.arange(20_000) / 1000.0, np.arange(100, 20_000, 91))
    frequency_hz, density = amplitude_density(time_s, np.sin(2.0 * np.pi * 50.0 * time_s))
    assert frequency_hz[np.argmax(density)] == pytest.approx(50.0, abs=0.3)


def test_an_envelope_is_short_and_loses_no_spike() -> None:
    time_s = np.arange(70_003) * 1e-3
    values = np.sin(time_s)
    values[[12_345, 70_001]] = 9.0, -9.0
    t, v = envelope(time_s, values)
    assert t.size < 3500
    assert np.all(np.diff(t) > 0.0)
    assert t[np.argmax(v)] == time_s[12_345]
    assert t[np.argmin(v)] == time_s[70_001]
    assert envelope(time_s[:50], values[:50])[0].size == 50


def test_only_a_start_away_from_zero_is_left_out() -> None:
    time_s = np.arange(1000) * 0.01
    assert np.all(is_settled(time_s, np.sin(time_s)))
    settled = is_settled(time_s, 1.0 + np.sin(time_s))
    assert not np.any(settled[:19])
    assert np.all(settled[20:])
