"""The loop in C and the core of the ros2_control page: taken as they stand, compiled with an exported model, run."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.export import Direction, ExportOptions, export_model
from fomrc_core.model.compensator import Compensator
from fomrc_core.storage import read_model

ROOT = Path(__file__).parents[3]
WARNINGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
PAGE = (ROOT / "docs" / "how-to" / "ros2_control.md").read_text()


@pytest.fixture(scope="module")
def model():
    return read_model(ROOT / "config" / "pi_p753_table1.yaml")


def compiled(folder: Path, sources: list[Path], period_s: float, model) -> Path:
    export_model(model, folder / "stage", ExportOptions("stage", direction=Direction.INVERSE, sample_period_s=period_s))
    program = folder / "program"
    named = [str(source) for source in (*sources, folder / "stage" / "stage.c")]
    command = ["gcc", *WARNINGS, f"-I{folder}", f"-I{folder / 'stage'}", *named, "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def test_the_loop_puts_out_what_the_compensator_would(model, tmp_path) -> None:
    program = compiled(tmp_path, [ROOT / "examples" / "c_loop" / "loop.c"], 5e-5, model)
    desired = 0.8 * np.sin(np.arange(1, 3001) / 400.0)
    given = "\n".join(map(repr, desired.tolist()))
    done = subprocess.run([str(program)], input=given, capture_output=True, text=True, check=True)
    wanted = Compensator(model).run(np.full(desired.size, 5e-5), desired)
    assert np.array(done.stdout.split(), dtype=float) == pytest.approx(wanted, abs=1e-8)
    told = re.search(r"3000 ticks of 50 us: .* ([\d.]+) us p99.9, .* (\d+) missed", done.stderr)
    assert told, done.stderr
    assert float(told[1]) > 0.0
    nothing = subprocess.run([str(program)], input="", capture_output=True, text=True, check=False)
    assert nothing.returncode == 1
    assert "no targets" in nothing.stderr


def block(heading: str) -> str:
    """The first piece of code behind a heading of the page."""
    found = re.search(rf"## [^\n]*`{re.escape(heading)}`[^\n]*\n+```\w+\n(.*?)```", PAGE, re.DOTALL)
    assert found, heading
    return found[1]


def test_the_core_of_the_ros2_control_page_compiles_and_follows(model, tmp_path) -> None:
    for name in ("feedforward_core.h", "feedforward_core.c"):
        (tmp_path / name).write_text(block(name))
    (tmp_path / "manager.c").write_text(
        '#include "feedforward_core.h"\n#include <math.h>\n#include <stdio.h>\n'
        # in the place of the controller manager: a reference interface, a command interface, a measured period
        "int main(void)\n{\n    feedforward_core core;\n    double reference_m, period_s, command_v;\n"
        "    feedforward_core_begin(&core, &stage_default_limits);\n"
        '    while (scanf("%lf %lf", &reference_m, &period_s) == 2) {\n'
        "        const feedforward_answer answer = feedforward_core_update(&core, reference_m, period_s);\n"
        '        command_v = core.voltage_v;\n        printf("%d %.17g\\n", (int)answer, command_v);\n    }\n'
        '    while (core.voltage_v != 0.0) (void)feedforward_core_ramp(&core, 1e-3);\n    printf("safe\\n");\n'
        "    return 0;\n}\n"
    )
    program = compiled(tmp_path, [tmp_path / "feedforward_core.c", tmp_path / "manager.c"], 1e-4, model)
    rng = np.random.default_rng(1)
    periods = 1e-4 * rng.uniform(0.8, 1.2, 400)
    desired_m = 0.8e-6 * np.sin(np.arange(1, 401) / 60.0)
    given = [f"{value!r} {period!r}" for value, period in zip(desired_m.tolist(), periods.tolist(), strict=True)]
    # no reference: held; a period that is none: refused, and the command stays
    given += ["nan 1e-4", "inf 1e-4", "1e-7 0"]
    done = subprocess.run([str(program)], input="\n".join(given), capture_output=True, text=True, check=True)
    *rows, safe = done.stdout.splitlines()
    answers = np.array([row.split() for row in rows], dtype=float)
    wanted = Compensator(model).run(periods, 1e6 * desired_m)
    assert answers[:400, 1] == pytest.approx(wanted, abs=1e-10)
    assert answers[:400, 0].tolist() == [0.0] * 400
    assert answers[400:, 0].tolist() == [1.0, 1.0, 2.0]
    assert answers[402, 1] == answers[401, 1]
    assert safe == "safe"


def test_the_page_is_whole() -> None:
    shell = block("piezo_feedforward.cpp")
    for name in re.findall(r"PiezoFeedforward::(\w+)\(", shell):
        assert f" {name}(" in block("piezo_feedforward.hpp") or name == "PiezoFeedforward"
    for name in re.findall(r"feedforward_core_\w+", shell):
        assert f"{name}(" in block("feedforward_core.h")
    for file_name in ("piezo_feedforward.xml", "CMakeLists.txt"):
        assert file_name in PAGE
