"""Thinning loses no turn of the drive, averages what a first fit leaves, and tells what it averaged away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.effects import effect_classes
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.long_records import LongRecords
from fomrc_core.fitting.memory_plan import DIAGNOSING, IDENTIFYING, kept_samples
from fomrc_core.fitting.steady_tones import steady_tones
from fomrc_core.fitting.structure_within import is_calmer, structure_within
from fomrc_core.fitting.thinned_record import thinned_records
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.drive_outline import drive_outline
from fomrc_core.records.recording import Recording
from test.core.small_model import MODEL

RATE_HZ, N_IN_BIN, NOISE_UM = 1e4, 25, 1e-3


def jumps_and_loops(n: int = 100_000):
    """Jumps with rests in between, and triangles whose turns lie nowhere near a bin's middle."""
    rng = np.random.default_rng(5)
    at_s, level_v = [0.0], [0.0]
    while at_s[-1] < n / RATE_HZ:
        v = rng.uniform(0.0, 2.0)
        if rng.random() < 0.4:
            at_s += [at_s[-1] + 1e-4, at_s[-1] + rng.uniform(0.1, 0.3)]
            level_v += [v, v]
        else:
            at_s.append(at_s[-1] + rng.uniform(0.05, 0.3))
            level_v.append(v)
    time_s = np.arange(n) / RATE_HZ
    return time_s, np.interp(time_s, at_s, level_v)


def record(extra_um=0.0, lag_s: float = 0.0):
    time_s, voltage_v = jumps_and_loops()
    reached_v = voltage_v
    if lag_s:
        keep = np.exp(-1.0 / (RATE_HZ * lag_s))
        reached_v = np.empty(voltage_v.size)
        level = 0.0
        for k, v in enumerate(voltage_v):
            level = keep * level + (1.0 - keep) * v
            reached_v[k] = level
    moved_um = PiezoModel.from_mapping(MODEL).simulate(np.full(time_s.size, 1.0 / RATE_HZ), reached_v)
    noise_um = np.random.default_rng(1).normal(0.0, NOISE_UM, time_s.size)
    return Recording(time_s, voltage_v, moved_um + extra_um + noise_um, name="stage"), moved_um


def test_the_outline_of_a_drive_keeps_what_hysteresis_remembers():
    time_s, voltage_v = jumps_and_loops()
    outline = drive_outline(time_s, voltage_v, N_IN_BIN)
    assert outline is not None
    kept = outline.samples
    assert np.array_equal(np.sort(outline.bin_of[outline.bin_of >= 0]), np.arange(voltage_v.size // N_IN_BIN))
    steps_s = np.full(voltage_v.size, 1.0 / RATE_HZ)
    model = PiezoModel.from_mapping(MODEL)
    whole_um = model.simulate(steps_s, voltage_v)
    kept_um = model.simulate(np.diff(time_s[kept], prepend=-1.0 / RATE_HZ), voltage_v[kept])
    every_um = model.simulate(np.full(whole_um[12::25].size, 25.0 / RATE_HZ), voltage_v[12::25])
    lost = float(np.std(kept_um - whole_um[kept]))
    assert lost < 0.3e-3
    # every 25th sample, turns and jumps left where they are, loses many times as much
    assert float(np.std(every_um - whole_um[12::25])) > 5.0 * lost


def test_a_drive_that_turns_in_every_bin_is_not_thinned():
    time_s = np.arange(20_000) / RATE_HZ
    assert drive_outline(time_s, np.sin(2.0 * np.pi * 900.0 * time_s), N_IN_BIN) is None


def test_means_are_as_noisy_as_they_should_be_and_bent_nowhere():
    whole, _ = record()
    (thinned,) = thinned_records((whole,), N_IN_BIN)
    kept = thinned.recording
    moved_um = PiezoModel.from_mapping(MODEL).simulate(np.diff(kept.time_s, prepend=-1.0 / RATE_HZ), kept.voltage_v)
    error_um = (kept.measured_um - moved_um)[thinned.is_mean]
    assert float(np.std(error_um)) == pytest.approx(NOISE_UM / np.sqrt(N_IN_BIN), rel=0.1)
    assert thinned.noise_um == pytest.approx(NOISE_UM, rel=0.03)
    assert structure_within(thinned) == ()


def test_what_is_averaged_away_is_told():
    time_s, _ = jumps_and_loops()
    is_on = time_s < 0.5 * time_s[-1]
    tone, _ = record(extra_um=1e-3 * np.sin(2.0 * np.pi * 730.0 * time_s) * is_on)
    (thinned,) = thinned_records((tone,), N_IN_BIN)
    assert thinned.tones == ()
    (line,) = structure_within(thinned)
    assert "a line at 729.98 Hz" in line
    lagging, _ = record(lag_s=5e-4)
    (thinned,) = thinned_records((lagging,), N_IN_BIN)
    (after_jumps,) = structure_within(thinned)
    assert "turns and jumps" in after_jumps


@pytest.mark.parametrize("frequency_hz", [50.0, 730.0])
def test_a_steady_tone_is_taken_out_before_readings_are_averaged(frequency_hz: float):
    time_s, _ = jumps_and_loops()
    size_um, phase_rad = 1.5e-3, 0.7
    hum, _ = record(extra_um=size_um * np.sin(2.0 * np.pi * frequency_hz * time_s + phase_rad))
    (thinned,) = thinned_records((hum,), N_IN_BIN)
    (tone,) = thinned.tones
    # a sine's amplitude is known to sqrt(2 / n) of the noise, through a Hann window to sqrt(3 / n)
    error_um = NOISE_UM * np.sqrt(3.0 / time_s.size)
    assert tone.amplitude_um == pytest.approx(size_um, abs=5.0 * error_um)
    # of the frequency: sqrt(6) / (pi T) of that, of the amplitude
    assert tone.frequency_hz == pytest.approx(frequency_hz, abs=5.0 * error_um / size_um / (1.2 * time_s[-1]))
    plain, _ = record()
    left_um = thinned.recording.measured_um - thinned_records((plain,), N_IN_BIN)[0].recording.measured_um
    assert float(np.std(left_um)) < 0.1 * NOISE_UM
    assert structure_within(thinned) == ()


def test_harmonics_of_the_drive_and_noise_are_no_tones():
    rng = np.random.default_rng(4)
    time_s = np.arange(100_000) / RATE_HZ
    drive_v = np.sin(2.0 * np.pi * 20.0 * time_s)
    left_um = rng.normal(0.0, NOISE_UM, time_s.size)
    assert steady_tones("stage", left_um, 1.0 / RATE_HZ, drive_v, 1.0 / RATE_HZ) == []
    left_um += 1e-3 * np.sin(2.0 * np.pi * 60.0 * time_s)
    assert steady_tones("stage", left_um, 1.0 / RATE_HZ, drive_v, 1.0 / RATE_HZ) == []
    (tone,) = steady_tones("stage", left_um, 1.0 / RATE_HZ, rng.normal(0.0, 1.0, 4_000), 25.0 / RATE_HZ)
    assert tone.frequency_hz == pytest.approx(60.0, abs=1e-2)


def test_a_first_fit_with_the_effect_that_acts_leaves_less_within_the_bins():
    lagging, _ = record(lag_s=5e-4)
    thinned = thinned_records((lagging,), N_IN_BIN)
    lag = effect_classes()["amplifier_bandwidth"]
    right = (thinned[0].about((lag(1.0 / (2.0 * np.pi * 5e-4)),)),)
    assert is_calmer(thinned, right, beyond=50_000)
    assert not is_calmer(right, thinned, beyond=50_000)
    assert right[0].within_um < 0.25 * thinned[0].within_um


def test_memory_says_how_many_samples_are_kept():
    assert kept_samples(250_000, DIAGNOSING, 2.0, n_parts=2.5) is None
    assert kept_samples(250_001, DIAGNOSING, 2.0, n_parts=2.5) == DIAGNOSING.n_kept
    assert kept_samples(150_000, DIAGNOSING, 2.0) is None
    assert kept_samples(200_000, DIAGNOSING, 2.0) == DIAGNOSING.n_kept, "of a drive that jumps with each sample"
    assert kept_samples(250_000, IDENTIFYING, 2.0) is None
    assert kept_samples(10_000_000, DIAGNOSING, 2.0) < 2e9 / DIAGNOSING.bytes_per_sample
    with pytest.raises(ParameterError, match=r"max_memory_gb: too little memory for 10000000 samples.* GB or more"):
        kept_samples(10_000_000, DIAGNOSING, 1.0)


def test_a_record_whose_beginning_turns_in_every_bin_is_thinned_less_and_not_refused():
    # three hundred turns are few of the whole record, and many of the fifth of it that is kept with bins of three
    fast_v = np.resize([0.0, 2.0], 300)
    slow_v = 2.0 * np.sin(np.arange(29_700) * 1e-3)
    voltage_v = np.concatenate((fast_v, slow_v))
    noise_um = np.random.default_rng(1).normal(0.0, 1e-3, voltage_v.size)
    record = Recording(np.arange(voltage_v.size) / RATE_HZ, voltage_v, 0.5 * voltage_v + noise_um)
    work = replace(DIAGNOSING, n_whole_max=1_000, n_kept=2_000)
    records = LongRecords.of([record], work, 2.0)
    assert records is not None
    assert all(0 < r.n_samples <= 3_000 for r in records.recordings)
