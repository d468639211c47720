"""What the compensator says about itself on /diagnostics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fomrc_core.control.compensation_loop import Activity
from fomrc_ros.node.diagnostics import ERROR, OK, WARN, Report

if TYPE_CHECKING:
    from fomrc_ros.compensator.node import CompensatorNode


def describe(node: CompensatorNode) -> Report:
    """Return the compensator's report."""
    timing, loop = node.timing.report(), node.loop
    report = Report(values={"active": node.is_active, "parameters_file": node.parameters.values["parameters_file"]})
    if node.problem:
        report.worsen(ERROR if loop is None else WARN, node.problem)
    if loop is None:
        report.worsen(OK if node.problem else WARN, "not configured")
        return report
    if report.level == OK:
        report.message = loop.activity.value if node.is_active else "inactive"
    nominal_hz = 1.0 / node.period_s
    report.values.update(
        {
            "activity": loop.activity.value,
            "rate_hz": timing.rate_hz,
            "late_ticks": timing.n_late,
            "late_ticks_total": node.timing.n_late_total,
            "largest_gap_ms": 1e3 * timing.latest_s,
            "tick_to_publish_mean_us": 1e6 * timing.busy_mean_s,
            "tick_to_publish_p99_us": 1e6 * timing.busy_p99_s,
            "tick_to_publish_max_us": 1e6 * timing.busy_max_s,
            "voltage_v": loop.voltage_v,
            "target_um": "none" if loop.target_um is None else loop.target_um,
            "target_age_s": loop.target_age_s,
            "clamped_ticks": loop.counts.n_clamped,
            "slewed_ticks": loop.counts.n_slewed,
            "stale_targets": loop.counts.n_stale,
            "refused_messages": node.n_refused,
            "last_refusal": node.last_refusal,
            "model_swaps": loop.counts.n_swaps,
            "swapping": loop.is_swapping,
            "memory_age_s": loop.age_s,
            "turning_points": len(loop.memory.turning_points),
            "not_inverted": ", ".join(name for name, _ in loop.compensator.not_inverted) or "none",
            "creep_order": loop.compensator.model.creep_order,
            "fit_rms_um": node.parameters.values["model.fit_rms_um"] or "not known",
            "elements": loop.compensator.model.n_elements,
        }
    )
    if node.checkpoint is not None:
        report.values["checkpoints"] = node.checkpoint.n_snapshots
        if node.checkpoint.failure:
            report.worsen(WARN, node.checkpoint.failure)
    if loop.activity in (Activity.HOLDING, Activity.RAMPING) and node.is_active:
        report.worsen(WARN, loop.activity.value)
    if node.is_active and timing.rate_hz < 0.9 * nominal_hz and not node.get_parameter("use_sim_time").value:
        report.worsen(WARN, f"runs at {timing.rate_hz:.0f} Hz of {nominal_hz:.0f}")
    return report
