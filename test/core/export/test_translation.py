"""Step functions become C only where they are of the small kind; the file's own sine and exponential are exact."""

from __future__ import annotations

import math
import subprocess

import numpy as np
import pytest

from fomrc_core.effects.base.step_form import FieldKind, StateField, StepForm
from fomrc_core.errors import ParameterError
from fomrc_core.export.template import read_template, render
from fomrc_core.export.translation import Surroundings, helper_function, step_function

FORM = StepForm(
    constants=(("gain", 2.0), ("table", (1.0, 2.0))),
    state=(
        StateField("last"),
        StateField("count", kind=FieldKind.COUNT),
        StateField("line", (0.0,) * 3, is_array=True),
    ),
    coefficients=("decay", ("shares", 2)),
)
AROUND = Surroundings.of("thing", FORM)


def good(s, k, c, value, step_s):
    """Say what it does."""
    total = 0.0
    for j in range(len(c.table)):
        total = total + c.table[j] * s.line[j + 1]
        if total > value and s.count != 2:
            break
    s.count = (s.count + 1) % len(s.line)
    s.last = max(total, abs(value)) * k.decay if step_s >= 1e-3 else -c.gain
    return s.last


def test_a_step_function_becomes_c() -> None:
    text = step_function(good, "thing_forward", AROUND).text
    assert text.startswith("/* Say what it does. */\nstatic double thing_forward(@prefix@_thing *s, const thing_coeff")
    assert "for (uint32_t j = 0; j < 2u; j++) {" in text
    assert "s->last = (real)(((step_s >= 0.001) ?" in text
    assert "s->count = ((s->count + 1u) % 3u);" in text


def uses_while(value):
    while value > 0.0:
        return value
    return 0.0


def uses_a_power(value):
    return value**2


def uses_the_library(value):
    return math.tan(value)


def uses_a_name(value):
    return value + FORM


def uses_another_field(s, value):
    return value + s.unknown


def uses_another_parameter(value, wish):
    return value + wish


def chains_comparisons(value):
    return 1.0 if 0.0 < value < 1.0 else 0.0


def stores_a_number_as_a_count(s, value):
    s.count = value
    return value


def takes_a_string(value):
    return "one"


def loops_over_a_table(c, value):
    for number in c.table:
        value = number
    return value


def returns_nothing(value):
    return


@pytest.mark.parametrize(
    "function",
    [
        uses_while,
        uses_a_power,
        uses_the_library,
        uses_a_name,
        uses_another_field,
        uses_another_parameter,
        chains_comparisons,
        stores_a_number_as_a_count,
        takes_a_string,
        loops_over_a_table,
        returns_nothing,
    ],
    ids=lambda function: function.__name__,
)
def test_what_c_is_not_made_of_is_refused_with_its_line(function) -> None:
    with pytest.raises(ParameterError, match=r"thing_forward, line \d+: .* cannot be translated"):
        step_function(function, "thing_forward", AROUND)


def test_a_helper_says_its_types_and_a_lambda_has_no_source() -> None:
    with pytest.raises(ParameterError, match="annotated"):
        helper_function(uses_a_power, True)
    with pytest.raises(ParameterError, match="plain function"):
        step_function(lambda value: value, "thing_forward", AROUND)


def test_marks_of_a_template_fit_each_other() -> None:
    text = "@if one\npiezo_a PIEZO_B piezoelectric\n@insert block\n@end\n@if not one\nother\n@end\n"
    assert render(text, "stage", {"one"}, {"block": "x\ny"}) == "stage_a STAGE_B piezoelectric\nx\ny\n"
    assert render(text, "stage", (), {}) == "other\n"
    for wrong in ("@if one\n", "@end\n"):
        with pytest.raises(ValueError, match="@"):
            render(wrong, "stage", {"one"}, {})


def test_the_sine_and_the_exponential_of_the_file_are_those_of_the_library(tmp_path) -> None:
    own = render(
        read_template("own_functions.c"), "stage", {"rounded", "exponential", "wave", "sine", "cosine", "logarithm"}, {}
    )
    (tmp_path / "own.c").write_text(
        "#include <math.h>\n#include <stdint.h>\n#include <stdio.h>\n" + own + "int main(void) {\ndouble x;\n"
        'while (scanf("%lf", &x) == 1) printf("%.17g %.17g %.17g %.17g\\n", sine(x), exponential(x > 0.0 ? -x : x),\n'
        "cosine(x), logarithm(x < 0.0 ? -x : x));\n"
        "return 0;\n}\n"
    )
    program = str(tmp_path / "own")
    command = ["gcc", "-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", str(tmp_path / "own.c")]
    subprocess.run([*command, "-lm", "-o", program], check=True)
    rng = np.random.default_rng(2)
    x = np.concatenate((rng.uniform(-10.0, 10.0, 4000), rng.uniform(-1e6, 1e6, 4000), rng.uniform(-800.0, 0.0, 2000)))
    x = np.concatenate((x, [0.0, -0.0, math.pi, -math.pi / 2.0, 1e-300, -1e-8, 1e-8]))
    given = "\n".join(map(repr, x.tolist()))
    done = subprocess.run([program], input=given, capture_output=True, text=True, check=True)
    answers = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert np.max(np.abs(answers[:, 0] - np.sin(x))) <= 3e-16
    assert np.max(np.abs(answers[:, 2] - np.cos(x))) <= 3e-16
    assert np.max(np.abs(answers[:, 3] - np.log1p(np.abs(x))) / np.maximum(np.log1p(np.abs(x)), 1e-300)) <= 5e-16
    exact = np.exp(-np.abs(x))
    assert np.max(np.abs(answers[:, 1] - exact) / np.maximum(exact, 1e-280)) <= 2e-15
