"""Figures 15 and 16 of the paper, as the demo measured them."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from fomrc_core.compute.arrays import Array
from fomrc_ros.demo.response import Response, percent_or_not

_WITH, _WITHOUT, _WANTED = "#0a6ebd", "#c8553d", "#333333"
_GAP_S = 0.1  # without a sample: a line over it would show what nobody measured


def curves(response: Response) -> tuple[Array, Array, Array]:
    """Return time [s], desired and measured displacement [um], not a number where samples are missing for long."""
    gaps = np.flatnonzero(np.diff(response.time_s) > _GAP_S) + 1
    values = (response.time_s, response.desired_um, response.measured_um)
    time_s, desired_um, measured_um = (np.insert(v, gaps, np.nan) for v in values)
    return time_s, desired_um, measured_um


def draw_tracking(top: Axes, bottom: Axes, compensated: Response, uncompensated: Response) -> None:
    """Draw displacement and error against time, figure 15."""
    time_s, desired_um, measured_um = curves(compensated)
    without_s, _, without_um = curves(uncompensated)
    top.plot(time_s, desired_um, color=_WANTED, lw=2.5, alpha=0.35, label="desired")
    top.plot(without_s, without_um, color=_WITHOUT, lw=1.0, label="without compensation")
    top.plot(time_s, measured_um, color=_WITH, lw=1.0, label="with compensation")
    top.set_ylabel("displacement [um]")
    top.legend(loc="upper right", fontsize=8, frameon=False)
    for response, color in ((uncompensated, _WITHOUT), (compensated, _WITH)):
        time_s, desired_um, measured_um = curves(response)
        merit = f"NRMSE {percent_or_not(response.nrmse_percent)}"
        bottom.plot(time_s, 1e3 * (measured_um - desired_um), color=color, lw=0.8, label=merit)
    bottom.set_xlabel("time [s]")
    bottom.set_ylabel("error [nm]")
    bottom.legend(loc="upper right", fontsize=8, frameon=False)


def draw_linearity(axes: Axes, compensated: Response, uncompensated: Response) -> None:
    """Draw measured against desired displacement, figure 16."""
    for response, color, label in (
        (uncompensated, _WITHOUT, "without"),
        (compensated, _WITH, "with"),
    ):
        _, desired_um, measured_um = curves(response)
        axes.plot(
            desired_um,
            measured_um,
            color=color,
            lw=0.9,
            label=f"{label} compensation: nonlinearity {percent_or_not(response.nonlinearity_percent)}",
        )
    axes.set_xlabel("desired displacement [um]")
    axes.set_ylabel("measured displacement [um]")
    axes.legend(loc="upper left", fontsize=8, frameon=False)


def save_figures(tracking: tuple[Response, Response], triangle: tuple[Response, Response], folder: Path) -> list[Path]:
    """Save both figures, and the two side by side as one picture; each pair is with, without compensation."""
    paths = [folder / "figure_15_tracking.png", folder / "figure_16_linearity.png", folder / "demo.png"]
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
    draw_tracking(top, bottom, *tracking)
    figure.savefig(paths[0], dpi=120)
    plt.close(figure)
    figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
    draw_linearity(axes, *triangle)
    figure.savefig(paths[1], dpi=120)
    plt.close(figure)
    figure = plt.figure(figsize=(12, 5), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(3, 2))
    top = figure.add_subplot(grid[0, 0])
    draw_tracking(top, figure.add_subplot(grid[1, 0], sharex=top), *tracking)
    draw_linearity(figure.add_subplot(grid[:, 1]), *triangle)
    figure.savefig(paths[2], dpi=100)
    plt.close(figure)
    return paths
