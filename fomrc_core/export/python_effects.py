"""The effects of an export in Python: their step functions as they stand, and where the chain calls them."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Sequence

from fomrc_core.effects import Stage
from fomrc_core.effects.base.step_form import StepFunction
from fomrc_core.export.c_effects import may_fail
from fomrc_core.export.parts import EffectPart
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.translation import parameters_of, parsed

_KINDS = ("prepare", "forward", "inverse", "beside", "warp", "unwarp", "widening")


def definitions(plan: ExportPlan, tuple_text: dict[str, str]) -> str:
    """Return helpers, constants and functions of all effects.

    Args:
        plan: what is exported.
        tuple_text: each table of constants as text, by the effect's name and the constant's, with a point between.
    """
    texts = []
    helpers = {helper.__name__: helper for part in plan.parts for helper in part.form.helpers}
    texts += [_source(helper, name) for name, helper in helpers.items()]
    for part in plan.parts:
        values = [
            f"    {name}={tuple_text[f'{part.name}.{name}'] if isinstance(value, tuple) else repr(float(value))},"
            for name, value in part.form.constants
        ]
        texts.append("\n".join([f"_{part.name.upper()} = _fields(", *values, ")"]) if values else "")
        for kind in _KINDS:
            function = getattr(part.form, kind)
            if function is not None:
                texts.append(_source(function, f"{part.name}_{kind}"))
    return "\n\n\n".join(text for text in texts if text)


def prepare_calls(plan: ExportPlan) -> str:
    """Return what fills the effects' coefficients for a length of step."""
    lines = []
    for part in plan.parts:
        if part.form.prepare is not None:
            tables = ", ".join(f"{n}=[0.0] * {size}" for n, size in part.form.coefficient_sizes.items() if size)
            lines += [
                f"            k[{part.name!r}] = _fields({tables})",
                f"            {_call(part, 'prepare', 'step_s')}",
            ]
    return "\n".join(lines)


def calls(
    plan: ExportPlan, stages: Sequence[Stage], kind: str, *, is_reversed: bool = False, step: str = "step_s"
) -> str:
    """Return the calls of one kind of function for the effects of some stages."""
    parts = [part for part in plan.parts if part.stage in stages and getattr(part.form, kind) is not None]
    if kind in ("inverse", "unwarp"):
        parts = [part for part in parts if part.is_inverted]
    lines = []
    for part in reversed(parts) if is_reversed else parts:
        lines.append(f"        value = {_call(part, kind, step)}")
        if kind == "forward" and may_fail(part, kind):
            lines += ["        if value != value:", "            return value"]
    return "\n".join(lines)


def added(plan: ExportPlan, kind: str, target: str = "moved += ") -> str:
    """Return the calls that add to the elements' sum what effects beside them give."""
    return "\n".join(
        f"        {target}{_call(part, kind, 'step_s')}"
        for part in plan.parts
        if part.stage is Stage.HYSTERESIS and getattr(part.form, kind) is not None
    )


def _call(part: EffectPart, kind: str, step: str) -> str:
    given = {
        "s": f"self.{part.name}",
        "k": f"k[{part.name!r}]",
        "c": f"_{part.name.upper()}",
        "value": "value",
        "drive_v": "heard_v",
        "step_s": step,
        "covariate": f"self.{part.covariate}",
        "is_known": f"self.knows_{part.covariate}",
    }
    function: StepFunction = getattr(part.form, kind)
    return f"{part.name}_{kind}({', '.join(given[name] for name in parameters_of(function))})"


def _source(function: StepFunction, name: str) -> str:
    """Return a function's text under another name, without annotations: they name what is not there."""
    node = parsed(function)
    assert isinstance(node, ast.FunctionDef)
    lines = textwrap.dedent(inspect.getsource(function)).splitlines()
    body = "\n".join(lines[node.body[0].lineno - 1 :])
    # comments between the head and the first statement belong to the body
    head_end = max(argument.end_lineno or 0 for argument in node.args.args)
    comments = [line for line in lines[head_end : node.body[0].lineno - 1] if line.strip().startswith("#")]
    told = ", ".join(argument.arg for argument in node.args.args)
    return "\n".join([f"def {name}({told}):", *comments, body])
