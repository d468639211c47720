"""An exported model as one Python file that needs nothing but ``math`` and ``struct``."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from importlib import resources

from fomrc_core.effects import Stage
from fomrc_core.effects.base.step_form import FieldKind, StateField
from fomrc_core.export import python_effects
from fomrc_core.export.c_files import conditions
from fomrc_core.export.golden import GoldenData
from fomrc_core.export.plan import STATE_VERSION, ExportPlan
from fomrc_core.export.template import read_template, render
from fomrc_core.model.substeps import (
    BEND_AFTER,
    BEND_FADES,
    LARGE_CHANGE,
    N_PARTS_LARGE,
    N_SUBSTEPS,
    SMALL_CHANGE,
    Substeps,
)

_WIDTH = 112


def python_file(plan: ExportPlan, golden: dict[str, GoldenData]) -> str:
    """Return the text of the file."""
    holds = conditions(plan)
    if plan.parts:
        holds.add("effects")
    if any(part.covariate for part in plan.parts):
        holds.add("covariates")
    tables = {
        f"{part.name}.{name}": _tuple(value)
        for part in plan.parts
        for name, value in part.form.constants
        if isinstance(value, tuple)
    }
    blocks = {
        "docstring": _docstring(plan),
        "constants": _constants(plan),
        "core": _core(),
        "effects": python_effects.definitions(plan, tables),
        "prepare_calls": python_effects.prepare_calls(plan),
        "golden": _golden(golden),
        **_forward_calls(plan),
        **_inverse_calls(plan),
    }
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        blocks[f"{direction}_fields"] = _field_table(plan.state_fields(is_inverse))
        blocks[f"{direction}_begin"] = _beginning(plan, is_inverse)
        covariates = sorted({part.covariate for part in plan.parts_of(is_inverse) if part.covariate})
        blocks[f"{direction}_setters"] = "".join(map(_setter, covariates))
    text = render(read_template("model.py.txt"), plan.options.name, holds, blocks)
    return re.sub(r"\n{4,}", "\n\n\n", text)


def _forward_calls(plan: ExportPlan) -> dict[str, str]:
    drive = python_effects.calls(plan, (Stage.DRIVE,), "forward")
    warps = python_effects.calls(plan, (Stage.HYSTERESIS,), "warp")
    return {
        "forward_sampled": python_effects.calls(plan, (Stage.SAMPLED_DRIVE,), "forward"),
        "forward_drive": "\n".join(text for text in (drive, warps) if text),
        "forward_widening": python_effects.added(plan, "widening", target="widening *= "),
        "forward_beside": python_effects.added(plan, "forward"),
        "forward_mechanical": python_effects.calls(plan, (Stage.MECHANICAL,), "forward"),
        "forward_sensed": python_effects.calls(plan, (Stage.SENSED,), "forward"),
    }


def _inverse_calls(plan: ExportPlan) -> dict[str, str]:
    before, after = (Stage.MECHANICAL, Stage.SENSED), (Stage.SAMPLED_DRIVE, Stage.DRIVE)
    return {
        "inverse_before": python_effects.calls(plan, before, "inverse", is_reversed=True),
        "beside_sum": python_effects.added(plan, "beside"),
        "beside_moves": python_effects.added(plan, "forward", target=""),
        "inverse_unwarp": python_effects.calls(plan, (Stage.HYSTERESIS,), "unwarp", is_reversed=True),
        "inverse_after": python_effects.calls(plan, after, "inverse", is_reversed=True),
    }


def _beginning(plan: ExportPlan, is_inverse: bool) -> str:
    lines = []
    effects: dict[str, list[str]] = {}
    for owner, field in plan.state_fields(is_inverse):
        if owner:
            effects.setdefault(owner, []).append(f"{field.name}={_initial(field)}")
        else:
            lines.append(f"        self.{field.name} = {_initial(field)}")
    lines += [f"        self.{owner} = _fields({', '.join(values)})" for owner, values in effects.items()]
    return "\n".join(lines)


def _setter(covariate: str) -> str:
    return (
        f"\n    def set_{covariate}(self, {covariate}):\n"
        f'        """Tell the {covariate} from now on; not a number where it is not known."""\n'
        f'        self._set_covariate("{covariate}", {covariate})\n'
    )


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
    lines += [f"Left out: {cause}." for cause in plan.left_out]
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
    holds = conditions(plan)
    for prefix, form, condition in (("PLAY", plan.play_form, "plays"), ("STOP", plan.stop_form, "stops")):
        if condition in holds:
            lines += [
                f"_{prefix}_SLOPE = {float(form.slope)!r}",
                f"_{prefix}_THRESHOLDS = {_tuple(form.thresholds.tolist())}",
                f"_{prefix}_WEIGHTS = {_tuple(form.weights.tolist())}",
            ]
    if options.is_forward:
        lines += _substep_constants(plan)
    if plan.is_searching_limits:
        lines.append(f"_GAIN_UM_PER_V = {1.0 / float(plan.stop_form.slope)!r}")
    return "\n".join(lines)


def _substep_constants(plan: ExportPlan) -> list[str]:
    if plan.steps.counts == (1,):
        return []
    lines = [
        f"_N_PARTS_LEAST = {plan.steps.least}",
        f"_N_PARTS_LARGE = {N_PARTS_LARGE}",
        f"_LARGE_CHANGE = {_finite(LARGE_CHANGE * plan.largest_v)!r}",
    ]
    if plan.steps.substeps is Substeps.BENDS:
        lines += [
            f"_N_PARTS_SMALL = {N_SUBSTEPS}",
            f"_SMALL_CHANGE = {_finite(SMALL_CHANGE * plan.largest_v)!r}",
            f"_BEND_AFTER = {BEND_AFTER!r}",
            f"_BEND_FADES = {BEND_FADES!r}",
        ]
    return lines


def _finite(value: float) -> float:
    # "inf" is no number in Python's own writing
    return min(value, sys.float_info.max)


def _limit_values(limits: object) -> list[float]:
    names = ("minimum_v", "maximum_v", "slew_v_per_s", "safe_v", "safe_ramp_v_per_s")
    return [float(getattr(limits, name)) for name in names]


def _initial(field: StateField) -> str:
    is_count = field.kind is FieldKind.COUNT
    values = [repr(int(value) if is_count else float(value)) for value in field.initial]
    if not field.is_array:
        return values[0]
    if len(set(values)) == 1:
        return f"[{values[0]}] * {len(values)}"
    return f"[{', '.join(values)}]"


def _field_table(fields: Sequence[tuple[str, StateField]]) -> str:
    rows = []
    for owner, field in fields:
        size = len(field.initial) if field.is_array else 0
        kind = "I" if field.kind is FieldKind.COUNT else "d"
        rows.append(f'        ("{owner}", "{field.name}", {size}, "{kind}"),')
    return "\n".join(["    _FIELDS = (", *rows, "    )"])


def _golden(golden: dict[str, GoldenData]) -> str:
    rows = []
    for direction, data in golden.items():
        parts = [f'"{direction}"', direction.capitalize()]
        signals = ", ".join(f'"{name}": {_tuple(signal.tolist())}' for name, signal in data.covariates.items())
        parts += [_tuple(data.steps_s.tolist()), _tuple(data.inputs.tolist()), f"{{{signals}}}"]
        parts.append(_tuple(data.outputs.tolist()))
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
