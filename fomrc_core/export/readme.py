"""The one page that goes with exported C: how to call it, its memory, its worst case."""

from __future__ import annotations

from fomrc_core.export.c_files import conditions, n_state_bytes
from fomrc_core.export.options import Precision
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.template import read_template, render

_EXAMPLE = {
    "forward": """static piezo_forward actuator;
piezo_forward_init(&actuator);
moved_um = piezo_forward_step_fixed(&actuator, voltage_v);          /* once each sample time */
moved_um = piezo_forward_step(&actuator, voltage_v, elapsed_s);     /* or any step */""",
    "inverse": """static piezo_inverse feedforward;
piezo_inverse_init(&feedforward);
voltage_v = piezo_inverse_step_fixed(&feedforward, desired_um);     /* once each sample time */
voltage_v = piezo_inverse_step(&feedforward, desired_um, elapsed_s); /* or any step */
voltage_v = piezo_inverse_step_fixed_limited(&feedforward, &piezo_default_limits, desired_um);""",
}


def readme(plan: ExportPlan) -> str:
    """Return the text of the page."""
    options, model = plan.options, plan.model
    summary = (
        f"A piezo actuator of {model.n_elements} elements that saturate and creep of order {model.creep_order!r}, "
        f"written by `fomrc export` ({options.precision.value} precision, direction {options.direction.value}).\n"
        f"Model checksum (SHA-256): `{plan.checksum}`."
    )
    if plan.left_out:
        summary += "\n\nLeft out: " + "; ".join(str(cause) for cause in plan.left_out) + "."
    ways = [way for way, is_there in (("forward", options.is_forward), ("inverse", options.is_inverse)) if is_there]
    blocks = {
        "title": f"# {options.name}",
        "summary": summary,
        "example": "\n\n".join(_EXAMPLE[way].replace("piezo", options.name) for way in ways),
        "memory": _memory(plan, ways),
        "worst_case": _worst_case(plan),
        "accuracy": _accuracy(plan),
    }
    limits = options.limits
    text = render(read_template("README.md"), options.name, conditions(plan), blocks)
    text = text.replace("@sample_time@", f"{options.sample_period_s:g} s")
    return text.replace(
        "@limits@",
        f"{limits.minimum_v:g} to {limits.maximum_v:g} V, {limits.slew_v_per_s:g} V/s; "
        f"safe at {limits.safe_v:g} V, {limits.safe_ramp_v_per_s:g} V/s",
    )


def _memory(plan: ExportPlan, ways: list[str]) -> str:
    lines = ["| what | bytes |", "|---|---|"]
    for way in ways:
        n_bytes = n_state_bytes(plan, way == "inverse")
        lines.append(f"| state, {way} (one for each actuator; saved: 24 more) | {n_bytes} |")
    real_bytes = 4 if plan.options.precision is Precision.FLOAT else 8
    table = real_bytes * (4 * plan.n_modes + 2)
    lines.append(f"| stack of a step of any length, for its coefficients | {table} |")
    lines.append(f"| tables of constants: creep at the sample time | {table} |")
    return "\n".join(lines)


def _worst_case(plan: ExportPlan) -> str:
    n_plays, n_modes = plan.n_plays, plan.n_modes
    lines = [
        f"Every fixed step does the same work, whatever the input: {n_plays} plays (two comparisons, a product and a "
        f"sum each) and {n_modes} modes (four products and sums each). No loop waits for a tolerance."
    ]
    if plan.options.is_inverse:
        lines.append(
            f"A limited step walks along at most {n_plays + 3} straight pieces of the hysteresis on top, each "
            f"{n_plays} plays twice over, and only where the voltage is limited."
        )
    return "\n".join(lines)


def _accuracy(plan: ExportPlan) -> str:
    if plan.options.precision is Precision.FLOAT:
        return (
            "Numbers are single precision: answers agree with the Python model to 1e-5 of the largest (the self-test "
            "checks it). What the slow creep modes gain in one step is less than their last digit: it is kept beside "
            "them."
        )
    return "Numbers are double precision: answers agree with the Python model to 1e-12 of the largest (self-test)."
