"""Draw the pictures of the tutorial on good data: python docs/make_good_data.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from fomrc_core import read_model
from fomrc_core.records.excitation import multisine, staircase, triangle

_ROOT = Path(__file__).resolve().parents[1]
_FIGURES = Path(__file__).parent / "figures"
_BOXES = {  # what, and where in the drawing
    "converter\n(DAC)": (0.0, 1.0),
    "amplifier": (2.0, 1.0),
    "actuator\nand stage": (4.0, 1.0),
    "sensor and\nits electronics": (6.0, 1.0),
    "recorder, one clock:\ntime, voltage, displacement": (3.0, -1.0),
}


def wiring() -> Figure:
    """Return the wiring: what is recorded, and from where."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    axes = figure.subplots()
    for text, (x, y) in _BOXES.items():
        width = 3.0 if y < 0.0 else 1.4
        box = FancyBboxPatch(
            (x - 0.5 * width, y - 0.35), width, 0.7, boxstyle="round,pad=0.05", fc="#eef4f7", ec="#1f6f8b"
        )
        axes.add_patch(box)
        axes.text(x, y, text, ha="center", va="center", fontsize=9)
    arrow = {"arrowstyle": "-|>", "color": "#333333"}
    for x in (0.0, 2.0, 4.0):
        axes.annotate("", (x + 1.2, 1.0), (x + 0.8, 1.0), arrowprops=arrow)
    axes.annotate("", (2.6, -0.55), (3.0, 0.9), arrowprops=arrow)
    axes.text(2.7, 0.2, "voltage at the actuator\n(monitor output)", ha="right", fontsize=8)
    axes.annotate("", (4.2, -0.55), (6.0, 0.55), arrowprops=arrow)
    axes.text(5.4, -0.05, "displacement,\nfilter wide open", ha="left", fontsize=8, va="top")
    axes.set(xlim=(-0.9, 7.0), ylim=(-1.5, 1.6))
    axes.axis("off")
    return figure


def drives() -> Figure:
    """Return three drives, and what each of them shows."""
    figure = Figure(figsize=(9.0, 2.6), layout="constrained")
    shown = {
        "staircase: loops, and creep on each step": staircase(dwell_s=0.5, rate_hz=200.0),
        "falling triangle: loops inside of loops": triangle(slope_v_per_s=5.0, rate_hz=200.0),
        "multisine: lags and resonances": multisine(highest_hz=20.0, period_s=2.0, n_periods=2, rate_hz=500.0),
    }
    for axes, (title, drive) in zip(figure.subplots(1, 3), shown.items(), strict=True):
        record = drive.to_recording()
        axes.plot(record.time_s, record.voltage_v, lw=0.8, color="#1f6f8b")
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("time [s]")
        axes.grid(alpha=0.25)
    figure.axes[0].set_ylabel("voltage [V]")
    return figure


def faults() -> Figure:
    """Return one loop as it should be recorded, and as it should not."""
    drive = triangle(slope_v_per_s=5.0, rate_hz=200.0).to_recording()
    moved = read_model(_ROOT / "config" / "pi_p753_table1.yaml").simulate(drive.steps_s, drive.voltage_v)
    noise = np.random.default_rng(0).normal(0.0, 1e-3, moved.size)
    good = moved + noise
    step = 0.4
    at = np.array([300, 900])
    spiked = good.copy()
    spiked[at] += 1.5
    short = slice(0, 400)
    shown: dict[str, tuple[Any, Any]] = {
        "good: whole range, many loops": (drive.voltage_v, good),
        "clipped: sensor at its end": (drive.voltage_v, np.minimum(good, 1.6)),
        "coarse: sensor range far too wide": (drive.voltage_v, np.round(good / step) * step),
        "spikes: found, and left out": (drive.voltage_v, spiked),
        "one loop only: elements stay open": (drive.voltage_v[short], good[short]),
        "sign reversed: refused": (drive.voltage_v, -good),
    }
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    for axes, (title, (voltage_v, read_um)) in zip(figure.subplots(2, 3).flat, shown.items(), strict=True):
        axes.plot(voltage_v, read_um, lw=0.6, color="#1f6f8b" if title.startswith("good") else "#c5384a")
        axes.set_title(title, fontsize=9)
        axes.grid(alpha=0.25)
    figure.supxlabel("voltage [V]", fontsize=9)
    figure.supylabel("displacement [µm]", fontsize=9)
    return figure


def main() -> None:
    """Draw them into docs/figures."""
    for name, figure in (("wiring", wiring()), ("drives", drives()), ("bad_recordings", faults())):
        figure.savefig(_FIGURES / f"good_data_{name}.png", dpi=90)


if __name__ == "__main__":
    main()
