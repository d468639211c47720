"""What no cause explains is followed all the same, scored as it is written, and never called a cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_model import MODEL

from fomrc_core.diagnosis.diagnosis import Diagnosis, Status, diagnose
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms
from fomrc_core.storage import read_model, write_model

_STEP_S = 2e-3
_NOISE_UM = 1e-3


def drive_v(seed: int, n: int = 2000) -> np.ndarray:
    rng = np.random.default_rng(seed)
    t = _STEP_S * np.arange(n)
    waves = [rng.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * f * t) for f in rng.uniform(0.2, 3.0, 5)]
    return np.asarray(np.sum(waves, axis=0) * np.minimum(1.0, t / 0.5))


def measured(seed: int, per_um_per_s: float, n: int = 2000) -> Recording:
    """Return a stage whose motion of the last tenth of a second makes it go further: no cause of the library."""
    voltage = drive_v(seed, n)
    steps = np.full(n, _STEP_S)
    moved = PiezoModel.from_mapping(MODEL).simulate(steps, voltage)
    speed = np.abs(np.diff(moved, prepend=0.0)) / _STEP_S
    weight = np.exp(-_STEP_S * np.arange(400) / 0.1)
    recent = np.convolve(speed, weight / weight.sum())[:n]
    noise = _NOISE_UM * np.random.default_rng(1000 + seed).normal(size=n)
    return Recording(_STEP_S * np.arange(n), voltage, moved * (1.0 + per_um_per_s * recent) + noise, name=f"{seed}")


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnose(measured(1, 0.004), test=measured(2, 0.004), report=measured(3, 0.004))


def test_the_error_on_a_third_record_is_less_than_half_and_no_cause_is_sure(found: Diagnosis) -> None:
    assert found.status not in (Status.EXPLAINED, Status.NOTHING_FOUND)
    assert found.unnamed is not None, found.summary()
    print(found.summary())
    assert found.final_test_percent < 0.5 * found.baseline_test_percent
    assert found.unnamed.rms_after_um < found.unnamed.rms_before_um
    names = {finding.cause for finding in found.findings} | set(found.ambiguous_with)
    assert not {effect.name for effect in found.unnamed.effects} & names
    assert "the last" in found.unnamed.words


def test_what_is_written_is_what_is_scored(found: Diagnosis, tmp_path: Path) -> None:
    write_model(found.extended_model, tmp_path / "model.yaml")
    model = read_model(tmp_path / "model.yaml")
    record = measured(3, 0.004)
    left = record.measured_um - model.simulate(record.steps_s, record.voltage_v)
    span = float(np.ptp(record.measured_um))
    assert 100.0 * rms(left - left.mean()) / span == pytest.approx(found.final_test_percent, rel=0.02)


def test_it_is_inverted_where_it_is_not_steep(found: Diagnosis) -> None:
    model = found.extended_model
    assert found.unnamed is not None
    (effect,) = (effect for effect in model.effects if effect in found.unnamed.effects)
    assert effect.can_invert == (effect.name not in dict(Compensator(model).not_inverted))
    voltage = 0.5 * drive_v(4)[:2000]
    steps = np.full(voltage.size, _STEP_S)
    wanted = model.simulate(steps, voltage)
    again = model.simulate(steps, Compensator(model).run(steps, wanted))
    if effect.can_invert:
        assert np.max(np.abs(again - wanted)) <= 1e-9 * np.ptp(wanted)


def test_noise_alone_is_not_followed() -> None:
    train, test, report = (measured(seed, 0.0, 4500) for seed in (5, 6, 7))
    found = diagnose(train, test=test, report=report)
    assert found.unnamed is None
    assert found.status is Status.NOTHING_FOUND
