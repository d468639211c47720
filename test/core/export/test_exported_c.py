"""Exported C is the Python model: compiled by gcc (needed for these tests) and, where it is there, by clang."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from random_models import relative

from benchmarks.export_rows import BARS, errors_of
from benchmarks.exported import Exported
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.export import Direction, ExportOptions, Language, Precision, export_model, run_self_test
from fomrc_core.export.self_test import C_FLAGS
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import read_model

CONFIG = Path(__file__).parents[3] / "config"
MODEL_FILES = sorted(path for path in CONFIG.glob("*.yaml") if "kappa_um_per_v" in path.read_text())
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
PERIOD_S = 1e-4
# Compiles in a third of the time.
QUICK = ("-std=c99", "-O0")


def options(name: str = "stage", **changes) -> ExportOptions:
    return ExportOptions(**{"name": name, "sample_period_s": PERIOD_S, **changes})


@pytest.fixture(scope="module")
def model() -> PiezoModel:
    return read_model(CONFIG / "pi_p753_table1.yaml")


def drive(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Steps [s] of any length, and sweeps, jumps and rests [V]."""
    rng = np.random.default_rng(seed)
    swept = 2.4 * np.sin(np.linspace(0.0, 60.0, n)) * np.linspace(1.0, 0.2, n)
    jumps = np.repeat(rng.uniform(-2.0, 2.0, n // 50 + 1), 50)[:n]
    return PERIOD_S * rng.uniform(0.1, 30.0, n), np.where(np.arange(n) % 1000 < 600, swept, jumps)


@pytest.mark.parametrize("precision", list(Precision))
@pytest.mark.parametrize("way", ["forward", "inverse"])
def test_c_gives_what_python_gives(model, precision, way) -> None:
    steps, voltage = drive(20_000)
    values = voltage if way == "forward" else model.simulate(steps, voltage)
    compiled = Exported(model, options(precision=precision), way)
    for lengths in (None, steps):
        assert np.max(errors_of(compiled, model, lengths, values)) <= BARS[precision]


@pytest.mark.parametrize(
    ("kappa", "saturation", "order"), [([1.2], [], 0.0), ([2.0, 1.2], [0.3], 1.0), ([1.3], [], 0.5)]
)
def test_models_at_the_edge_of_what_a_model_may_be(kappa, saturation, order) -> None:
    edge = PiezoModel(np.array(kappa), np.array(saturation), order)
    steps, voltage = drive(2000)
    for way, values in (("forward", voltage), ("inverse", 0.01 * voltage)):
        assert np.max(errors_of(Exported(edge, options(), way, flags=QUICK), edge, steps, values)) <= 1e-12


@pytest.mark.parametrize("path", MODEL_FILES, ids=lambda path: path.stem)
@pytest.mark.parametrize("precision", list(Precision))
def test_every_model_file_of_config_passes_its_self_test(path, precision, tmp_path) -> None:
    export_model(read_model(path), tmp_path, options(path.stem, precision=precision))
    test = run_self_test(tmp_path, path.stem, Language.C, "gcc")
    assert test.lines[-1] == "self-test passed"


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_warning_and_no_undefined_behaviour_over_random_steps(model, compiler, tmp_path) -> None:
    if compiler != "gcc" and shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    export_model(model, tmp_path, options())
    program = tmp_path / "test"
    sources = [str(tmp_path / "stage.c"), str(tmp_path / "self_test.c")]
    subprocess.run([compiler, *C_FLAGS, *SANITIZERS, *sources, "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program), "30000"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "self-test passed" in done.stdout


def test_the_fixed_step_calls_no_library(model, tmp_path) -> None:
    export_model(model, tmp_path, options())
    for flag, is_any in (("-DSTAGE_FIXED_STEP_ONLY", False), ("-DWITH_ANY_STEP", True)):
        compiled = tmp_path / "stage.o"
        command = ["gcc", "-std=c99", "-O2", flag, "-c", str(tmp_path / "stage.c"), "-o", str(compiled)]
        subprocess.run(command, check=True)
        listed = subprocess.run(["nm", "-u", str(compiled)], capture_output=True, text=True, check=True).stdout
        needed = {line.split()[-1] for line in listed.splitlines()} - {"_GLOBAL_OFFSET_TABLE_"}
        # copying and comparing bytes, which a compiler may call for by itself, is no mathematics
        assert needed - {"memcpy", "memcmp", "memset", "__stack_chk_fail"} == ({"exp", "pow"} if is_any else set())
        # nothing that is written to outlives a call: no global state
        sections = subprocess.run(["nm", str(compiled)], capture_output=True, text=True, check=True).stdout
        assert [line for line in sections.splitlines() if line.split()[-2] in "bBdDC"] == []


def test_the_same_model_gives_the_same_bytes(model, tmp_path) -> None:
    for folder in ("first", "second"):
        export_model(model, tmp_path / folder, options())
    for path in sorted((tmp_path / "first").iterdir()):
        assert path.read_bytes() == (tmp_path / "second" / path.name).read_bytes()
    header = (tmp_path / "first" / "stage.h").read_text()
    other = PiezoModel(model.kappa_um_per_v, model.saturation_v, 0.0150001)
    checksums = [export_model(m, tmp_path / "first", options()).checksum for m in (model, other)]
    assert f'MODEL_CHECKSUM "{checksums[0]}"' in header
    assert checksums[0] != checksums[1]


def test_limits_are_those_of_the_node(model) -> None:
    limits = VoltageLimits(minimum_v=-1.2, maximum_v=1.5, slew_v_per_s=400.0, safe_v=0.2, safe_ramp_v_per_s=5.0)
    target_um = 2.6 * np.sin(np.linspace(0.0, 25.0, 1500)) + np.where(np.arange(1500) // 100 % 2 == 0, 0.0, 0.3)
    settings = LoopSettings(limits, stale_after_s=0.0, ramps_when_stale=False, period_s=PERIOD_S, history_s=0.01)
    loop = CompensationLoop(Compensator(model), settings)
    wanted = np.empty(target_um.size)
    for k, target in enumerate(target_um):
        loop.set_target(float(target))
        wanted[k] = loop.tick(PERIOD_S)
    assert loop.counts.n_clamped > 100
    assert loop.counts.n_slewed > 10
    answers = Exported(model, options(limits=limits), "inverse").run_limited(target_um)
    assert answers.max() == 1.5
    assert answers.min() == -1.2
    # The node searches for the displacement to 1e-12 V; the exported step solves for it.
    assert relative(answers, wanted) <= 1e-9


def test_one_direction_leaves_the_other_out(model, tmp_path) -> None:
    for direction in (Direction.FORWARD, Direction.INVERSE):
        folder = tmp_path / direction.value
        export_model(model, folder, options(direction=direction))
        header = (folder / "stage.h").read_text()
        assert ("stage_forward_step" in header) is (direction is Direction.FORWARD)
        assert ("stage_inverse_step" in header) is (direction is Direction.INVERSE)
        run_self_test(folder, "stage", Language.C, "gcc")


def test_fewer_elements_stay_close_and_fit_the_checksum(model, tmp_path) -> None:
    few = Exported(model, options(n_elements=5), "forward")
    voltage = 2.4 * np.sin(np.linspace(0.0, 20.0, 4000))
    steps = np.full(voltage.size, PERIOD_S)
    wanted = model.simulate(steps, voltage)
    error = float(np.sqrt(np.mean((few.run(None, voltage) - wanted) ** 2)) / np.ptp(wanted))
    assert 1e-5 < error < 0.01
    written = export_model(model, tmp_path, options(n_elements=5))
    assert written.n_forward_bytes < export_model(model, tmp_path, options()).n_forward_bytes


def test_the_header_is_good_c_plus_plus(model, tmp_path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    export_model(model, tmp_path, options())
    (tmp_path / "user.cpp").write_text(
        '#include "stage.h"\n'
        "int main() { stage_inverse state; stage_inverse_init(&state);\n"
        "return stage_inverse_step_fixed(&state, 0.0) == 0.0 ? 0 : 1; }\n"
    )
    command = ["g++", "-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", str(tmp_path / "user.cpp")]
    subprocess.run([*command, "-o", str(tmp_path / "user.o")], check=True)
