"""The header and the source of an exported model, made of templates and tables."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from types import SimpleNamespace

from fomrc_core.effects import Stage
from fomrc_core.effects.base.step_form import FieldKind, StateField
from fomrc_core.export import c_effects, standalone
from fomrc_core.export.c_numbers import c_list, c_number, c_table
from fomrc_core.export.options import Precision
from fomrc_core.export.parts import EffectPart
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

_HEADER_BYTES = 24
# gone, weighted, from previous, from current, weight of the present input, weight of the one before
_Creep = tuple[list[float], list[float], list[float], list[float], float, float]
_prepare_creep: Callable[[list[float], list[float], float, float, float, float], _Creep] = standalone.prepare_creep


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
    if plan.is_wide:
        lines.append(f"Computed in double between its inputs and its answers: {' or '.join(plan.jumping)} may jump.")
    lines += [f"Left out: {cause}." for cause in plan.left_out]
    return "/* " + "\n   ".join(lines) + " */"


def conditions(plan: ExportPlan) -> set[str]:
    """Return what holds of this export, for the templates."""
    options = plan.options
    kinds = {field.kind for _, field in _all_fields(plan)}
    is_beside = plan.is_beside
    is_widened = options.is_forward and any(part.form.widening is not None for part in plan.parts)
    holds = {
        "float": plan.precision is Precision.FLOAT,
        "float_answers": options.precision is Precision.FLOAT,
        "wide": plan.is_wide,
        "doubles": plan.precision is Precision.DOUBLE or FieldKind.WIDE in kinds,
        "counts": FieldKind.COUNT in kinds,
        "forward": options.is_forward,
        "inverse": options.is_inverse,
        "plays": options.is_forward or is_beside,
        "plain_plays": is_beside or not is_widened,
        "sum_plays": is_beside,
        "stops": options.is_inverse and not is_beside,
        "sum_stops": options.is_inverse and not plan.is_searching_limits,
        "beside": is_beside,
        "can_fail": any(part.is_inverted and c_effects.may_fail(part, "unwarp") for part in plan.parts),
        "forward_can_fail": any(c_effects.may_fail(part, "forward") for part in plan.parts),
        "searches": plan.is_searching_limits,
        "limits_by_search": plan.is_searching_limits,
        "substeps": plan.steps.counts != (1,),
        "held": plan.is_held,
        "signals": any(part.covariate for part in plan.parts),
        "started": bool(plan.forward_start),
        "widened": is_widened,
        "heard": options.is_forward and any(c_effects.hears_drive(part) for part in plan.parts),
        "bends": plan.steps.substeps is Substeps.BENDS,
    }
    return {name for name, is_true in holds.items() if is_true}


def header(plan: ExportPlan) -> str:
    """Return the text of the header."""
    name = plan.options.name
    blocks = {"banner": banner(plan), "identity": _identity(plan), "effect_types": c_effects.state_types(plan)}
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        lines = [c_effects.declarations(plan.core_fields(is_inverse), plan)]
        lines += [f"    {name}_{part.name} {part.name};" for part in plan.parts_of(is_inverse) if part.form.state]
        blocks[f"{direction}_fields"] = "\n".join(lines)
        blocks[f"{direction}_covariates"] = "".join(
            f"\n/* Tell the {covariate} from now on; not a number where it is not known. */\n"
            f"void {name}_{direction}_set_{covariate}({name}_{direction} *state, {name}_real {covariate});\n"
            for covariate in _covariates(plan, is_inverse)
        )
    return _without_gaps(render(read_template("model.h"), name, conditions(plan), blocks))


def source(plan: ExportPlan) -> str:
    """Return the text of the source."""
    name, holds = plan.options.name, conditions(plan)
    blocks = {
        "banner": banner(plan),
        "constants": _constants(plan),
        "coefficient_types": c_effects.coefficient_types(plan),
        "coefficient_fields": c_effects.coefficient_fields(plan),
        "fixed_coefficients": _fixed_coefficients(plan),
        "prepare_effects": c_effects.prepare_calls(plan),
        "effects": c_effects.definitions(plan),
    }
    parts = [render(read_template("model.c"), name, holds, blocks)]
    if plan.options.is_forward:
        parts.append(render(read_template("forward.c"), name, holds, _forward_calls(plan)))
    if plan.options.is_inverse:
        parts.append(render(read_template("inverse.c"), name, holds, _inverse_calls(plan)))
        parts.append(render(read_template("limits.c"), name, holds, {}))
    parts.append(render(read_template("state_bytes.c"), name, holds, _byte_blocks(plan)))
    return _without_gaps("".join(parts))


def n_state_bytes(plan: ExportPlan, is_inverse: bool) -> int:
    """Return the size of the numbers of a state [bytes], as they lie in memory but for padding."""
    sizes = {FieldKind.REAL: _real_size(plan), FieldKind.WIDE: 8, FieldKind.COUNT: 4}
    return sum(sizes[field.kind] * len(field.initial) for _, field in _fields(plan, is_inverse))


def _fields(plan: ExportPlan, is_inverse: bool) -> Iterator[tuple[str, StateField]]:
    """Yield every field of a state with what stands before its name in C."""
    yield from ((f"{owner}." if owner else "", field) for owner, field in plan.state_fields(is_inverse))


def _all_fields(plan: ExportPlan) -> Iterator[tuple[str, StateField]]:
    if plan.options.is_forward:
        yield from _fields(plan, False)
    if plan.options.is_inverse:
        yield from _fields(plan, True)


def _real_size(plan: ExportPlan) -> int:
    return 4 if plan.precision is Precision.FLOAT else 8


def _covariates(plan: ExportPlan, is_inverse: bool) -> list[str]:
    return sorted({part.covariate for part in plan.parts_of(is_inverse) if part.covariate})


def _without_gaps(text: str) -> str:
    # An empty block leaves an empty line where it was marked.
    return re.sub(r"\n{3,}", "\n\n", text)


def _identity(plan: ExportPlan) -> str:
    options, upper = plan.options, plan.options.name.upper()
    lines = [
        f'#define {upper}_MODEL_CHECKSUM "{plan.checksum}"',
        f"#define {upper}_STATE_VERSION {STATE_VERSION}",
        f"#define {upper}_SAMPLE_TIME_S {c_number(options.sample_period_s, Precision.DOUBLE)}",
    ]
    ways = (("FORWARD", False, options.is_forward), ("INVERSE", True, options.is_inverse))
    for direction, is_inverse, is_there in ways:
        if is_there:
            n_bytes = _HEADER_BYTES + n_state_bytes(plan, is_inverse)
            lines.append(f"#define {upper}_{direction}_N_BYTES {n_bytes} /* of a saved state */")
    return "\n".join(lines)


def _constants(plan: ExportPlan) -> str:
    precision, options = plan.precision, plan.options
    upper, holds = options.name.upper(), conditions(plan)
    lines = [f"enum {{ N_PLAYS = {plan.n_plays}, N_MODES = {plan.n_modes} }};", ""]
    for prefix, form, condition in (("PLAY", plan.play_form, "plays"), ("STOP", plan.stop_form, "stops")):
        if condition in holds:
            lines += [
                f"#define {prefix}_SLOPE {c_number(form.slope, precision)}",
                c_table("real", f"{prefix}_THRESHOLD", "N_PLAYS", form.thresholds.tolist(), precision),
                c_table("real", f"{prefix}_WEIGHT", "N_PLAYS", form.weights.tolist(), precision),
                "",
            ]
    if options.is_forward:
        lines += [f"#define {upper}_FORWARD_RELAXED {_relaxed(plan, False)}", *_substep_constants(plan)]
    if options.is_inverse:
        limits = options.limits
        numbers = (limits.minimum_v, limits.maximum_v, limits.slew_v_per_s, limits.safe_v, limits.safe_ramp_v_per_s)
        lines.append(f"#define {upper}_INVERSE_RELAXED {_relaxed(plan, True)}")
        lines.append(f"#define {upper}_DEFAULT_LIMITS {c_list(numbers, options.precision)}")
    if plan.is_searching_limits:
        lines.append(f"#define GAIN_UM_PER_V {c_number(1.0 / plan.stop_form.slope, precision)}")
    model_bytes = ", ".join(f"0x{plan.checksum[k : k + 2]}" for k in range(0, 16, 2))
    return "\n".join(
        [
            *lines,
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
    )


def _substep_constants(plan: ExportPlan) -> list[str]:
    if plan.steps.counts == (1,):
        return []
    precision, largest = plan.precision, plan.largest_v
    lines = [
        f"enum {{ N_PARTS_LEAST = {plan.steps.least}, N_PARTS_LARGE = {N_PARTS_LARGE} }};",
        f"#define LARGE_CHANGE {c_number(LARGE_CHANGE * largest, precision)}",
    ]
    if plan.steps.substeps is Substeps.BENDS:
        lines += [
            f"enum {{ N_PARTS_SMALL = {N_SUBSTEPS} }};",
            f"#define SMALL_CHANGE {c_number(SMALL_CHANGE * largest, precision)}",
            f"#define BEND_AFTER {c_number(BEND_AFTER, precision)}",
            f"#define BEND_FADES {c_number(BEND_FADES, precision)}",
        ]
    return lines


def _relaxed(plan: ExportPlan, is_inverse: bool) -> str:
    stated = []
    for owner, field in _fields(plan, is_inverse):
        if any(value != 0.0 for value in field.initial):
            if field.kind is FieldKind.COUNT:
                text = ", ".join(f"{int(value)}u" for value in field.initial)
            else:
                wide = Precision.DOUBLE if field.kind is FieldKind.WIDE else plan.precision
                text = ", ".join(c_number(value, wide) for value in field.initial)
            stated.append(f".{owner}{field.name} = {f'{{{text}}}' if field.is_array else text}")
    # In C what is not named is zero; a struct must name something.
    zero = c_number(0.0, plan.precision)
    return "{" + ", ".join(stated or [f".previous = {zero}"]) + "}"


def _fixed_coefficients(plan: ExportPlan) -> str:
    counts = plan.steps.counts if plan.options.is_forward else (1,)
    counts = tuple(sorted({1, *counts})) if plan.options.is_inverse else counts
    texts = [_coefficients(plan, n_parts) for n_parts in counts]
    if plan.options.is_forward and plan.steps.counts != (1,):
        *others, most = plan.steps.counts
        cases = [f"    if (n_parts == {n_parts}) return &FIXED_{n_parts};" for n_parts in others]
        lines = ["static const coefficients *fixed_for(int n_parts)", "{", *(cases or ["    (void)n_parts;"])]
        texts.append("\n".join([*lines, f"    return &FIXED_{most};", "}"]))
    return "\n\n".join(texts)


def _coefficients(plan: ExportPlan, n_parts: int) -> str:
    precision = plan.precision
    step_s = plan.options.sample_period_s / n_parts
    gone, weighted, previous, current, now, held = _prepare_creep(
        plan.rates_per_s.tolist(),
        plan.weights.tolist(),
        plan.model.creep_order,
        plan.inverse_gamma,
        plan.feedthrough,
        step_s,
    )
    decays = gone if precision is Precision.FLOAT else [1.0 - share for share in gone]
    members = [c_list(values, precision) for values in (decays, weighted, previous, current)]
    members += [c_number(now, precision), c_number(held, precision)]
    members += [_effect_coefficients(part, step_s) for part in plan.parts if part.form.coefficients]
    indented = "\n".join(f"    {line}" for line in ",\n".join(members).splitlines())
    return f"static const coefficients FIXED_{n_parts} = {{\n{indented}\n}};"


def _effect_coefficients(part: EffectPart, step_s: float) -> str:
    sizes, constants = part.form.coefficient_sizes, SimpleNamespace(**dict(part.form.constants))
    filled = SimpleNamespace(**{name: [0.0] * size for name, size in sizes.items() if size})
    if part.form.prepare is not None:
        part.form.prepare(k=filled, c=constants, step_s=step_s)
    members = [
        c_list(getattr(filled, name), Precision.DOUBLE) if size else c_number(getattr(filled, name), Precision.DOUBLE)
        for name, size in sizes.items()
    ]
    return "{" + ", ".join(members) + "}"


def _forward_calls(plan: ExportPlan) -> dict[str, str]:
    beside = c_effects.added_calls(plan, "forward", "moved", "value", "(double)step_s")
    drive = c_effects.step_calls(plan, (Stage.DRIVE,), "forward", "(double)step_s")
    warps = c_effects.step_calls(plan, (Stage.HYSTERESIS,), "warp", "(double)step_s")
    blocks = {
        "forward_drive": "",
        "forward_hysteresis": "\n".join(text for text in (drive, warps, *_widenings(plan), beside) if text),
        "forward_mechanical": c_effects.step_calls(plan, (Stage.MECHANICAL,), "forward", "(double)step_s"),
        "forward_setters": _setters(plan, is_inverse=False),
    }
    fixed = f"{plan.options.name.upper()}_SAMPLE_TIME_S"
    for suffix, step in (("", "(double)step_s"), ("_fixed", fixed)):
        for name, stage in (("sampled", Stage.SAMPLED_DRIVE), ("sensed", Stage.SENSED)):
            blocks[f"forward_{name}{suffix}"] = _indented(c_effects.step_calls(plan, (stage,), "forward", step))
    for name in ("forward_hysteresis", "forward_mechanical"):
        blocks[name] = _indented(blocks[name])
    return blocks


def _widenings(plan: ExportPlan) -> list[str]:
    calls = c_effects.added_calls(plan, "widening", "widening", "value", "(double)step_s").replace("+=", "*=")
    if not calls:
        return ["moved = move_plays(state->plays, value);"]
    return [calls, "moved = move_widened_plays(state->plays, value, widening);"]


def _inverse_calls(plan: ExportPlan) -> dict[str, str]:
    step = "(double)step_s"
    before, after = (Stage.MECHANICAL, Stage.SENSED), (Stage.SAMPLED_DRIVE, Stage.DRIVE)
    moves = c_effects.added_calls(plan, "forward", "moved", "value", step).replace("moved += (real)", "(void)")
    blocks = {
        "inverse_before": c_effects.step_calls(plan, before, "inverse", step, is_reversed=True),
        "beside_sum": c_effects.added_calls(plan, "beside", "moved", "voltage_v", step),
        "beside_moves": moves,
        "inverse_unwarp": c_effects.step_calls(plan, (Stage.HYSTERESIS,), "unwarp", step, is_reversed=True),
        "inverse_after": c_effects.step_calls(plan, after, "inverse", step, is_reversed=True),
    }
    blocks = {name: _indented(text) for name, text in blocks.items()}
    return blocks | {"inverse_setters": _setters(plan, is_inverse=True)}


def _indented(text: str) -> str:
    return "\n".join(f"    {line}" for line in text.splitlines())


def _setters(plan: ExportPlan, is_inverse: bool) -> str:
    name, direction = plan.options.name, "inverse" if is_inverse else "forward"
    return "".join(
        f"\nvoid {name}_{direction}_set_{covariate}({name}_{direction} *state, {name}_real {covariate})\n{{\n"
        f"    state->knows_{covariate} = is_within({covariate}, (real){name.upper()}_LARGEST_INPUT) ? 1u : 0u;\n"
        f"    state->{covariate} = state->knows_{covariate} ? {covariate} : R(0.0);\n}}\n"
        for covariate in _covariates(plan, is_inverse)
    )


def _byte_blocks(plan: ExportPlan) -> dict[str, str]:
    real = "reals" if plan.precision is Precision.FLOAT else "doubles"
    kinds = {FieldKind.REAL: real, FieldKind.WIDE: "doubles", FieldKind.COUNT: "counts"}
    blocks = {}
    for direction, is_inverse in (("forward", False), ("inverse", True)):
        put, get = [], []
        for owner, field in _fields(plan, is_inverse):
            kind, address = kinds[field.kind], "" if field.is_array else "&"
            size, last = len(field.initial), "" if field.kind is FieldKind.COUNT else ", &are_finite"
            put.append(f"    at = put_{kind}(at, {address}state->{owner}{field.name}, {size});")
            get.append(f"    at = get_{kind}(at, {address}restored.{owner}{field.name}, {size}{last});")
        blocks[f"{direction}_put"], blocks[f"{direction}_get"] = "\n".join(put), "\n".join(get)
    return blocks
