"""The paper's figures 6-9 and 11-16, drawn from the simulated plant and the model identified on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fomrc_core.records.recording import Recording
from fomrc_core.reproduction.experiments import Run, Tracking
from fomrc_core.reproduction.identified_models import Identified, StartStudy

Array = NDArray[np.float64]

PLANT, MODEL, ACCENT, MUTED = "#1f6f8b", "#d1495b", "#edae49", "#9aa5b1"
PLANT_WORD, MODEL_WORD = "plant (simulated)", "FOMRC"


def _panels(n_rows: int, n_columns: int, title: str, height: float = 3.3) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(4.9 * n_columns, height * n_rows + 0.3), layout="constrained")
    axes = list(np.ravel(figure.subplots(n_rows, n_columns)))
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    for panel in axes:
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _thin(recording: Recording, n: int = 6000) -> slice:
    return slice(None, None, max(1, recording.n_samples // n))


def figure6(runs: Sequence[Run]) -> Figure:
    """Steps normalised by the voltage, and by the displacement at 0.5 s too."""
    figure, (left, right) = _panels(1, 2, "Figure 6: creep and nonlinear gain are apart")
    for run, colour in zip(runs, _shades(len(runs)), strict=True):
        time_s, x = run.recording.time_s, run.recording.measured_um
        settled = float(np.interp(0.5, time_s, x))
        left.plot(time_s, x / run.label, color=colour, lw=0.9, label=f"{run.label:+.1f} V")
        right.plot(time_s, x / settled, color=colour, lw=0.9)
    left.set(xlabel="time [s]", ylabel="displacement / voltage [um/V]", title="(a) by the voltage")
    right.set(
        xlabel="time [s]",
        ylabel="displacement / that at 0.5 s",
        title="(b) by the gain as well",
        ylim=(0.97, 1.09),
    )
    left.legend(fontsize=7, ncols=2)
    return figure


def figure7(without: Recording, with_routine: Recording) -> Figure:
    """Displacement at zero volts with and without the relaxation routine."""
    figure, (axes,) = _panels(1, 1, "Figure 7: drift at zero input")
    for recording, colour, word in ((without, MODEL, "without"), (with_routine, PLANT, "with")):
        part = _thin(recording)
        moved = recording.measured_um - recording.measured_um[:20].mean()
        axes.plot(recording.time_s[part], 1e3 * moved[part], color=colour, lw=0.8, label=f"{word} routine")
    axes.set(xlabel="time [s]", ylabel="drift [nm]")
    axes.legend(fontsize=8)
    return figure


def figure8(without: Recording, with_routine: Recording) -> Figure:
    """Loops begun with and without the relaxation routine."""
    figure, axes = _panels(1, 2, "Figure 8: the loop starts at the origin only after the routine")
    for panel, recording, word in zip(axes, (with_routine, without), ("(a) with routine", "(b) without"), strict=True):
        u, x = recording.voltage_v, recording.measured_um
        first = int(np.argmax(u))
        panel.plot(u, x, color=PLANT, lw=0.8)
        panel.plot(u[:first], x[:first], color=MODEL, lw=2.2, label="first rise")
        panel.axhline(0.0, color=MUTED, lw=0.6)
        panel.axvline(0.0, color=MUTED, lw=0.6)
        panel.set(xlabel="voltage [V]", ylabel="displacement [um]", title=f"{word}: at 0 V {1e3 * x[0]:.0f} nm")
        panel.legend(fontsize=8)
    return figure


def figure9(found: Identified) -> Figure:
    """The data identified on."""
    figure, (left, right) = _panels(1, 2, "Figure 9: data for identification (simulated plant)")
    u, x = found.triangle.voltage_v, found.triangle.measured_um
    first = int(np.argmax(u))
    left.plot(u, x, color=PLANT, lw=0.8)
    left.plot(u[:first], x[:first], color=MODEL, lw=2.2, label="initial rising curve")
    left.set(xlabel="voltage [V]", ylabel="displacement [um]", title="(a) triangle, 1 V/s")
    left.legend(fontsize=8)
    right.plot(found.staircase.time_s, found.staircase.measured_um, color=PLANT, lw=0.8)
    right.set(xlabel="time [s]", ylabel="displacement [um]", title="(b) staircase, 0.25 V, 3 s")
    return figure


def figure11(runs: Sequence[Run]) -> Figure:
    """Steps, measured and simulated."""
    figure, axes = _panels(2, 3, "Figure 11: steps of six heights", height=2.6)
    for panel, run in zip(axes, runs, strict=True):
        part = slice(1, None, 5)
        panel.plot(run.recording.time_s[part], run.recording.measured_um[part], color=PLANT, lw=0.8, label=PLANT_WORD)
        panel.plot(run.recording.time_s[part], run.predicted_um[part], color=MODEL, lw=1.2, label=MODEL_WORD)
        panel.set(title=f"{run.label:+.1f} V: NRMSE {run.percent:.2f} %", xlabel="time [s]", ylabel="[um]")
        end = float(run.recording.measured_um[-1])
        panel.set_ylim(*sorted((0.93 * end, 1.01 * end)))
    axes[0].legend(fontsize=7)
    return figure


def figure12(loops: Sequence[tuple[float, Array, Array, Array]]) -> Figure:
    """Loops of several slopes, and where the minor loop leaves the major one.

    Args:
        loops: slope [V/s], voltage [V], displacement of the plant and of the model [um].
    """
    figure, axes = _panels(2, 2, "Figure 12: loops as the slope rises: shorter, wider for their height, clockwise")
    for slope, u, plant, model in (entry[:4] for entry in loops):
        colour = _shades(len(loops))[[entry[0] for entry in loops].index(slope)]
        for whole, zoom, x in ((axes[0], axes[2], plant), (axes[1], axes[3], model)):
            whole.plot(u, x, color=colour, lw=0.8, label=f"{slope:g} V/s")
            zoom.plot(u, x, color=colour, lw=1.0)
    for panel, word in zip(axes, (PLANT_WORD, MODEL_WORD) * 2, strict=True):
        panel.set(xlabel="voltage [V]", ylabel="displacement [um]", title=word)
    for panel in axes[2:]:
        panel.set(xlim=(0.75, 1.06), ylim=(0.62, 1.0))
        panel.set_title(panel.get_title() + ", minor loop detaching at 1 V")
    axes[0].legend(fontsize=7)
    return figure


def figure13(runs: Sequence[Run]) -> Figure:
    """Errors over normalised time."""
    figure, (left, right) = _panels(1, 2, "Figure 13: model error over time in periods of the first cycle")
    slow = [run for run in runs if run.label <= 10.0]
    for panel, chosen in ((left, slow), (right, [run for run in runs if run.label > 10.0])):
        for run, colour in zip(chosen, _shades(len(chosen)), strict=True):
            part = _thin(run.recording, 3000)
            periods = run.recording.time_s * run.label / 10.0
            panel.plot(periods[part], 1e3 * run.error_um[part], color=colour, lw=0.7, label=f"{run.label:g} V/s")
        panel.set(xlabel="time / first period", ylabel="error [nm]")
        panel.legend(fontsize=7, ncols=2)
    left.set_title("up to 10 V/s")
    right.set_title("faster: the lag of amplifier and mechanics")
    return figure


def figure14(run: Run) -> Figure:
    """Staircase: displacement and error."""
    figure, (left, right) = _panels(1, 2, f"Figure 14: staircase, NRMSE {run.percent:.3f} %")
    part = _thin(run.recording, 12000)
    left.plot(run.recording.time_s[part], run.recording.measured_um[part], color=PLANT, lw=1.0, label=PLANT_WORD)
    left.plot(run.recording.time_s[part], run.predicted_um[part], color=MODEL, lw=0.7, ls="--", label=MODEL_WORD)
    left.set(xlabel="time [s]", ylabel="displacement [um]", title="(a) displacement")
    left.legend(fontsize=8)
    right.plot(run.recording.time_s, 1e3 * run.error_um, color=PLANT, lw=0.4)
    right.set(xlabel="time [s]", ylabel="error [nm]", title="(b) error; spikes: the first milliseconds of a step")
    right.set_ylim(-60, 60)
    return figure


def figure15(run: Tracking) -> Figure:
    """Tracking with and without compensation."""
    title = f"Figure 15: tracking error {run.plain_percent:.2f} %, compensated {run.compensated_percent:.3f} %"
    figure, (left, right) = _panels(1, 2, title)
    part = _thin(run.plain)
    time_s = run.plain.time_s[part]
    left.plot(time_s, run.desired_um[part], color="black", lw=1.6, label="desired")
    left.plot(time_s, run.plain.measured_um[part], color=MODEL, lw=0.9, label="without")
    left.plot(time_s, run.compensated.measured_um[part], color=ACCENT, lw=0.9, ls="--", label="with")
    left.set(xlabel="time [s]", ylabel="displacement [um]", title="(a) displacement")
    left.legend(fontsize=8)
    right.plot(time_s, 1e3 * (run.desired_um - run.plain.measured_um)[part], color=MODEL, lw=0.8, label="without")
    right.plot(time_s, 1e3 * (run.desired_um - run.compensated.measured_um)[part], color=PLANT, lw=0.8, label="with")
    right.set(xlabel="time [s]", ylabel="error [nm]", title="(b) error")
    right.legend(fontsize=8)
    return figure


def figure16(run: Tracking) -> Figure:
    """Output against input with and without compensation."""
    title = f"Figure 16: nonlinearity {run.plain_percent:.2f} %, compensated {run.compensated_percent:.3f} %"
    figure, (left, right) = _panels(1, 2, title)
    desired = run.desired_um
    left.plot(desired, run.plain.measured_um, color=MODEL, lw=0.9, label="without")
    left.plot(desired, run.compensated.measured_um, color=PLANT, lw=1.2, label="with")
    left.set(xlabel="desired [um]", ylabel="displacement [um]")
    left.legend(fontsize=8)
    right.plot(desired, 1e3 * (run.compensated.measured_um - desired), color=PLANT, lw=0.6)
    right.set(xlabel="desired [um]", ylabel="deviation, compensated [nm]")
    return figure


def start_figure(study: StartStudy) -> Figure:
    """Where the minimiser of (34) ended from each random start, beside the convex route."""
    figure, (axes,) = _panels(1, 1, "Identification: (34) from random starts, and the convex route")
    order = np.argsort(study.paper_rms_um)
    places = np.arange(1, order.size + 1)
    axes.plot(places, 1e3 * study.start_rms_um[order], "x", color=MUTED, label="random start")
    axes.plot(places, 1e3 * study.paper_rms_um[order], "o", color=MODEL, label="where (34) ended")
    axes.axhline(1e3 * study.convex_rms_um, color=PLANT, lw=1.6, label="convex route, no start")
    axes.set(yscale="log", xlabel="start, sorted by its end", ylabel="error, rms [nm]")
    axes.set_xticks(places[::2])
    axes.legend(fontsize=8)
    return figure


def slope_figure(runs: Sequence[Run], paper: dict[float, float]) -> Figure:
    """Table 3 as a figure."""
    figure, (axes,) = _panels(1, 1, "Table 3: error against slope")
    slopes = [run.label for run in runs]
    axes.loglog(slopes, [paper[s] for s in slopes], "s--", color=MUTED, label="paper, measured stage")
    axes.loglog(slopes, [run.percent for run in runs], "o-", color=PLANT, label="simulated plant, FOMRC alone")
    axes.loglog(
        slopes,
        [run.extended_percent for run in runs],
        "o-",
        color=MODEL,
        label="simulated plant, amplifier and resonance added",
    )
    axes.set(xlabel="slope [V/s]", ylabel="NRMSE [%]")
    axes.legend(fontsize=8)
    return figure


def _shades(n: int) -> list[tuple[float, ...]]:
    from matplotlib import colormaps

    return [tuple(colormaps["viridis"](0.9 * k / max(1, n - 1))) for k in range(n)]
