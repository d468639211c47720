"""An effect of somebody else's package works everywhere, nothing of ours edited; one that is broken does no harm."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import foreign_package
import numpy as np
import pytest
import yaml

_ROOT = Path(__file__).resolve().parents[3]
_MODEL = {
    "kappa_um_per_v": [10.0, 4.0, 7.0, 1.5],
    "saturation_v": [0.02, 0.1, 0.3],
    "creep_order": 0.02,
    "effects": ["self_heating"],
    "self_heating": {"expansion_s_per_um": 2e-3, "leak_s": 0.8},
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("pip")
    folder = tmp_path_factory.mktemp("foreign") / "site"
    foreign_package.install(folder, "their_stage", {"self_heating": "their_stage:SelfHeating"})
    return folder


def _run(site: Path, folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(site), str(_ROOT)])
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


def _fomrc(site: Path, folder: Path, *arguments: str) -> str:
    done = _run(site, folder, "-m", "fomrc_core.cli", *arguments)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def _columns(path: Path) -> dict[str, np.ndarray]:
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def _write(path: Path, **columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")


def _drive(rate_hz: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and a drive [V]: triangles of several slopes and steps, with rests between."""
    rng = np.random.default_rng(seed)
    corners_s, corners_v = [0.0], [0.0]
    for slope_v_per_s in (2.0, 40.0, 6.0, 80.0, 15.0):
        for _ in range(3):
            to_v = float(rng.uniform(-1.0, 1.0))
            corners_s.append(corners_s[-1] + max(abs(to_v - corners_v[-1]) / slope_v_per_s, 0.02))
            corners_v.append(to_v)
        corners_s.append(corners_s[-1] + 0.5)
        corners_v.append(corners_v[-1])
    time_s = np.arange(0.0, corners_s[-1], 1.0 / rate_hz)
    return time_s, np.interp(time_s, corners_s, corners_v)


def test_it_simulates_and_compensates_from_a_model_file(site: Path, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": {"model": _MODEL}}}))
    plain = {key: value for key, value in _MODEL.items() if key not in ("effects", "self_heating")}
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": {"model": plain}}}))
    time_s, voltage_v = _drive(200.0, 1)
    _write(tmp_path / "in.csv", time_s=time_s, voltage_v=voltage_v)
    for name in ("m", "plain"):
        _fomrc(site, tmp_path, "simulate", "-m", f"{name}.yaml", "-i", "in.csv", "-o", f"{name}.csv")
    with_it, without = (_columns(tmp_path / f"{name}.csv")["simulated_um"] for name in ("m", "plain"))
    assert np.max(np.abs(with_it - without)) > 0.05
    _write(tmp_path / "target.csv", time_s=time_s, desired_um=0.3 * np.sin(2.0 * np.pi * time_s))
    _fomrc(site, tmp_path, "compensate", "-m", "m.yaml", "-i", "target.csv", "-o", "v.csv")
    _fomrc(site, tmp_path, "simulate", "-m", "m.yaml", "-i", "v.csv", "-o", "back.csv", "--initial-state", "relaxed")
    back, wanted = _columns(tmp_path / "back.csv")["simulated_um"], _columns(tmp_path / "target.csv")["desired_um"]
    # steps are divided forward (the file does not say how) and not by the compensator
    assert np.max(np.abs(back - wanted)) < 1e-3


def test_a_diagnosis_finds_it_and_reports_it(site: Path, tmp_path: Path) -> None:
    script = """
import sys, yaml, numpy as np
from fomrc_core import PiezoModel
block = yaml.safe_load(sys.stdin)
model = PiezoModel.from_mapping(block)
for name in ("train", "test"):
    time_s, voltage_v = np.loadtxt(f"{name}_drive.csv", delimiter=",", skiprows=1).T
    steps_s = np.diff(time_s, prepend=time_s[0] - (time_s[1] - time_s[0]))
    moved_um = model.simulate(steps_s, voltage_v) + np.random.default_rng(len(name)).normal(0.0, 1e-3, time_s.size)
    rows = np.column_stack((time_s, voltage_v, moved_um))
    np.savetxt(f"{name}.csv", rows, delimiter=",", header="time_s,voltage_v,displacement_um", comments="")
"""
    for seed, name in enumerate(("train", "test")):
        time_s, voltage_v = _drive(125.0, 11 + seed)
        _write(tmp_path / f"{name}_drive.csv", time_s=time_s, voltage_v=voltage_v)
    (tmp_path / "make.py").write_text(script)
    path = os.pathsep.join([str(site), str(_ROOT)])
    subprocess.run(
        [sys.executable, "make.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        input=yaml.safe_dump(_MODEL),
        text=True,
        timeout=120,
        check=True,
    )
    _fomrc(site, tmp_path, "diagnose", "train.csv", "--test", "test.csv", "-o", "found")
    found = json.loads((tmp_path / "found" / "diagnosis.json").read_text())
    assert [finding["cause"] for finding in found["findings"]] == ["self_heating"]
    (finding,) = found["findings"]
    assert finding["parameters"]["expansion_s_per_um"] == pytest.approx(2e-3, rel=0.05)
    assert finding["parameters"]["leak_s"] == pytest.approx(0.8, rel=0.05)
    assert found["status"] == "explained"
    page = (tmp_path / "found" / "report.html").read_text()
    assert "Friction in the stage heats it" in page
    extended = yaml.safe_load((tmp_path / "found" / "extended_model.yaml").read_text())
    assert extended["/**"]["ros__parameters"]["model"]["effects"] == ["self_heating"]


def test_model_files_and_the_parameters_of_a_node_take_it(site: Path, tmp_path: Path) -> None:
    script = """
import json, sys
from pathlib import Path
from fomrc_core import PiezoModel, read_model, write_model
model = PiezoModel.from_mapping(json.load(sys.stdin))
write_model(model, Path("written.yaml"))
back = read_model(Path("written.yaml"))
assert back.to_mapping() == model.to_mapping()
try:
    import rclpy
except ImportError:
    print(json.dumps(None))
    raise SystemExit
from fomrc_ros.node.model_parameters import effect_spec, model_from_values, parameters_of_effects, values_from_model
values = values_from_model(model)
specs = [effect_spec(name) for name in parameters_of_effects(values)]
assert model_from_values(values).to_mapping() == model.to_mapping()
print(json.dumps({spec.name: [spec.unit, spec.minimum, spec.maximum] for spec in specs}))
"""
    (tmp_path / "files.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "files.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(_ROOT)])},
        input=json.dumps(_MODEL),
        text=True,
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    declared = json.loads(done.stdout.splitlines()[-1])
    if declared is None:
        pytest.skip("no rclpy for the parameters of a node")
    assert declared == {
        "model.self_heating.expansion_s_per_um": ["s/um", -1e3, 1e3],
        "model.self_heating.leak_s": ["s", 1e-3, 1e6],
    }


_BAD = """
from dataclasses import dataclass
from typing import ClassVar
from fomrc_core.effects import Effect, Parameter, Stage
from fomrc_core.effects.gain_drift import GainDrift as Again

class NoEffect:
    pass

@dataclass(frozen=True)
class HalfDone(Effect):
    name: ClassVar[str] = "half_done"
    stage: ClassVar[Stage] = Stage.SENSED
    size: float
"""


def test_a_broken_or_a_second_one_is_one_line_and_the_rest_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("pip")
    site = tmp_path / "site"
    offered = {
        "gone": "their_bad:Gone",
        "no_module": "not_there:Thing",
        "no_effect": "their_bad:NoEffect",
        "half_done": "their_bad:HalfDone",
        "gain_drift": "their_bad:Again",
        "renamed": "their_bad:Again",
    }
    foreign_package.install(site, "their_bad", offered, _BAD)
    foreign_package.install(site, "their_stage", {"self_heating": "their_stage:SelfHeating"})
    script = "from fomrc_core.effects import effect_classes; print(sorted(effect_classes()))"
    done = _run(site, tmp_path, "-c", script)
    assert done.returncode == 0, done.stderr
    names = done.stdout
    assert "'self_heating'" in names
    assert "'gain_drift'" in names
    lines = done.stderr.splitlines()
    assert len(lines) == len(offered)
    for name, words in {
        "gone": "AttributeError",
        "no_module": "ModuleNotFoundError",
        "no_effect": "is not a subclass",
        "half_done": "lacks order, parameters",
        "gain_drift": "has the name of an effect there is already",
        "renamed": "is called 'gain_drift'",
    }.items():
        (line,) = [line for line in lines if line.startswith(f"effect {name} is left out")]
        assert words in line
        assert "their_bad" in line
    model = {**_MODEL, "effects": ["half_done"], "half_done": {"size": 1.0}}
    del model["self_heating"]
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": {"model": model}}}))
    _write(tmp_path / "in.csv", time_s=np.arange(5.0), voltage_v=np.zeros(5))
    refused = _run(site, tmp_path, "-m", "fomrc_core.cli", "simulate", "-m", "m.yaml", "-i", "in.csv", "-o", "o.csv")
    assert refused.returncode == 2
    assert "half_done" in refused.stderr.splitlines()[-1]


def test_one_whose_code_raises_does_not_take_a_diagnosis_along(tmp_path: Path) -> None:
    pytest.importorskip("pip")
    site = tmp_path / "site"
    raising = foreign_package.SELF_HEATING.replace("longest = evidence.duration_s", "raise KeyError('not today')")
    foreign_package.install(site, "their_stage", {"self_heating": "their_stage:SelfHeating"}, raising)
    script = """
import numpy as np
from fomrc_core import Recording, diagnose
from fomrc_core.model.causes import cause_classes
time_s = np.arange(2000) / 200.0
voltage_v = np.sin(time_s) * np.linspace(1.0, 0.3, 2000)
record = Recording(time_s, voltage_v, 2.0 * voltage_v + np.random.default_rng(1).normal(0.0, 1e-3, 2000))
others = [name for name in cause_classes() if name not in ("self_heating", "cross_axis")]
print(diagnose(record, excluded_causes=others).status.value)
"""
    done = _run(site, tmp_path, "-c", script)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["nothing_found"]
    assert set(done.stderr.splitlines()) == {
        "cause self_heating is left out: its own code raised KeyError: 'not today'"
    }
