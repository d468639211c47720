"""The figures of a diagnosis: what was simulated, where it is wrong, and what naming the cause gains."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.records.drive import is_settled
from fomrc_core.records.residual import normalised_percent, rms
from fomrc_core.report.residual_views import (
    amplitude_density,
    binned,
    envelope,
    loop_phase_deg,
    rate_v_per_s,
    time_since_motion_s,
)

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis
    from fomrc_core.diagnosis.record_view import RecordView

Array = NDArray[np.float64]

MEASURED, BEFORE, AFTER, FLOOR = "#333333", "#d1495b", "#1f6f8b", "#cfd4da"
_BEFORE_NAME, _AFTER_NAME = "base model", "with what was found"
_WIDE_RATIO = 20.0
_N_RECORDS_MAX = 8
_ROLES = {
    "train": "learnt from",
    "test": "held out of every fit; causes were accepted on it",
    "report": "held out, seen by no fit",
}


def quoted_record(diagnosis: Diagnosis) -> RecordView:
    """Return the record before and after are quoted on."""
    named = [view for view in diagnosis.records if view.name == diagnosis.quoted_on]
    order = {"report": 0, "test": 1, "train": 2}
    return min(named or diagnosis.records, key=lambda view: order[view.role])


def quoted_words(diagnosis: Diagnosis) -> str:
    """Return what before and after are quoted on, and by what right it is called held out."""
    view = quoted_record(diagnosis)
    if view.role != "train":
        return f"{view.name}, {_ROLES[view.role]}"
    # Nothing else was given: blocks of every record are kept from the fits.
    several = sum(v.role == "train" for v in diagnosis.records) > 1
    return f"blocks held out of {'every record' if several else view.name}"


def simulation_figure(diagnosis: Diagnosis) -> Figure:
    """Return measured and simulated displacement of the quoted record, and what is left of it, over time."""
    view = quoted_record(diagnosis)
    curves = _curves(diagnosis, view)
    figure = Figure(figsize=(10.0, 3.0 + 1.9 * len(curves)), layout="constrained")
    first, *others = figure.subplots(1 + len(curves), 1, sharex=True)
    middle = float(np.mean(view.measured_um))
    simulated_um = view.measured_um - view.residual_before_um
    first.plot(*envelope(view.time_s, view.measured_um - middle), color=MEASURED, lw=1.4, label="measured")
    first.plot(*envelope(view.time_s, simulated_um - middle), "--", color=BEFORE, lw=1.2, label=_BEFORE_NAME)
    _fit_to(first, (view.measured_um - middle)[is_settled(view.time_s, view.voltage_v)])
    first.set_ylabel("displacement [µm]")
    role = _ROLES[view.role]
    if view.role == "train" and all(v.role == "train" for v in diagnosis.records):
        role += ", but for blocks that were held out"
    first.set_title(f"{view.name} ({role})", fontsize=10)
    first.legend(loc="upper right", ncols=2)
    for axes, (name, colour, values) in zip(others, curves, strict=True):
        _residual_over_time(axes, view, diagnosis, colour, values)
        axes.set_title(f"what is left, {name}", fontsize=10)
    others[-1].set_xlabel("time [s]; grey: ± 2 × noise floor")
    return _finished(figure)


def where_figure(diagnosis: Diagnosis) -> Figure:
    """Return the residual of all records against voltage, rate, loop phase, time at rest, and its spectrum."""
    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    (by_voltage, by_rate, by_phase), (by_rest, spectrum, gains) = figure.subplots(2, 3)
    _against(by_voltage, diagnosis, lambda v: v.voltage_v)
    by_voltage.set_xlabel("voltage [V]")
    by_voltage.set_title("against the drive", fontsize=9)
    _against(by_rate, diagnosis, lambda v: rate_v_per_s(v.time_s, v.voltage_v), by_rank=True)
    by_rate.set_xlabel("rate of the drive [V/s]")
    by_rate.set_title("against its rate", fontsize=9)
    speeds = np.abs(np.concatenate([rate_v_per_s(v.time_s, v.voltage_v) for v in diagnosis.records]))
    moving = speeds[speeds > 1e-9 * float(speeds.max())]
    if float(moving.max()) > _WIDE_RATIO * float(np.median(moving)):
        by_rate.set_xscale("symlog", linthresh=float(np.median(moving)))
    _against(by_phase, diagnosis, lambda v: loop_phase_deg(v.voltage_v))
    by_phase.set_xlabel("place in the loop [°], up then down")
    by_phase.set_title("against the place in the loop", fontsize=9)
    by_phase.set_xticks([0, 90, 180, 270, 360])
    _against(by_rest, diagnosis, lambda v: _logarithm(time_since_motion_s(v.time_s, v.voltage_v)), is_log=True)
    by_rest.set_xlabel("time since the drive last moved [s]")
    by_rest.set_title("against the time at rest", fontsize=9)
    _spectrum(spectrum, diagnosis)
    _gains(gains, diagnosis)
    handles, names = by_voltage.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=3)
    return _finished(figure)


def records_figure(diagnosis: Diagnosis) -> Figure | None:
    """Return the residual of every record over time, before and after; None for a single record."""
    views = diagnosis.records[:_N_RECORDS_MAX]
    if len(views) < 2:
        return None
    n_columns = len(_curves(diagnosis, views[0]))
    scale, unit = _scale(diagnosis)
    figure = Figure(figsize=(10.0, 0.8 + 1.6 * len(views)), layout="constrained")
    for row, view in zip(figure.subplots(len(views), n_columns, squeeze=False), views, strict=True):
        settled = is_settled(view.time_s, view.voltage_v)
        for axes, (name, colour, values) in zip(row, _curves(diagnosis, view), strict=True):
            _residual_over_time(axes, view, diagnosis, colour, values)
            axes.set_title(f"{view.name}, {name}: {scale * rms(values[settled]):.3g} {unit} rms", fontsize=9)
    for axes in figure.axes[-n_columns:]:
        axes.set_xlabel("time [s]")
    return _finished(figure)


def png(figure: Figure, dots_per_inch: int = 110) -> bytes:
    """Return a figure as a PNG."""
    buffer = io.BytesIO()
    beat("pictures")
    # No date and no version inside: the same diagnosis gives the same file.
    figure.savefig(buffer, format="png", dpi=dots_per_inch, metadata={"Software": None})
    beat("pictures", 0)
    return buffer.getvalue()


def _residual_over_time(axes: Axes, view: RecordView, diagnosis: Diagnosis, colour: str, values: Array) -> None:
    scale, unit = _scale(diagnosis)
    axes.plot(*envelope(view.time_s, scale * values), color=colour, lw=0.8)
    _fit_to(axes, scale * values[is_settled(view.time_s, view.voltage_v)])
    _floor_band(axes, 2.0 * scale * diagnosis.noise_floor_um, "")
    axes.set_ylabel(f"residual [{unit}]")
    axes.margins(x=0.0)


def _against(
    axes: Axes,
    diagnosis: Diagnosis,
    of: Callable[[RecordView], Array],
    *,
    by_rank: bool = False,
    is_log: bool = False,
) -> None:
    scale, unit = _scale(diagnosis)
    axes.set_ylabel(f"residual [{unit}]")
    kept = [is_settled(view.time_s, view.voltage_v) for view in diagnosis.records]
    against = np.concatenate([of(view)[k] for view, k in zip(diagnosis.records, kept, strict=True)])
    per_record = [_curves(diagnosis, view) for view in diagnosis.records]
    for index, (name, colour, _) in enumerate(per_record[0]):
        residual = np.concatenate([c[index][2][k] for c, k in zip(per_record, kept, strict=True)])
        bins = binned(against, scale * residual, by_rank=by_rank)
        if not bins.centres.size:
            axes.text(0.5, 0.5, "nothing in these records", transform=axes.transAxes, ha="center", color="#777777")
            axes.set_xticks([])
            axes.set_yticks([])
            return
        places = 10.0**bins.centres if is_log else bins.centres
        low, high = bins.means - bins.spreads, bins.means + bins.spreads
        axes.fill_between(places, low, high, color=colour, alpha=0.18, lw=0.0)
        axes.plot(places, bins.means, color=colour, lw=1.6, label=f"{name}: mean ± standard deviation")
    if is_log:
        axes.set_xscale("log")
        n_decades = float(np.ptp(bins.centres))
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if n_decades > 2.0 else (1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    _floor_band(axes, scale * diagnosis.noise_floor_um, "± noise floor")


def _spectrum(axes: Axes, diagnosis: Diagnosis) -> None:
    view = quoted_record(diagnosis)
    scale, unit = _scale(diagnosis)
    settled = is_settled(view.time_s, view.voltage_v)
    for _, colour, values in _curves(diagnosis, view):
        frequency_hz, density = amplitude_density(view.time_s[settled], scale * values[settled])
        axes.loglog(frequency_hz, np.maximum(density, 1e-12), color=colour, lw=1.0)
    half_rate_hz = 0.5 / float(np.median(np.diff(view.time_s)))
    axes.axhline(scale * diagnosis.noise_floor_um / np.sqrt(half_rate_hz), color=FLOOR, lw=3.0, zorder=0)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"residual [{unit}/√Hz]")
    axes.set_title(f"spectrum, {view.name}", fontsize=9)


def _gains(axes: Axes, diagnosis: Diagnosis) -> None:
    # in the order in which they were found, forms without a name among them: each was scored beside those before it
    told = [(f, f"+ {f.cause}") for f in diagnosis.accepted] + [
        (f, f"+ form of {f.cause}") for f in diagnosis.stand_ins
    ]
    told.sort(key=lambda pair: -pair[0].nrmse_percent_test_before)
    errors = [diagnosis.baseline_test_percent, *(f.nrmse_percent_test_after for f, _ in told)]
    names = [_BEFORE_NAME, *(name for _, name in told)]
    floor = normalised_percent(diagnosis.noise_floor_um, [quoted_record(diagnosis).measured_um])
    longest = max(*errors, floor)
    for place, (error, name) in enumerate(zip(errors, names, strict=True)):
        axes.barh(place, error, color=AFTER if place else BEFORE, height=0.5)
        axes.text(0.01 * longest, place - 0.29, f"{name}: {error:.3g} %", va="bottom", fontsize=8.5)
    axes.axvline(floor, color="#8a929b", lw=1.5, ls=":")
    axes.set_yticks([])
    axes.set_ylim(len(errors) - 0.4, -0.75)
    axes.set_xlim(0.0, 1.1 * longest)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.set_xlabel("error [% of range]; dotted: noise floor")
    view = quoted_record(diagnosis)
    where = "held-out blocks" if view.role == "train" else f"{view.name} (held out)"
    axes.set_title(f"gained, {where}", fontsize=9)


def _curves(diagnosis: Diagnosis, view: RecordView) -> Sequence[tuple[str, str, Array]]:
    before = (_BEFORE_NAME, BEFORE, view.residual_before_um)
    # Without findings nothing was extended: one curve says it all.
    is_extended = bool(diagnosis.findings or diagnosis.stand_ins)
    return (before, (_AFTER_NAME, AFTER, view.residual_after_um)) if is_extended else (before,)


def _scale(diagnosis: Diagnosis) -> tuple[float, str]:
    """Return the factor from um and the unit in which residuals read well."""
    return (1e3, "nm") if max(rms(v.residual_before_um) for v in diagnosis.records) < 0.5 else (1.0, "µm")


def _floor_band(axes: Axes, half_width: float, name: str) -> None:
    axes.axhspan(-half_width, half_width, color=FLOOR, alpha=0.7, lw=0.0, zorder=0, label=name)


def _logarithm(values: Array) -> Array:
    known = np.isfinite(values) & (values > 0.0)
    return np.where(known, np.log10(np.where(known, values, 1.0)), np.nan)


def _fit_to(axes: Axes, values: Array) -> None:
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.08 * (high - low) + 1e-12
    axes.set_ylim(low - margin, high + margin)


def _finished(figure: Figure) -> Figure:
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
        axes.set_axisbelow(True)
    return figure
