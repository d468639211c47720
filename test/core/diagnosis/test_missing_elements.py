"""A model given with too few elements is mended where elements are all it lacks."""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3
_WIDTHS_V = np.array([0.0, 2.0, 4.0, 7.0, 11.0, 16.0, 22.0, 30.0])
_SLOPES_UM_PER_V = np.array([0.05, 0.012, 0.01, 0.009, 0.008, 0.006, 0.006, 0.004])


def _moved_um(voltage_v: np.ndarray) -> np.ndarray:
    """Return the sum of plays, each following the drive at the end of its own slack."""
    places = np.zeros(_WIDTHS_V.size)
    moved = np.empty(voltage_v.size)
    for k, v in enumerate(voltage_v):
        places = np.where(
            v - places > _WIDTHS_V, v - _WIDTHS_V, np.where(places - v > _WIDTHS_V, v + _WIDTHS_V, places)
        )
        moved[k] = places @ _SLOPES_UM_PER_V
    return moved


def _record(seed: int, n_turns: int) -> Recording:
    rng = np.random.default_rng(seed)
    turns_v = np.concatenate(([0.0], rng.uniform(-50.0, 50.0, n_turns)))
    drive_v = np.interp(np.arange(80 * n_turns) / 80.0, np.arange(n_turns + 1), turns_v)
    moved_um = _moved_um(drive_v)
    noise_um = _NOISE_UM * rng.standard_normal(drive_v.size)
    return Recording(np.arange(drive_v.size) * 0.01, drive_v, moved_um + noise_um, name=f"of {n_turns} turns")


def test_the_written_model_has_the_elements_and_the_error_of_noise() -> None:
    # two springs that slip, and one that does not, of about the first and the last slope of the truth
    given = PiezoModel((20.0, 40.0, 10.0), (1.5, 12.0), 0.0)
    found = diagnose(_record(11, 30), test=_record(12, 20), report=_record(13, 20), model=given)
    assert [finding.cause for finding in found.findings] == ["missing_hysteresis"]
    assert found.status.value == "explained"
    assert found.extended_model.n_elements > given.n_elements
    assert found.final_test_percent < 0.5 * found.baseline_test_percent
    # quoted is what the written model does itself
    third = _record(13, 20)
    left_um = third.measured_um - found.extended_model.simulate(np.full(third.n_samples, 0.01), third.voltage_v)
    assert float(np.std(left_um)) < 1.2 * _NOISE_UM
