"""What the compensator says about itself on /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fomrc_core.control.actuator_drive import ActuatorDrive
from fomrc_core.control.checkpoint import CheckpointWriter
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.loop_account import Activity
from fomrc_core.control.loop_timing import TimingReport
from fomrc_ros.node.diagnostics import ERROR, OK, WARN, Report


@dataclass
class Refusals:
    """Messages that could not be used: how many, and why the last one."""

    n_refused: int = 0
    last: str = ""


@dataclass(frozen=True)
class Condition:
    """What a report is made of.

    Args:
        drive: who drives, and what is wrong.
        timing: how well the loop kept time since the last report.
        n_late_total: late ticks since the start.
        period_s: nominal period [s].
        values: the parameters.
        refusals: messages refused.
        checkpoint: writer of the checkpoint, None where there is none.
        others: full names of other nodes that publish the same voltage.
        has_own_time: whether the node runs by the machine's clock, not by /clock.
    """

    drive: ActuatorDrive
    timing: TimingReport
    n_late_total: int
    period_s: float
    values: Mapping[str, Any]
    refusals: Refusals
    checkpoint: CheckpointWriter | None
    others: Sequence[str]
    has_own_time: bool


def describe(now: Condition) -> Report:
    """Return the compensator's report."""
    drive, loop = now.drive, now.drive.loop
    report = Report(values={"active": drive.is_active, "parameters_file": now.values["parameters_file"]})
    if drive.problem:
        report.worsen(ERROR if loop is None else WARN, drive.problem)
    if now.others:
        report.values["also_driven_by"] = ", ".join(now.others)
        report.worsen(WARN, f"voltage is also published by {', '.join(now.others)}")
    if loop is None:
        if not drive.problem:
            report.worsen(WARN, drive.activity if drive.needs_ticks and not drive.is_active else "not configured")
        return report
    if report.level == OK:
        report.message = drive.activity
    report.values.update(_timing_values(now) | _loop_values(drive, loop))
    report.values["refused_messages"] = now.refusals.n_refused
    report.values["last_refusal"] = now.refusals.last
    report.values["fit_rms_um"] = now.values["model.fit_rms_um"] or "not known"
    if now.checkpoint is not None:
        report.values["checkpoints"] = now.checkpoint.n_snapshots
        if now.checkpoint.failure:
            report.worsen(WARN, now.checkpoint.failure)
    _look_at_motion(report, drive, loop)
    if loop.preview is not None and loop.preview.note:
        report.worsen(WARN, loop.preview.note)
    if drive.is_active and now.timing.rate_hz * now.period_s < 0.9 and now.has_own_time:
        report.worsen(WARN, f"runs at {now.timing.rate_hz:.0f} Hz of {1.0 / now.period_s:.0f}")
    return report


def _look_at_motion(report: Report, drive: ActuatorDrive, loop: CompensationLoop) -> None:
    shortfall_um = loop.take_shortfall_um()
    report.values["shortfall_um"] = shortfall_um
    if not drive.needs_ticks:
        return
    if drive.is_ramping or loop.activity in (Activity.HOLDING, Activity.RAMPING):
        report.worsen(WARN, drive.activity)
    elif shortfall_um:
        report.worsen(WARN, f"saturated: target out of reach by {shortfall_um:.3g} um")
    if loop.counts.n_without_voltage:
        report.worsen(WARN, f"for {loop.counts.n_without_voltage} ticks the model asked for no finite voltage")


def _timing_values(now: Condition) -> dict[str, object]:
    timing = now.timing
    return {
        "rate_hz": timing.rate_hz,
        "late_ticks": timing.n_late,
        "late_ticks_total": now.n_late_total,
        "largest_gap_ms": 1e3 * timing.latest_s,
        "tick_to_publish_mean_us": 1e6 * timing.busy_mean_s,
        "tick_to_publish_p99_us": 1e6 * timing.busy_p99_s,
        "tick_to_publish_max_us": 1e6 * timing.busy_max_s,
    }


def _preview_values(loop: CompensationLoop) -> dict[str, object]:
    preview = loop.preview
    values: dict[str, object] = {"trajectory": "none" if loop.trajectory is None else "followed"}
    if preview is not None:
        values["preview_s"] = preview.n_preview * preview.step_s
        values["dynamics_undone"] = ", ".join(e.name for e in (*preview.amplifier, *preview.mechanics)) or "none"
        values["dynamics_undone_to_hz"] = preview.holds_to_hz
    return values


def _loop_values(drive: ActuatorDrive, loop: CompensationLoop) -> dict[str, object]:
    model, counts = loop.compensator.model, loop.counts
    return {
        "activity": drive.activity,
        "voltage_v": loop.voltage_v,
        "target_um": "none" if loop.target_um is None else loop.target_um,
        "target_age_s": loop.target_age_s,
        "clamped_ticks": counts.n_clamped,
        "slewed_ticks": counts.n_slewed,
        "stale_targets": counts.n_stale,
        "model_swaps": counts.n_swaps,
        "swapping": loop.is_swapping,
        "memory_age_s": loop.age_s,
        "turning_points": len(loop.memory.turning_points),
        "not_inverted": ", ".join(name for name, _ in loop.compensator.not_inverted) or "none",
        **_preview_values(loop),
        "creep_order": model.creep_order,
        "elements": model.n_elements,
    }
