"""The picture of ``fomrc demo --fast``: each raster's course and what it is off by, and the errors over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from fomrc_ros.demo.fast_scans import Scan

_COLOURS = ("#c8553d", "#e0a030", "#0a6ebd", "#2a8a57")
_WANTED = "#333333"


def save_figure(found: Mapping[str, Mapping[float, Scan]], path: Path) -> None:
    """Save the picture of rasters, by way of driving and frequency [Hz]."""
    frequencies = list(next(iter(found.values())))
    figure = plt.figure(figsize=(15, 8.5), layout="constrained")
    grid = figure.add_gridspec(3, len(frequencies), height_ratios=(3, 3, 4))
    for column, frequency_hz in enumerate(frequencies):
        course = figure.add_subplot(grid[0, column])
        error = figure.add_subplot(grid[1, column], sharex=course)
        _draw_raster(course, error, {name: scans[frequency_hz] for name, scans in found.items()})
        course.set_title(f"{frequency_hz:g} Hz", fontsize=11)
        course.tick_params(labelbottom=False)
        if column == 0:
            course.set_ylabel("displacement [um]")
            error.set_ylabel("error [nm]")
    _draw_errors(figure.add_subplot(grid[2, :]), found, frequencies)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw_raster(course: Axes, error: Axes, scans: Mapping[str, Scan]) -> None:
    first = next(iter(scans.values()))
    course.plot(1e3 * first.time_s, first.desired_um, color=_WANTED, lw=3.0, alpha=0.3)
    largest_nm = []
    for scan, colour in zip(scans.values(), _COLOURS, strict=True):
        course.plot(1e3 * scan.time_s, scan.measured_um, color=colour, lw=1.0)
        off_nm = 1e3 * (scan.measured_um - scan.desired_um)
        error.plot(1e3 * scan.time_s, off_nm, color=colour, lw=1.0)
        largest_nm.append(float(abs(off_nm).max()))
    # What is compensated fills the panel; what is not leaves it.
    reach_nm = 1.1 * sorted(largest_nm)[-2]
    error.set_ylim(-reach_nm, reach_nm)
    error.set_xlabel("time [ms]")


def _draw_errors(axes: Axes, found: Mapping[str, Mapping[float, Scan]], frequencies: list[float]) -> None:
    for (name, scans), colour in zip(found.items(), _COLOURS, strict=True):
        percent = [scans[frequency_hz].percent for frequency_hz in frequencies]
        axes.plot(frequencies, percent, "o-", color=colour, label=name)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(frequencies, [f"{frequency_hz:g}" for frequency_hz in frequencies])
    axes.minorticks_off()
    axes.set_xlabel("raster frequency [Hz]")
    axes.set_ylabel("NRMSE [% of the range]")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, ncols=2)
