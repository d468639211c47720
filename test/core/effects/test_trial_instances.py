"""What trial instances are read from a residual: lines of a hum and their harmonics, steps of a converter."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.effects.zero_order_hold import ZeroOrderHold


def record_of(voltage_v: np.ndarray, residual_um: np.ndarray, step_s: float) -> RecordEvidence:
    n = voltage_v.size
    return RecordEvidence(np.arange(n) * step_s, np.full(n, step_s), voltage_v, voltage_v, residual_um)


def sweep(n: int, n_sweeps: float) -> np.ndarray:
    return np.abs((np.arange(n) * n_sweeps / n) % 2.0 - 1.0)


@pytest.mark.parametrize("step_s", [2e-6, 1e-3, 0.3])
def test_a_tone_and_its_harmonics_are_one_cause_at_any_rate(step_s: float) -> None:
    n = 8000
    t = np.arange(n) * step_s
    frequency_hz = 0.0613 / step_s
    rng = np.random.default_rng(3)
    tone = 3e-3 * np.sin(2 * np.pi * frequency_hz * t + 0.4) + 5e-3 * np.sin(4 * np.pi * frequency_hz * t - 1.0)
    tone += 2e-3 * np.sin(6 * np.pi * frequency_hz * t + 2.0)
    record = record_of(sweep(n, 7.0), tone + 1e-3 * rng.standard_normal(n), step_s)
    trials = MainsHum.screening(Evidence((record,), 1e-3))
    assert len(trials) == 1
    found = trials[0]
    assert found.frequency_hz == pytest.approx(frequency_hz, rel=2e-4)
    left = found.run(found.initial_state(), np.zeros(n), record.steps_s) - tone
    assert np.std(left) < 0.3 * np.std(tone)


def test_a_line_of_the_drive_of_any_record_is_no_hum() -> None:
    n, step_s = 12_000, 1e-3
    t = np.arange(n) * step_s
    noise = 1e-4 * np.random.default_rng(5).standard_normal(n)
    slow = record_of(sweep(n, 7.0), noise + 5e-3 * np.sin(2 * np.pi * 8.98 * t), step_s)
    sine = record_of(np.sin(2 * np.pi * 9.0 * t), noise, step_s)
    assert MainsHum.screening(Evidence((slow,), 1e-4))
    trials = MainsHum.screening(Evidence((slow,), 1e-4, (sine,)))
    assert all(abs(trial.frequency_hz - 9.0) > 0.5 for trial in trials)
    assert not MainsHum(8.98, 5e-3).is_confirmed(t, sine.voltage_v, noise)
    harmonic = record_of(np.sin(2 * np.pi * 9.0 * t), noise + 5e-3 * np.sin(2 * np.pi * 27.0 * t), step_s)
    assert all(abs(trial.frequency_hz - 27.0) > 0.5 for trial in MainsHum.screening(Evidence((harmonic,), 1e-4)))
    apart = record_of(np.sin(2 * np.pi * 9.0 * t), noise + 5e-3 * np.sin(2 * np.pi * 27.5 * t), step_s)
    assert MainsHum.screening(Evidence((apart,), 1e-4))[0].frequency_hz == pytest.approx(27.5, 1e-3)


def test_a_tone_whose_fundamental_lies_under_the_drive_is_told_by_its_harmonics() -> None:
    n, step_s, frequency_hz = 12_000, 1e-3, 9.0
    t = np.arange(n) * step_s
    drive_v = np.sin(2 * np.pi * frequency_hz * t)
    tone = [0.3 * np.sin(2 * np.pi * k * frequency_hz * t + k) for k in (1, 2, 3)]
    noise = 1e-4 * np.random.default_rng(5).standard_normal(n)
    still = record_of(sweep(n, 7.0), sum(tone) + noise, step_s)
    driven = record_of(drive_v, np.zeros(n), step_s)
    # elsewhere a drive has this line: alone it is no tone of its own, with its harmonics it is
    alone = record_of(still.voltage_v, tone[0] + noise, step_s)
    trials = MainsHum.screening(Evidence((alone,), 1e-4, (driven,)))
    assert all(abs(trial.frequency_hz - frequency_hz) > 0.5 for trial in trials)
    found = MainsHum.screening(Evidence((still,), 1e-4, (driven,)))[0]
    assert found.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)
    assert found.amplitude_um == pytest.approx(0.3, rel=0.1)


def test_a_drift_of_few_cycles_is_no_hum_and_a_slow_tone_is_one() -> None:
    n, step_s = 6000, 0.1
    t = np.arange(n) * step_s
    noise = 1e-4 * np.random.default_rng(6).standard_normal(n)
    for n_cycles, is_tone in ((4.0, False), (25.0, True)):
        record = record_of(
            np.repeat(np.random.default_rng(7).random(300), 20),
            noise + 5e-3 * np.sin(2 * np.pi * n_cycles / (n * step_s) * t),
            step_s,
        )
        assert bool(MainsHum.screening(Evidence((record,), 1e-4))) is is_tone


@pytest.mark.parametrize("samples_per_step", [2.3, 12.0, 150.0, 900.0])
def test_a_converter_step_is_found_however_many_samples_it_lasts(samples_per_step: float) -> None:
    n, n_sweeps = 60_000, 1.0
    step_v = samples_per_step * n_sweeps / n
    voltage_v = 30.0 * sweep(n, n_sweeps) - 10.0
    step_v *= 30.0
    rng = np.random.default_rng(8)
    rounding = np.rint(voltage_v / step_v) * step_v - voltage_v
    smooth = 5.0 * step_v * np.sin(3.0 * voltage_v / 30.0)  # what hysteresis leaves
    record = record_of(voltage_v, rounding + smooth + 0.3 * step_v * rng.standard_normal(n), 1e-3)
    steps_v = [trial.step_v for trial in DacQuantization.screening(Evidence((record,), 1e-3))]
    assert min(abs(found / step_v - 1.0) for found in steps_v) < 2e-3


@pytest.mark.parametrize("n_held", [2, 17, 70, 160])
def test_a_hold_of_any_number_of_samples_is_tried(n_held: int) -> None:
    n, step_s = 8000, 1e-3
    t = np.arange(n) * step_s
    drive = np.sin(2.0 * np.pi * 2.0 * t) + 0.3 * np.sin(2.0 * np.pi * 3.1 * t)
    held = drive[(np.arange(n) // n_held) * n_held]
    noise = 0.01 * np.random.default_rng(5).standard_normal(n)
    trials = ZeroOrderHold.screening(Evidence((record_of(drive, 0.7 * (held - drive) + noise, step_s),), 0.01))
    assert n_held * step_s in [pytest.approx(trial.hold_s) for trial in trials]
