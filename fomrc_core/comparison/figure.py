"""The figure of a comparison: held-out error of every model, with and without the amplifier effect."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

if TYPE_CHECKING:
    from fomrc_core.comparison.result import Comparison

_PLAIN, _AMPLIFIED, _OURS = "#9aa5b1", "#1f6f8b", "#d1495b"


def comparison_figure(comparison: Comparison) -> Figure:
    """Return bars of the held-out error per model, the best at the top."""
    rows = [row for row in comparison.rows if not row.failure]
    names: list[str] = []
    for row in rows:
        if row.name not in names:
            names.append(row.name)
    figure = Figure(figsize=(9.0, 0.42 * len(names) + 1.6), layout="constrained")
    axes = figure.add_subplot()
    longest = max(row.test_rms_um for row in rows) * 1e3
    for row in rows:
        place = names.index(row.name)
        is_amplified = not math.isnan(row.amplifier_cutoff_hz)
        has_both = sum(other.name == row.name for other in rows) > 1
        offset = (-0.19 if is_amplified else 0.19) if has_both else 0.0
        colour = _OURS if row.name.startswith("FOMRC") else (_AMPLIFIED if is_amplified else _PLAIN)
        value = 1e3 * row.test_rms_um
        axes.barh(place + offset, value, height=0.36, color=colour, alpha=1.0 if is_amplified or not has_both else 0.55)
        axes.text(value + 0.008 * longest, place + offset, f"{value:.0f}", va="center", fontsize=7)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.08 * longest)
    axes.set_xlabel("held-out error, rms [nm]")
    axes.set_title(
        f"{comparison.test_name}: upper bar with a first-order amplifier, lower bar without",
        fontsize=9,
        loc="left",
    )
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", alpha=0.3)
    return figure
