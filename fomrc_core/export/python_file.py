"""An exported model as one Python file that needs nothing but ``math`` and ``struct``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import resources

from fomrc_core.effects.base.step_form import FieldKind, StateField
from fomrc_core.export.c_files import conditions
from fomrc_core.export.golden import GoldenData
from fomrc_core.export.plan import STATE_VERSION, ExportPlan
from fomrc_core.export.template import read_template, render

_WIDTH = 112


def python_file(plan: ExportPlan, golden: dict[str, GoldenData]) -> str:
    """Return the text of the file."""
    blocks = {
        "docstring": _docstring(plan),
        "constants": _constants(plan),
        "core": _core(),
        "golden": _golden(golden),
    }
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        fields = plan.state_fields(is_inverse)
        blocks[f"{direction}_fields"] = _field_table(fields)
        blocks[f"{direction}_begin"] = "\n".join(f"        self.{field.name} = {_initial(field)}" for field in fields)
    return render(read_template("model.py.txt"), plan.options.name, conditions(plan), blocks)


def _core() -> str:
    text = (resources.files("fomrc_core.export") / "standalone.py").read_text(encoding="utf-8")
    return text.split("import math\n", 1)[1].strip("\n")


def _docstring(plan: ExportPlan) -> str:
    model, options = plan.model, plan.options
    lines = [
        f'"""{options.name}: a piezo actuator of {model.n_elements} elements that saturate and creep.',
        "",
        f"Written by fomrc export, direction {options.direction.value}. Do not edit: export anew.",
        f"Model checksum (SHA-256): {plan.checksum}",
    ]
    lines += [f"Left out: {name} ({reason})." for name, reason in plan.dropped]
    return "\n".join([*lines, '"""'])


def _constants(plan: ExportPlan) -> str:
    options, limits = plan.options, plan.options.limits
    lines = [
        f'MODEL_CHECKSUM = "{plan.checksum}"',
        f"STATE_VERSION = {STATE_VERSION}",
        f"SAMPLE_TIME_S = {options.sample_period_s!r}",
        "# minimum, maximum [V], slew [V/s], safe [V], ramp to it [V/s]",
        f"DEFAULT_LIMITS = {_tuple(_limit_values(limits))}",
        f"_MODEL_BYTES = {bytes.fromhex(plan.checksum[:16])!r}",
        f"_CREEP_ORDER = {plan.model.creep_order!r}",
        f"_INVERSE_GAMMA = {plan.inverse_gamma!r}",
        f"_FEEDTHROUGH = {float(plan.feedthrough)!r}",
        f"_RATES_PER_S = {_tuple(plan.rates_per_s.tolist())}",
        f"_WEIGHTS = {_tuple(plan.weights.tolist())}",
    ]
    for prefix, form, is_there in (
        ("PLAY", plan.play_form, options.is_forward),
        ("STOP", plan.stop_form, options.is_inverse),
    ):
        if is_there:
            lines += [
                f"_{prefix}_SLOPE = {float(form.slope)!r}",
                f"_{prefix}_THRESHOLDS = {_tuple(form.thresholds.tolist())}",
                f"_{prefix}_WEIGHTS = {_tuple(form.weights.tolist())}",
            ]
    return "\n".join(lines)


def _limit_values(limits: object) -> list[float]:
    names = ("minimum_v", "maximum_v", "slew_v_per_s", "safe_v", "safe_ramp_v_per_s")
    return [float(getattr(limits, name)) for name in names]


def _initial(field: StateField) -> str:
    if not field.is_array:
        return repr(field.initial[0]) if field.kind is not FieldKind.COUNT else str(int(field.initial[0]))
    if len(set(field.initial)) == 1:
        return f"[{field.initial[0]!r}] * {len(field.initial)}"
    return f"list({_tuple(field.initial)})"


def _field_table(fields: Sequence[StateField]) -> str:
    rows = []
    for field in fields:
        size = len(field.initial) if field.is_array else 0
        rows.append(f'        ("{field.name}", {size}, "{"I" if field.kind is FieldKind.COUNT else "d"}"),')
    return "\n".join(["    _FIELDS = (", *rows, "    )"])


def _golden(golden: dict[str, GoldenData]) -> str:
    rows = []
    for direction, data in golden.items():
        parts = [f'"{direction}"', direction.capitalize()]
        parts += [_tuple(values.tolist()) for values in (data.steps_s, data.inputs, data.outputs)]
        rows.append("    (\n" + "".join(_indented(part, 8) + ",\n" for part in parts) + "    ),")
    return "\n".join(["_GOLDEN = (", *rows, ")"])


def _indented(text: str, n_spaces: int) -> str:
    return "\n".join(" " * n_spaces + line for line in text.splitlines())


def _tuple(values: Iterable[float]) -> str:
    lines, line = [], ""
    for value in values:
        number = f"{value!r},"
        if line and len(line) + len(number) + 1 > _WIDTH - 8:
            lines.append(line)
            line = number
        else:
            line = f"{line} {number}" if line else number
    lines.append(line)
    if len(lines) == 1:
        return f"({lines[0]})"
    return "(\n" + "\n".join(f"    {text}" for text in lines) + "\n)"
