"""One Python file that needs nothing else, and whose states the exported C takes over."""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.export import ExportOptions, Language, export_model, run_self_test
from fomrc_core.model.compensator import Compensator
from fomrc_core.storage import read_model

CONFIG = Path(__file__).parents[3] / "config"
PERIOD_S = 1e-3


@pytest.fixture(scope="module")
def model():
    return read_model(CONFIG / "pi_p753_table1.yaml")


@pytest.fixture(scope="module")
def exported(model, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("python")
    export_model(model, folder, ExportOptions("stage", language=Language.PYTHON, sample_period_s=PERIOD_S))
    return folder / "stage.py"


def load(path: Path):
    spec = importlib.util.spec_from_file_location("exported_stage", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_imports_nothing_but_math_and_struct(exported) -> None:
    imported = {
        alias.name
        for node in ast.walk(ast.parse(exported.read_text()))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    }
    assert imported == {"math", "struct"}
    # no packages at all, not even those of this environment
    done = subprocess.run([sys.executable, "-I", "-S", str(exported)], capture_output=True, text=True, check=True)
    assert done.stdout.count("passed") == 2
    assert run_self_test(exported.parent, "stage", Language.PYTHON).lines == tuple(done.stdout.splitlines())


def test_it_gives_what_the_model_gives_with_steps_of_any_length(exported, model) -> None:
    module = load(exported)
    rng = np.random.default_rng(1)
    steps = PERIOD_S * np.repeat(rng.uniform(0.1, 30.0, 100), 20)
    voltage = 2.2 * np.sin(np.linspace(0.0, 40.0, steps.size)) * rng.uniform(0.9, 1.0, steps.size)
    moved = model.simulate(steps, voltage)
    forward, inverse = module.Forward(), module.Inverse()
    answers = np.array([forward.step(float(v), float(dt)) for v, dt in zip(voltage, steps, strict=True)])
    assert np.max(np.abs(answers - moved)) <= 1e-12 * np.max(np.abs(moved))
    back = np.array([inverse.step(float(x), float(dt)) for x, dt in zip(moved, steps, strict=True)])
    wanted = Compensator(model).run(steps, moved)
    assert np.max(np.abs(back - wanted)) <= 1e-12 * np.max(np.abs(wanted))


def test_bad_input_is_answered_with_nan_and_does_no_harm(exported) -> None:
    module = load(exported)
    for actuator in (module.Forward(), module.Inverse()):
        actuator.step(0.7)
        before = actuator.save()
        bad = ((float("nan"), 1e-3), (float("inf"), 1e-3), (1.0, 0.0), (1.0, -1.0), (1.0, float("nan")), (1e7, 1e-3))
        for value, step_s in bad:
            assert np.isnan(actuator.step(value, step_s))
        assert actuator.save() == before


def test_a_saved_state_goes_on_and_damage_is_told(exported) -> None:
    module = load(exported)
    first, second = module.Inverse(), module.Inverse()
    for k in range(50):
        first.step(0.05 * (k % 17))
    data = first.save()
    second.restore(data)
    assert [second.step(0.1 * k) for k in range(20)] == [first.step(0.1 * k) for k in range(20)]
    now = second.save()
    damaged = data[:-1] + bytes([data[-1] ^ 1])
    other_version = data[:5] + bytes([data[5] + 1]) + data[6:]
    other_model = data[:8] + bytes([data[8] ^ 1]) + data[9:]
    cases = (
        (damaged, "damaged"),
        (other_version, "layout"),
        (other_model, "another model"),
        (module.Forward().save(), "direction"),
        (data[:-8], "not a saved state"),
        (b"", "not a saved state"),
    )
    for bad, words in cases:
        with pytest.raises(ValueError, match=words):
            second.restore(bad)
    assert second.save() == now


def test_limits_hold_and_the_memory_follows(exported) -> None:
    module = load(exported)
    actuator, last = module.Inverse(), 0.0
    limits = (-1.0, 1.2, 200.0, 0.1, 20.0)
    for k in range(300):
        voltage = actuator.step_limited(4.0 if k < 100 else -4.0, PERIOD_S, limits)
        assert -1.0 <= voltage <= 1.2
        assert abs(voltage - last) <= 200.0 * PERIOD_S + 1e-12
        last = voltage
    assert last == -1.0
    for _ in range(60):
        last = actuator.ramp_to_safe(PERIOD_S, limits)
    assert last == 0.1
    # what it remembers is where that voltage brings the actuator, not where it was wanted
    forward = module.Forward()
    reached = forward.step(0.1)
    assert abs(reached) < 1.0


def test_its_saved_state_is_that_of_the_exported_c(exported, model, tmp_path) -> None:
    module = load(exported)
    actuator = module.Inverse()
    for k in range(40):
        actuator.step(0.02 * k)
    export_model(model, tmp_path, ExportOptions("stage", sample_period_s=PERIOD_S))
    data = ", ".join(str(byte) for byte in actuator.save())
    (tmp_path / "user.c").write_text(
        '#include "stage.h"\n#include <stdio.h>\n'
        f"static const unsigned char saved[] = {{{data}}};\n"
        "int main(void) { stage_inverse state;\n"
        "if (stage_inverse_restore(&state, saved, sizeof saved) != STAGE_RESTORED) return 1;\n"
        'printf("%.17g\\n", stage_inverse_step_fixed(&state, 0.3)); return 0; }\n'
    )
    program = str(tmp_path / "user")
    command = ["gcc", "-std=c99", str(tmp_path / "user.c"), str(tmp_path / "stage.c"), "-lm", "-o", program]
    subprocess.run(command, check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(actuator.step(0.3), rel=1e-13)
