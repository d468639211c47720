"""The header and the source of an exported model, made of templates and tables."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from fomrc_core.effects.base.step_form import FieldKind, StateField
from fomrc_core.export import standalone
from fomrc_core.export.c_numbers import c_list, c_number, c_table
from fomrc_core.export.options import Precision
from fomrc_core.export.plan import STATE_VERSION, ExportPlan
from fomrc_core.export.template import read_template, render

_HEADER_BYTES = 24
# gone, weighted, from previous, from current, weight of the present input, weight of the one before
_Creep = tuple[list[float], list[float], list[float], list[float], float, float]
_prepare_creep: Callable[[list[float], list[float], float, float, float, float], _Creep] = standalone.prepare_creep
_TYPES = {FieldKind.REAL: "{name}_real", FieldKind.CLOCK: "double", FieldKind.COUNT: "uint32_t"}


def banner(plan: ExportPlan) -> str:
    """Return the comment at the top of each file."""
    model, options = plan.model, plan.options
    lines = [
        f"{options.name}: a piezo actuator of {model.n_elements} elements that saturate and creep of order "
        f"{model.creep_order!r},",
        f"written by fomrc export, {options.precision.value} precision, direction {options.direction.value}. "
        "Do not edit: export anew.",
        f"Model checksum (SHA-256): {plan.checksum}",
    ]
    lines += [f"Left out: {name} ({reason})." for name, reason in plan.dropped]
    return "/* " + "\n   ".join(lines) + " */"


def conditions(plan: ExportPlan) -> set[str]:
    """Return what holds of this export, for the templates."""
    options = plan.options
    holds = {
        "float": options.precision is Precision.FLOAT,
        "doubles": options.precision is Precision.DOUBLE,
        "forward": options.is_forward,
        "inverse": options.is_inverse,
        "plays": options.is_forward,
        "stops": options.is_inverse,
    }
    return {name for name, is_true in holds.items() if is_true}


def header(plan: ExportPlan) -> str:
    """Return the text of the header."""
    name = plan.options.name
    blocks = {"banner": banner(plan), "identity": _identity(plan)}
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        blocks[f"{direction}_fields"] = "\n".join(_declaration(field, name) for field in plan.state_fields(is_inverse))
        blocks[f"{direction}_covariates"] = ""
    return render(read_template("model.h"), name, conditions(plan), blocks)


def source(plan: ExportPlan) -> str:
    """Return the text of the source."""
    name, holds = plan.options.name, conditions(plan)
    blocks = {
        "banner": banner(plan),
        "constants": _constants(plan),
        "coefficient_fields": "",
        "fixed_coefficients": _fixed_coefficients(plan),
        "prepare_effects": "",
        "effects": "",
    }
    parts = [render(read_template("model.c"), name, holds, blocks)]
    nothing = dict.fromkeys(
        (
            *("parts_of_step", "forward_drive", "forward_beside", "forward_mechanical", "forward_sampled"),
            *("forward_sampled_fixed", "forward_sensed", "forward_sensed_fixed"),
            *("inverse_before", "inverse_beside", "inverse_after"),
        ),
        "",
    )
    if plan.options.is_forward:
        parts.append(render(read_template("forward.c"), name, holds, nothing))
    if plan.options.is_inverse:
        parts.append(render(read_template("inverse.c"), name, holds, nothing))
        parts.append(render(read_template("limits.c"), name, holds, {}))
    parts.append(render(read_template("state_bytes.c"), name, holds, _byte_blocks(plan)))
    # An empty block leaves an empty line where it was marked.
    return re.sub(r"\n{3,}", "\n\n", "".join(parts))


def n_state_bytes(plan: ExportPlan, is_inverse: bool) -> int:
    """Return the size of the numbers of a state [bytes], as they lie in memory but for padding."""
    sizes = {FieldKind.REAL: _real_size(plan), FieldKind.CLOCK: 8, FieldKind.COUNT: 4}
    return sum(sizes[field.kind] * len(field.initial) for field in plan.state_fields(is_inverse))


def _real_size(plan: ExportPlan) -> int:
    return 4 if plan.options.precision is Precision.FLOAT else 8


def _declaration(field: StateField, name: str) -> str:
    size = f"[{len(field.initial)}]" if field.is_array else ""
    return f"    {_TYPES[field.kind].format(name=name)} {field.name}{size}; /* {field.comment} */"


def _identity(plan: ExportPlan) -> str:
    options, upper = plan.options, plan.options.name.upper()
    lines = [
        f'#define {upper}_MODEL_CHECKSUM "{plan.checksum}"',
        f"#define {upper}_STATE_VERSION {STATE_VERSION}",
        f"#define {upper}_SAMPLE_TIME_S {c_number(options.sample_period_s, Precision.DOUBLE)}",
    ]
    for direction, is_inverse, is_there in (
        ("FORWARD", False, options.is_forward),
        ("INVERSE", True, options.is_inverse),
    ):
        if is_there:
            n_bytes = _HEADER_BYTES + n_state_bytes(plan, is_inverse)
            lines.append(f"#define {upper}_{direction}_N_BYTES {n_bytes} /* of a saved state */")
    return "\n".join(lines)


def _constants(plan: ExportPlan) -> str:
    precision, options = plan.options.precision, plan.options
    upper = options.name.upper()
    lines = [f"enum {{ N_PLAYS = {plan.n_plays}, N_MODES = {plan.n_modes} }};", ""]
    forms = (("PLAY", plan.play_form, options.is_forward), ("STOP", plan.stop_form, options.is_inverse))
    for prefix, form, is_there in forms:
        if is_there:
            lines += [
                f"#define {prefix}_SLOPE {c_number(form.slope, precision)}",
                c_table("real", f"{prefix}_THRESHOLD", "N_PLAYS", form.thresholds.tolist(), precision),
                c_table("real", f"{prefix}_WEIGHT", "N_PLAYS", form.weights.tolist(), precision),
                "",
            ]
        relaxed = _relaxed(plan.state_fields(prefix == "STOP"), precision)
        if is_there:
            lines.append(f"#define {upper}_{'INVERSE' if prefix == 'STOP' else 'FORWARD'}_RELAXED {relaxed}")
    if options.is_inverse:
        limits = options.limits
        numbers = (limits.minimum_v, limits.maximum_v, limits.slew_v_per_s, limits.safe_v, limits.safe_ramp_v_per_s)
        lines.append(f"#define {upper}_DEFAULT_LIMITS {c_list(numbers, precision)}")
    model_bytes = ", ".join(f"0x{plan.checksum[k : k + 2]}" for k in range(0, 16, 2))
    lines += [
        f"#define {upper}_MODEL_BYTES {{{model_bytes}}}",
        "",
        f"#ifndef {upper}_FIXED_STEP_ONLY",
        f"#define CREEP_ORDER {c_number(plan.model.creep_order, precision)}",
        f"#define INVERSE_GAMMA {c_number(plan.inverse_gamma, precision)}",
        f"#define FEEDTHROUGH {c_number(plan.feedthrough, precision)}",
        c_table("real", "RATE", "N_MODES", plan.rates_per_s.tolist(), precision),
        c_table("real", "WEIGHT", "N_MODES", plan.weights.tolist(), precision),
        "#endif",
    ]
    return "\n".join(lines)


def _relaxed(fields: Sequence[StateField], precision: Precision) -> str:
    stated = []
    for field in fields:
        if any(value != 0.0 for value in field.initial):
            one_line = c_list(field.initial, precision).replace("\n", " ")
            stated.append(f".{field.name} = {one_line if field.is_array else one_line[1:-1]}")
    # In C what is not named is zero; a struct must name something.
    return "{" + ", ".join(stated or [f".{fields[0].name} = {{{c_number(0.0, precision)}}}"]) + "}"


def _fixed_coefficients(plan: ExportPlan) -> str:
    precision = plan.options.precision
    order = plan.model.creep_order
    gone, weighted, previous, current, now, held = _prepare_creep(
        plan.rates_per_s.tolist(),
        plan.weights.tolist(),
        order,
        plan.inverse_gamma,
        plan.feedthrough,
        plan.options.sample_period_s,
    )
    decays = gone if precision is Precision.FLOAT else [1.0 - share for share in gone]
    tables = ",\n".join(c_list(values, precision) for values in (decays, weighted, previous, current))
    inner = f"{tables},\n{c_number(now, precision)},\n{c_number(held, precision)}"
    indented = "\n".join(f"    {line}" for line in inner.splitlines())
    return f"static const coefficients FIXED = {{\n{indented}\n}};"


def _byte_blocks(plan: ExportPlan) -> dict[str, str]:
    suffix = "reals" if plan.options.precision is Precision.FLOAT else "doubles"
    blocks = {}
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        put, get = [], []
        for field in plan.state_fields(is_inverse):
            kind = {FieldKind.REAL: suffix, FieldKind.CLOCK: "doubles", FieldKind.COUNT: "counts"}[field.kind]
            address = "" if field.is_array else "&"
            size, last = len(field.initial), "" if field.kind is FieldKind.COUNT else ", &are_finite"
            put.append(f"    at = put_{kind}(at, {address}state->{field.name}, {size});")
            get.append(f"    at = get_{kind}(at, {address}restored.{field.name}, {size}{last});")
        blocks[f"{direction}_put"], blocks[f"{direction}_get"] = "\n".join(put), "\n".join(get)
    return blocks
