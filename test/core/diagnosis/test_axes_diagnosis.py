"""Causes of several axes: named where they are, in models of the library's own; what rests on nothing is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fomrc_core.cli.application import run
from fomrc_core.diagnosis.axes import AxesDiagnosis, AxesRecord, diagnose_axes
from fomrc_core.errors import ParameterError, RecordingError
from fomrc_core.model.axes import AxesModel, AxesModes, LevelLaw
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.report.axes_diagnosis_files import write_axes_report
from fomrc_core.report.diagnosis_names import FILE_NAMES
from fomrc_core.storage.axes_files import read_axes_fit_error, read_axes_model, write_axes_model

Array = NDArray[np.float64]

_RATE_HZ, _N, _NOISE = 2000.0, 1024, 0.005
_MIX = np.array([[1.0, 0.05], [0.0, 1.0]])


def _stage() -> AxesModel:
    axes = (
        PiezoModel(np.array([4.0, 1.0]), np.array([0.5]), 0.0),
        PiezoModel(np.array([3.0, 1.0]), np.array([0.4]), 0.0),
    )
    outputs = np.array([[1.0, 0.02], [0.01, 1.0], [1.0, 0.01], [0.03, 1.0]])
    inputs = np.array([[0.8, 0.01], [0.01, 0.8], [0.2, 0.01], [0.0, 0.2]])
    modes = AxesModes(np.array([95.0, 130.0, 310.0, 390.0]), np.array([0.02, 0.03, 0.02, 0.02]), outputs, inputs)
    return AxesModel(axes, modes)


def _records(truth: AxesModel, n: int = 2) -> list[AxesRecord]:
    records = []
    for r in range(n):
        rng = np.random.default_rng(r)
        spectrum = np.zeros((_N // 2 + 1, 2), complex)
        spectrum[1:300] = np.exp(2j * np.pi * rng.random((299, 2)))
        u = np.fft.irfft(spectrum, n=_N, axis=0)
        u *= (0.5, 1.5)[r % 2] / u.std(axis=0)
        drive = np.tile(u, (3, 1))
        level = float(np.sqrt(np.mean(u**2)))
        y = truth.simulate(np.full(3 * _N, 1.0 / _RATE_HZ), drive, truth.initial_state(level))[_N:]
        y = y + _NOISE * y.std(axis=0) * rng.normal(size=y.shape)
        shape = (2, _N, 2)
        records.append(
            AxesRecord.of(
                f"record {r}",
                _RATE_HZ,
                drive[_N:].reshape(shape).transpose(1, 2, 0),
                y.reshape(shape).transpose(1, 2, 0),
            )
        )
    return records


def _named(truth: AxesModel, base: AxesModel | None = None) -> AxesDiagnosis:
    return diagnose_axes(_records(truth), base or _stage())


def test_a_right_model_is_left_alone() -> None:
    found = _named(_stage())
    assert found.findings == ()
    assert found.axes == ()
    assert found.status.value == "nothing_found"
    assert found.percent_after == pytest.approx(found.percent_floor, rel=0.1)


def test_coupling_is_named_with_its_size_and_written_into_the_model(tmp_path: Path) -> None:
    stage = _stage()
    assert stage.modes is not None
    truth = replace(stage, modes=replace(stage.modes, output_shape=stage.modes.output_shape @ _MIX.T))
    found = _named(truth)
    assert [(f.cause, f.kind) for f in found.findings] == [("cross_coupling", "static")]
    assert found.findings[0].parameters["axis_2_at_1"] == pytest.approx(0.05, abs=0.003)
    assert found.status.value == "explained"
    assert found.findings[0].probability > 0.9
    write_axes_report(found, tmp_path)
    results = json.loads((tmp_path / "diagnosis.json").read_text())
    assert results["findings"][0]["cause"] == "cross_coupling"
    assert results["status"] == "explained"
    assert "cross_coupling" in (tmp_path / "report.html").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILE_NAMES)
    again = read_axes_model(tmp_path / "extended_model.yaml")
    assert again.static_gain() == pytest.approx(truth.static_gain(), rel=2e-3, abs=1e-3)


@pytest.mark.parametrize(("side", "name"), [("sensors", "swapped_axes"), ("sign", "axis_scale")])
def test_exchanged_and_turned_axes_are_named(side: str, name: str) -> None:
    stage = _stage()
    mix = np.array([[0.0, 1.0], [1.0, 0.0]]) if side == "sensors" else np.diag([1.0, -1.0])
    assert stage.modes is not None
    truth = replace(stage, modes=replace(stage.modes, output_shape=stage.modes.output_shape @ mix.T))
    found = _named(truth)
    assert [(f.cause, f.kind) for f in found.findings] == [(name, side)]


def test_modes_that_are_missing_or_soften_are_told_apart() -> None:
    stage = _stage()
    modes = stage.modes
    assert modes is not None
    fewer = [modes.frequency_hz, modes.damping, modes.output_shape, modes.input_shape]
    base = replace(stage, modes=AxesModes(*(values[[0, 1, 3]] for values in fewer)))
    missing = _named(stage, base)
    assert [f.cause for f in missing.findings][:1] == ["missing_mode"]
    assert missing.findings[0].parameters["frequency_hz"] == pytest.approx(310.0, rel=1e-3)
    soft = replace(modes, softening=np.array([-0.01, 0.0, 0.0, 0.0]))
    softer = _named(replace(stage, modes=soft, level=LevelLaw(1.5)))
    assert [f.cause for f in softer.findings][:1] == ["softening_modes"]


def test_a_sensor_elsewhere_is_known_by_the_sign_of_its_modes() -> None:
    stage = _stage()
    assert stage.modes is not None
    shape = stage.modes.output_shape.copy()
    shape[:, 1] *= np.array([1.2, 1.2, -0.8, -0.8])
    found = _named(replace(stage, modes=replace(stage.modes, output_shape=shape)))
    assert [f.cause for f in found.findings] == ["noncollocated_sensor"]
    assert found.findings[0].parameters["axis"] == 2.0


def test_what_rests_on_nothing_is_refused_in_a_line() -> None:
    records = _records(_stage(), 1)
    one = AxesModel((PiezoModel(np.array([4.0, 1.0]), np.array([0.5]), 0.0),))
    with pytest.raises(RecordingError, match=r"record 0: axes do not match the model, got .2 voltages, 2 displ"):
        diagnose_axes(records, one)
    with pytest.raises(RecordingError, match="nothing held out"):
        diagnose_axes([replace(records[0], is_held=np.zeros(_N, dtype=bool))], _stage())
    with pytest.raises(ParameterError, match="unknown cause, got 'gremlins'"):
        diagnose_axes(records, _stage(), excluded_causes=["gremlins"])
    with pytest.raises(RecordingError, match="short: too short, got 10"):
        AxesRecord.of("short", 1.0, np.zeros((10, 2, 1)), np.zeros((10, 2, 1)))
    still = np.zeros((_N, 2, 2))
    still[:, 0] = np.arange(_N)[:, None]
    with pytest.raises(RecordingError, match="dead, axis 2: dead axis"):
        AxesRecord.of("dead", 1.0, still, still)


def test_the_command_takes_files_of_several_axes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = _stage()
    assert stage.modes is not None
    truth = replace(stage, modes=replace(stage.modes, output_shape=stage.modes.output_shape @ np.diag([1.0, 0.8])))
    record = _records(truth, 1)[0]
    columns = {"time_s": np.arange(_N) / _RATE_HZ}
    for k in range(2):
        columns |= {
            f"voltage_{k + 1}_v": record.voltage_v[:, k],
            f"displacement_{k + 1}_um": record.displacement_um[:, k],
        }
    twice = {name: np.concatenate([values, values]) for name, values in columns.items()}
    twice["time_s"] = np.arange(2 * _N) / _RATE_HZ
    # two periods alike have no noise: the model's own error is the floor
    np.savez(tmp_path / "a.npz", **twice)
    write_axes_model(stage, tmp_path / "stage.yaml", 2.0 * _NOISE)
    command = ["diagnose", str(tmp_path / "a.npz"), "--periods", "2", "--output", str(tmp_path / "out")]
    assert run(command) == 2
    assert "are diagnosed against their model, and none is given" in capsys.readouterr().err
    assert run([*command, "--model", str(tmp_path / "stage.yaml")]) == 0
    assert "axis_scale, scale (axis 2, side sensor, factor 0.8" in capsys.readouterr().out
    results = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert results["percent_of_rms"]["floor"] == pytest.approx(200.0 * _NOISE)
    assert read_axes_fit_error(tmp_path / "stage.yaml") == 2.0 * _NOISE


def test_what_is_left_of_one_axis_is_asked_for_causes_of_its_own() -> None:
    axis = PiezoModel(np.array([6.0, 2.0]), np.array([0.4]), 0.01)
    stage = AxesModel((axis, axis), coupling=np.array([[1.0, 0.02], [0.01, 1.0]]))
    rng, rate_hz, n = np.random.default_rng(1), 200.0, 2000
    time = np.arange(n) / rate_hz
    triangle = 2.0 * np.abs(2.0 * (np.array([[0.5], [0.8]]) * time % 1.0) - 1.0) - 1.0
    drive = (1.0 - triangle.T) * np.minimum(1.0, 0.3 + time[:, None] / 8.0) / 2.0
    moved = stage.simulate(np.full(n, 1.0 / rate_hz), drive) + 1e-3 * rng.normal(size=drive.shape)
    moved[:, 0] += 0.02 * np.sin(2.0 * np.pi * 31.0 * time + 0.3)
    record = AxesRecord.of("slow", rate_hz, drive[:, :, None], moved[:, :, None])
    found = diagnose_axes([record], stage)
    assert found.findings == ()
    assert [(axis.axis, axis.causes) for axis in found.axes] == [(1, ("mains_hum",))]
    assert found.axes[0].diagnosis.findings[0].parameters["frequency_hz"] == pytest.approx(31.0, rel=1e-3)
