"""What acts on the drive before hysteresis is followed there: memory, swings, what a converter repeats."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim
from small_model import MODEL

from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.drive_period import drive_period_v
from fomrc_core.diagnosis.extended_model import as_written
from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension, unnamed_extension
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms
from fomrc_core.storage import read_model, write_model

_STEP_S, _N = 5e-3, 3000
_NOISE_UM = 1e-3

Array = np.ndarray
Altered = Callable[[Array, Array], Array]


def leaked(t: Array, v: Array) -> Array:
    """Return what two leaks one behind the other leave of a drive: no single time constant."""
    once = lsim(([1.0, 0.0], [1.0, 1.0 / 8.0]), v, t)[1]
    return np.asarray(lsim(([1.0, 0.0], [1.0, 1.0 / 3.0]), once, t)[1])


def overshot(t: Array, v: Array) -> Array:
    """Return a drive that swings past each step, in part."""
    natural = 2.0 * np.pi * 4.0
    return np.asarray(v + 0.5 * (lsim(([natural**2], [1.0, 0.5 * natural, natural**2]), v, t)[1] - v))


def of_few_levels(t: Array, v: Array) -> Array:
    """Return a drive whose converter's levels are uneven by turns."""
    return np.asarray(np.rint(v / 0.05) * 0.05 - 0.01 * np.sin(2.0 * np.pi * v / 0.05))


def measured(seed: int, altered: Altered) -> Recording:
    rng = np.random.default_rng(seed)
    t = _STEP_S * np.arange(_N)
    smooth = [rng.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * f * t) for f in rng.uniform(0.2, 3.0, 5)]
    voltage = np.sum(smooth, axis=0) * np.minimum(1.0, t / 0.5)
    voltage[_N // 2 :] += np.repeat(rng.uniform(-0.5, 0.5, _N // 2 // 50), 50)
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(_N, _STEP_S), altered(t, voltage))
    return Recording(t, voltage, moved + _NOISE_UM * rng.normal(size=_N), name=f"{seed}")


def followed(altered: Altered) -> tuple[DataSplit, TrialModel, tuple[TrialModel, UnnamedExtension] | None]:
    first, second, third = (measured(10 + k, altered) for k in range(3))
    split = split_data((first,), second, third, _NOISE_UM)
    base = base_model(split)
    return split, base, unnamed_extension(base, split, _NOISE_UM)


CASES = [
    (leaked, "unnamed_drive", "the drive in the last"),
    (overshot, "", "swings of the"),  # so little that swings of the displacement may do as well
    (of_few_levels, "unnamed_converter", "the commanded voltage with a period of 0.05"),
]


@pytest.mark.parametrize(("altered", "name", "word"), CASES, ids=["leaked", "overshot", "of_few_levels"])
def test_what_is_altered_before_hysteresis_is_followed(altered: Altered, name: str, word: str, tmp_path: Path) -> None:
    split, base, found = followed(altered)
    assert found is not None
    trial, unnamed = found
    print(unnamed)
    assert not name or name in {effect.name for effect in unnamed.effects}
    assert word in unnamed.words
    assert unnamed.rms_after_um**2 - _NOISE_UM**2 <= 0.25 * (unnamed.rms_before_um**2 - _NOISE_UM**2)
    # fitted together they are better in training, and plays are those of elements
    errors = [squared_error(split.train, residuals(model, split.train)) for model in (base, trial)]
    assert errors[1] < errors[0]
    assert np.all(trial.weights[trial.columns.is_plain] >= 0.0)
    # written, read and simulated it is what was scored
    write_model(as_written(trial, split), tmp_path / "model.yaml")
    model, third = read_model(tmp_path / "model.yaml"), measured(12, altered)
    left = third.measured_um - model.simulate(third.steps_s, third.voltage_v)
    assert rms(left - left.mean()) == pytest.approx(unnamed.rms_after_um, rel=0.02)


def test_noise_alone_is_not_followed() -> None:
    assert followed(lambda t, v: v)[2] is None


@pytest.mark.parametrize("n_samples", [3000, 12_000])
def test_a_period_of_the_voltage_is_seen_in_what_is_left_and_in_noise_none(n_samples: int) -> None:
    rng = np.random.default_rng(4)
    voltage = 40.0 * np.sin(0.01 * np.arange(n_samples)) + 0.1 * np.cumsum(rng.normal(size=n_samples))
    noise = rng.normal(size=n_samples)
    assert drive_period_v([voltage], [noise]) is None
    period = drive_period_v([voltage], [noise + voltage / 0.7 - np.rint(voltage / 0.7)])
    assert period is None or period == pytest.approx(0.7, rel=1e-3)
    period = drive_period_v([voltage], [0.1 * noise + voltage / 0.7 - np.rint(voltage / 0.7)])
    assert period == pytest.approx(0.7, rel=1e-3)
    assert drive_period_v([np.ones(50)], [noise[:50]]) is None


def rung(t: Array, moved: Array) -> Array:
    """Return a displacement that comes through two light modes side by side."""
    parts = []
    for share, frequency_hz, damping in ((0.7, 7.3, 0.02), (0.3, 19.0, 0.015)):
        natural = 2.0 * np.pi * frequency_hz
        parts.append(share * lsim(([natural**2], [1.0, 2.0 * damping * natural, natural**2]), moved, t)[1])
    return np.sum(parts, axis=0)


def test_light_modes_are_followed_where_what_is_left_rings() -> None:
    def record(seed: int) -> Recording:
        still = measured(seed, lambda t, v: v)
        noise_um = _NOISE_UM * np.random.default_rng(seed + 100).normal(size=_N)
        moved_um = PiezoModel.from_mapping(MODEL).simulate(still.steps_s, still.voltage_v)
        return Recording(still.time_s, still.voltage_v, rung(still.time_s, moved_um) + noise_um, name=f"{seed}")

    split = split_data((record(30),), record(31), record(32), _NOISE_UM)
    base = base_model(split)
    found = unnamed_extension(base, split, _NOISE_UM)
    assert found is not None
    _, unnamed = found
    print(unnamed)
    assert unnamed.words.count("swings of the displacement") == 2
    assert unnamed.rms_after_um < 0.1 * unnamed.rms_before_um
