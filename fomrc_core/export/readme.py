"""The one page that goes with exported C: how to call it, its memory, its worst case."""

from __future__ import annotations

from fomrc_core.export.c_files import conditions, n_state_bytes
from fomrc_core.export.options import Precision
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.template import read_template, render

_LONG_LINE = 100  # samples an effect keeps: to look for one is worth a word
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
    real_bytes = 4 if plan.precision is Precision.FLOAT else 8
    table = real_bytes * (4 * plan.n_modes + 2)
    lines.append(f"| stack of a step of any length, for its coefficients | {table} |")
    lines.append(f"| tables of constants: creep at the sample time | {table} |")
    return "\n".join(lines)


def _worst_case(plan: ExportPlan) -> str:
    n_plays, n_modes, n_parts = plan.n_plays, plan.n_modes, plan.steps.counts[-1]
    lines = [
        f"Every part of a step does the same work, whatever the input: {n_plays} plays (two comparisons, a product and "
        f"a sum each) and {n_modes} modes (four products and sums each), and what its effects do."
    ]
    if plan.options.is_forward and n_parts > 1:
        lines.append(f"A forward step in which the voltage changes much is divided into up to {n_parts} parts.")
    longest = max((len(field.initial) for part in plan.parts for field in part.form.state), default=0)
    if longest > _LONG_LINE:
        lines.append(f"An effect looks for a sample of the past among up to {longest}, from where it found the last.")
    if plan.is_beside:
        lines.append(f"An inverse step tries at most 160 voltages, each {n_plays} plays, usually less than ten.")
    if plan.is_searching_limits:
        lines.append(
            "A limited step, where the voltage is limited, tries at most 120 displacements, each an inverse step of a "
            "copy of the state, usually less than ten."
        )
    elif plan.options.is_inverse:
        lines.append(
            f"A limited step, where the voltage is limited, walks along at most {n_plays + 3} straight pieces of the "
            f"hysteresis on top, each {n_plays} plays twice over."
        )
    return "\n".join(lines)


def _accuracy(plan: ExportPlan) -> str:
    if plan.options.precision is Precision.DOUBLE:
        return "Numbers are double precision: answers agree with the Python model to 1e-12 of the largest (self-test)."
    if plan.is_wide:
        names = " or ".join(f"`{name}`" for name in plan.jumping)
        return (
            "Inputs and answers are single precision and agree with the Python model to 1e-5 of the largest "
            "(self-test). Between them all is computed in double, and so is the state: where what comes before it "
            f"changes ever so little, {names} may jump, and in single precision would do so a sample earlier or later. "
            "A processor without double precision takes accordingly longer."
        )
    lines = [
        "Numbers are single precision: answers agree with the Python model to 1e-5 of the largest (self-test). What "
        "the slow creep modes gain in one step is less than their last digit: it is kept beside them."
    ]
    if plan.parts:
        lines.append("Effects compute in double precision, and so do their clocks.")
    return "\n".join(lines)
