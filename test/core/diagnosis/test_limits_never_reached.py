"""A limit that only the training record reaches stays a finding, whatever else is found after it."""

from __future__ import annotations

import numpy as np

from fomrc_core import Recording, diagnose
from fomrc_core.diagnosis.data_split import is_idle_held, split_data
from fomrc_core.effects.amplifier_slew_limit import AmplifierSlewLimit
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.operators.hysteresis import OperatorSum

_STEP_S = 2e-3
_SLEW_V_PER_S = 400.0
_NOISE_UM = 1e-3
_PLAYS = ((0.0, 0.08), (3.0, 0.012), (8.0, 0.01), (20.0, 0.008))  # half widths [V], weights [um/V]


def moved_um(command_v: np.ndarray) -> np.ndarray:
    """Return a sum of plays behind an amplifier of limited rate, and a sensor that is not straight [um]."""
    most_v = _SLEW_V_PER_S * _STEP_S
    total_um, at_v = np.zeros(command_v.size), [0.0] * len(_PLAYS)
    drive_v = 0.0
    for k, wanted_v in enumerate(command_v):
        drive_v += min(max(wanted_v - drive_v, -most_v), most_v)
        for j, (half_width_v, weight) in enumerate(_PLAYS):
            at_v[j] = min(max(at_v[j], drive_v - half_width_v), drive_v + half_width_v)
            total_um[k] += weight * at_v[j]
    return total_um + 1.5e-3 * total_um**2


def record(command_v: np.ndarray, seed: int) -> Recording:
    """Return what is measured of it, with white noise."""
    noise_um = _NOISE_UM * np.random.default_rng(seed).standard_normal(command_v.size)
    time_s = _STEP_S * np.arange(command_v.size)
    return Recording(time_s, command_v, moved_um(command_v) + noise_um, name=f"record {seed}")


def sines(amplitudes_v: tuple[float, ...], n_samples: int) -> np.ndarray:
    """Return a period of a sine of each amplitude [V]."""
    return np.concatenate([a * np.sin(2.0 * np.pi * np.arange(n_samples) / n_samples) for a in amplitudes_v])


def test_a_limit_does_nothing_in_a_record_that_is_slower() -> None:
    fast, slow = record(np.repeat([0.0, 30.0, -20.0], 200), 1), record(sines((45.0,), 700), 2)
    plays = OperatorSum(0.08, np.array([3.0, 8.0, 20.0]), np.array([0.012, 0.01, 0.008]))
    effects = (AmplifierSlewLimit(_SLEW_V_PER_S), SensorNonlinearity(1.5e-3, 0.0))
    model = TrialModel.of_play_form(plays, 0.0, effects)
    for held_out, is_idle in ((slow, True), (fast, False)):
        split = split_data((fast,), held_out, None, _NOISE_UM)
        assert is_idle_held(model, "amplifier_slew_limit", split) is is_idle
        assert not is_idle_held(model, "sensor_nonlinearity", split)


def test_a_slew_limit_stays_where_held_out_data_never_reach_it() -> None:
    jumps = np.repeat(np.random.default_rng(5).uniform(-50.0, 50.0, 25), 140)
    train = np.concatenate((sines((50.0, 35.0, 20.0, 8.0), 600), jumps, sines((28.0, 44.0), 600)))
    slow = sines((45.0, 15.0, 30.0), 700)
    assert np.max(np.abs(np.diff(slow))) < 0.6 * _SLEW_V_PER_S * _STEP_S
    found = diagnose([record(train, 1)], test=record(slow, 2), report=record(slow[::-1].copy(), 3))
    assert sorted(f.cause for f in found.findings) == ["amplifier_slew_limit", "sensor_nonlinearity"]
    (limit,) = (f for f in found.findings if f.cause == "amplifier_slew_limit")
    assert abs(limit.parameters["slew_v_per_s"] / _SLEW_V_PER_S - 1.0) < 0.05
