"""What no cause explains is followed in whatever it depends on: time, place, a second axis, the temperature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim
from small_model import MODEL

from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.extended_model import as_written
from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension, unnamed_extension
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms
from fomrc_core.storage import read_model, write_model

_STEP_S, _N = 5e-3, 3000
_NOISE_UM = 1e-3

Array = np.ndarray
Hidden = Callable[[Array, Array, Array, Array], Array]


def waves(seed: int, slowest_hz: float, fastest_hz: float) -> Array:
    rng = np.random.default_rng(seed)
    t = _STEP_S * np.arange(_N)
    found = [rng.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * f * t) for f in rng.uniform(slowest_hz, fastest_hz, 5)]
    return np.asarray(np.sum(found, axis=0) * np.minimum(1.0, t / 0.5))


def measured(seed: int, hidden: Hidden) -> Recording:
    """Return a record whose reading has what ``hidden`` makes of time, displacement, second axis and temperature."""
    t, voltage = _STEP_S * np.arange(_N), waves(seed, 0.2, 3.0)
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(_N, _STEP_S), voltage)
    cross, celsius = 5.0 * waves(200 + seed, 0.1, 1.0), 21.0 + waves(300 + seed, 0.05, 0.3)
    noise = _NOISE_UM * np.random.default_rng(1000 + seed).normal(size=_N)
    read = moved + hidden(t, moved, cross, celsius) + noise
    return Recording(t, voltage, read, name=f"{seed}", cross_displacement_um=cross, temperature_c=celsius)


def followed(hidden: Hidden, seed: int = 1, learned: int = 0) -> tuple[DataSplit, TrialModel, UnnamedExtension] | None:
    """Return what follows the rest of records of a seed, learned from one of the three."""
    others = [k for k in range(3) if k != learned]
    first, second, third = (measured(10 * seed + k, hidden) for k in (learned, *others))
    split = split_data((first,), second, third, _NOISE_UM)
    found = unnamed_extension(base_model(split), split, _NOISE_UM)
    return None if found is None else (split, *found)


def warmed(t: Array, x: Array, cross: Array, celsius: Array) -> Array:
    """Return what a gain does that settles within half a minute, on the square of the displacement."""
    return np.asarray(-0.05 * x**2 * (1.0 - np.exp(-t / 30.0)))


def tilted(t: Array, x: Array, cross: Array, celsius: Array) -> Array:
    """Return what a second axis does that changes the gain of this one."""
    return np.asarray(0.002 * cross * x)


def heated(t: Array, x: Array, cross: Array, celsius: Array) -> Array:
    """Return what the temperature does to gain and place."""
    return np.asarray(0.01 * (celsius - 20.0) * x + 0.02 * (celsius - 20.0) ** 2)


def bumped(t: Array, x: Array, cross: Array, celsius: Array) -> Array:
    """Return what a bump in a scale does."""
    return np.asarray(0.03 * np.exp(-(((x - 0.4) / 0.2) ** 2)))


def rung(t: Array, x: Array, cross: Array, celsius: Array) -> Array:
    """Return what a stage does that rings at the frequency of its drive."""
    natural = 2.0 * np.pi * 0.2
    return np.asarray(lsim(([natural**2], [1.0, 0.1 * natural, natural**2]), x, t)[1] - x)


CASES = [
    (warmed, "unnamed_in_time", "the time since the start"),
    (tilted, "unnamed_second_axis", "the second axis times the displacement"),
    (heated, "unnamed_temperature", "the temperature"),
    (bumped, "unnamed_static", "of the displacement"),
]


@pytest.mark.parametrize(("hidden", "name", "word"), CASES, ids=[name for _, name, _ in CASES])
def test_what_it_depends_on_is_said_and_a_third_record_gains(
    hidden: Hidden, name: str, word: str, tmp_path: Path
) -> None:
    found = followed(hidden)
    assert found is not None
    split, trial, unnamed = found
    assert name in {effect.name for effect in unnamed.effects}
    assert word in unnamed.words
    assert unnamed.rms_after_um**2 - _NOISE_UM**2 <= 0.25 * (unnamed.rms_before_um**2 - _NOISE_UM**2)
    # written, read and simulated it is what was scored
    write_model(as_written(trial, split), tmp_path / "model.yaml")
    model, third = read_model(tmp_path / "model.yaml"), measured(12, hidden)
    beside = {"temperature_c": third.temperature_c, "cross": third.cross_displacement_um}
    left = third.measured_um - model.simulate(third.steps_s, third.voltage_v, **beside)
    assert rms(left - left.mean()) == pytest.approx(unnamed.rms_after_um, rel=0.02)
    # what is inverted is undone to rounding (bends of the drive within a step, which are not the terms', left out)
    plain = replace(model, substeps=Substeps.NONE)
    inverse = Compensator(plain)
    is_inverted = all(effect.can_invert for effect in unnamed.effects)
    assert is_inverted == (not dict(inverse.not_inverted))
    if is_inverted:
        wanted = plain.simulate(third.steps_s, 0.5 * third.voltage_v, **beside)
        again = plain.simulate(third.steps_s, inverse.run(third.steps_s, wanted, **beside), **beside)
        assert np.max(np.abs(again - wanted)) <= 1e-9 * np.ptp(wanted)


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_noise_beside_signals_that_do_nothing_is_not_followed(seed: int) -> None:
    assert followed(lambda t, x, cross, celsius: np.zeros_like(t), seed) is None


def test_terms_that_leave_no_instantaneous_part_leave_a_model_that_can_be_written() -> None:
    found = followed(rung, learned=2)
    assert found is not None
    split, trial, unnamed = found
    third = measured(11, rung)
    beside = {"temperature_c": third.temperature_c, "cross": third.cross_displacement_um}
    left = third.measured_um - as_written(trial, split).simulate(third.steps_s, third.voltage_v, **beside)
    assert rms(left - left.mean()) == pytest.approx(unnamed.rms_after_um, rel=0.02)


def test_terms_that_no_effect_may_have_are_no_extension(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise ParameterError("out of range", where="unnamed.weights_um", value=9e9, allowed="-1e+09 to 1e+09 um")

    assert followed(warmed) is not None
    monkeypatch.setattr("fomrc_core.diagnosis.unnamed_extension.fitted_beside", refused)
    assert followed(warmed) is None


def test_a_signal_that_one_record_lacks_is_not_offered() -> None:
    first, second, third = (measured(10 + k, tilted) for k in range(3))
    lacking = Recording(second.time_s, second.voltage_v, second.measured_um, name="lacking")
    split = split_data((first,), lacking, third, _NOISE_UM)
    found = unnamed_extension(base_model(split), split, _NOISE_UM)
    assert found is None or "unnamed_second_axis" not in {effect.name for effect in found[1].effects}
