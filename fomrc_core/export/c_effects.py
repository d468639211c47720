"""The effects of an export in C: types, constants, functions, and where the chain calls them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from fomrc_core.effects import Stage
from fomrc_core.effects.base.step_form import FieldKind, StateField, StepFunction
from fomrc_core.export.c_numbers import c_number, c_table
from fomrc_core.export.options import Precision
from fomrc_core.export.parts import EffectPart
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.template import read_template, render
from fomrc_core.export.translation import (
    FAILURE,
    Surroundings,
    Translated,
    helper_function,
    parameters_of,
    step_function,
)


def declarations(fields: Iterable[StateField], plan: ExportPlan) -> str:
    """Return the fields of a struct."""
    real = "double" if plan.is_wide else f"{plan.options.name}_real"
    types = {FieldKind.REAL: real, FieldKind.WIDE: "double", FieldKind.COUNT: "uint32_t"}
    lines = []
    for field in fields:
        size = f"[{len(field.initial)}]" if field.is_array else ""
        comment = f" /* {field.comment} */" if field.comment else ""
        lines.append(f"    {types[field.kind]} {field.name}{size};{comment}")
    return "\n".join(lines)


def state_types(plan: ExportPlan) -> str:
    """Return a struct for each effect that remembers something."""
    name = plan.options.name
    texts = []
    for part in plan.parts:
        if part.form.state:
            head = f"typedef struct {name}_{part.name} {{"
            texts.append(f"{head}\n{declarations(part.form.state, plan)}\n}} {name}_{part.name};")
    return "\n\n".join(["", *texts]) if texts else ""


def coefficient_types(plan: ExportPlan) -> str:
    """Return a struct for each effect that has coefficients of the step, and what the chain holds of them."""
    texts = [
        f"typedef struct {part.name}_coefficients {{\n    double {', '.join(_sized(part))};\n"
        f"}} {part.name}_coefficients;\n"
        for part in plan.parts
        if part.form.coefficients
    ]
    return "\n".join(texts)


def _sized(part: EffectPart) -> list[str]:
    return [name + (f"[{size}]" if size else "") for name, size in part.form.coefficient_sizes.items()]


def coefficient_fields(plan: ExportPlan) -> str:
    """Return the members of the chain's coefficients that are effects'."""
    return "\n".join(f"    {part.name}_coefficients {part.name};" for part in plan.parts if part.form.coefficients)


def prepare_calls(plan: ExportPlan) -> str:
    """Return the calls that fill the effects' coefficients for a step of any length."""
    calls = []
    for part in plan.parts:
        if part.form.prepare is not None:
            arguments = ["(double)step_s"] if "step_s" in _function(part, "prepare").parameters else []
            calls.append(f"    {part.name}_prepare({', '.join([f'&k->{part.name}', *arguments])});")
    return "\n".join(calls)


def definitions(plan: ExportPlan) -> str:
    """Return constants and functions of all effects, what they call before them.

    What only a step of any length needs is left out where there is none.
    """
    prefix = plan.options.name
    functions = {part.name: dict(_functions(part, plan)) for part in plan.parts}
    in_step = [own for kinds in functions.values() for kind, own in kinds.items() if kind != "prepare"]
    in_prepare = [kinds["prepare"] for kinds in functions.values() if "prepare" in kinds]
    helpers = {helper.__name__: helper for part in plan.parts for helper in part.form.helpers}
    fixed_helpers = [helper_function(helpers[name], False) for name in _called(helpers, in_step)]
    other = [name for name in _called(helpers, in_prepare) if name not in _called(helpers, in_step)]
    any_helpers = [helper_function(helpers[name], True) for name in other]
    texts: list[str] = []
    if needs := {need for own in (*in_step, *fixed_helpers) for need in own.needs}:
        texts.append(render(read_template("own_functions.c"), prefix, needs, {}).strip("\n"))
    texts += [own.text for own in fixed_helpers] + [_guarded(own.text, prefix) for own in any_helpers]
    for part in plan.parts:
        own = functions[part.name]
        texts.append(_constants(part, own, prefix))
        texts += [_guarded(f.text, prefix) if kind == "prepare" else f.text for kind, f in own.items()]
    return "\n\n".join(text for text in texts if text).replace("@prefix@", prefix)


def _guarded(text: str, prefix: str) -> str:
    return f"#ifndef {prefix.upper()}_FIXED_STEP_ONLY\n{text}\n#endif"


def _called(helpers: Mapping[str, StepFunction], functions: Iterable[Translated]) -> list[str]:
    texts = "\n".join(function.text for function in functions)
    return [name for name in helpers if f"{name}(" in texts]


def step_calls(plan: ExportPlan, stages: Sequence[Stage], kind: str, step: str, is_reversed: bool = False) -> str:
    """Return the calls of one kind of function ("forward", "inverse", ...) for the effects of some stages.

    Args:
        plan: what is exported.
        stages: in the order of the chain.
        kind: which function of the step form.
        step: the length of the step in C [s], double.
        is_reversed: the last effect of the chain first.
    """
    parts = [part for part in plan.parts if part.stage in stages and getattr(part.form, kind) is not None]
    if kind in ("inverse", "unwarp"):
        parts = [part for part in parts if part.is_inverted]
    lines = []
    for part in reversed(parts) if is_reversed else parts:
        lines.append(f"value = (real){_call(part, kind, step)};")
        if kind == "forward" and may_fail(part, kind):
            lines.append("if (!is_within(value, REAL_MAX)) return NOT_A_NUMBER;")
    return "\n".join(lines)


def added_calls(plan: ExportPlan, kind: str, target: str, value: str, step: str) -> str:
    """Return the calls that add to the elements' sum what effects beside them give."""
    return "\n".join(
        f"{target} += (real){_call(part, kind, step, value)};"
        for part in plan.parts
        if part.stage is Stage.HYSTERESIS and getattr(part.form, kind) is not None
    )


def hears_drive(part: EffectPart) -> bool:
    """Return whether what an effect answers depends on the drive as the elements see it, beside its input."""
    return part.form.forward is not None and "drive_v" in parameters_of(part.form.forward)


def may_fail(part: EffectPart, kind: str) -> bool:
    """Return whether a function of an effect may have no answer."""
    return getattr(part.form, kind) is not None and FAILURE in _function(part, kind).needs


def _call(part: EffectPart, kind: str, step: str, value: str = "value") -> str:
    given = {
        "s": f"&state->{part.name}",
        "k": f"&k->{part.name}",
        "value": f"(double){value}",
        "drive_v": "(double)heard_v",
        "step_s": step,
        "covariate": f"(double)state->{part.covariate}",
        "is_known": f"(int)state->knows_{part.covariate}",
    }
    arguments = [given[parameter] for parameter in _function(part, kind).parameters]
    return f"{part.name}_{kind}({', '.join(arguments)})"


def _function(part: EffectPart, kind: str) -> Translated:
    function: StepFunction = getattr(part.form, kind)
    return step_function(function, f"{part.name}_{kind}", Surroundings.of(part.name, part.form), kind == "prepare")


def _functions(part: EffectPart, plan: ExportPlan) -> Iterator[tuple[str, Translated]]:
    """Return the functions of an effect the export calls, by kind."""
    kinds = ["prepare"]
    if plan.options.is_forward:
        kinds += ["forward", "warp", "widening"]
    if part.is_inverted:
        kinds += ["inverse", "beside", "unwarp"]
        if part.stage is Stage.HYSTERESIS:
            kinds.append("forward")
    for kind in dict.fromkeys(kinds):
        if getattr(part.form, kind) is not None:
            yield kind, _function(part, kind)


def _constants(part: EffectPart, functions: Mapping[str, Translated], prefix: str) -> str:
    fixed = "\n".join(own.text for kind, own in functions.items() if kind != "prepare")
    prepared = functions["prepare"].text if "prepare" in functions else ""
    lines = []
    for name, value in part.form.constants:
        full = f"{part.name}_{name}".upper()
        if re.search(rf"\b{full}\b", fixed + prepared) is None:
            continue
        if not isinstance(value, tuple):
            lines.append(f"#define {full} {_bracketed(c_number(value, Precision.DOUBLE))}")
            continue
        table = c_table("double", full, str(len(value)), value, Precision.DOUBLE)
        lines.append(table if re.search(rf"\b{full}\b", fixed) else _guarded(table, prefix))
    return "\n".join(lines)


def _bracketed(number: str) -> str:
    return f"({number})" if number.startswith("-") else number
