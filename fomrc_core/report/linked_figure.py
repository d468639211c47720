"""A figure of several panels one can zoom and brush: samples marked in one panel are marked in all of them.

Drawn by BokehJS, which the page carries with it; where Bokeh is not installed there is no such figure, and the page
says so. What a visitor does with it (record, dark mode, spectrum of what is marked) is templates/page.js.
"""

from __future__ import annotations

import html
import itertools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.pulse import beat
from fomrc_core.report.sample_table import SampleTable

# On light and on dark ground; each at least 3 to 1 against its ground.
PALETTE = {
    "before": ("#c5384a", "#ff8593"),
    "after": ("#1f6f8b", "#58c4e6"),
    "measured": ("#333333", "#dddddd"),
}
_TOOLS = "box_select,box_zoom,pan"  # to show all again is one button for all panels
_HEIGHT = 290
_WIDE_RATIO = 20.0


@dataclass(frozen=True)
class Curve:
    """A column to be drawn: its name in the table, what it is called and its colour in ``PALETTE``."""

    column: str
    label: str
    colour: str


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes:
        title: what it shows.
        column: what it is drawn against, a column of the table; ``frequency`` for a spectrum.
        x_label: with unit.
        y_label: with unit.
        curves: what is drawn.
        description: what can be read from it, instead of the picture.
    """

    title: str
    column: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    description: str


def linked_figure(table: SampleTable, panels: Sequence[Panel], first: int | None = None) -> str:
    """Return the panels as HTML with all they need, a sentence where Bokeh is not installed.

    Args:
        table: the samples.
        panels: those against columns of the table; one may be a spectrum.
        first: number of the record shown at first; None for all.
    """
    bundle = _bundle()
    if bundle is None:
        return (
            "<p class='small'>No figure to zoom: Bokeh is not installed where this page was made "
            "(<code>pip install bokeh</code>, then make the page again).</p>"
        )
    from bokeh.embed import components

    script, roots = components(_plots(table, panels, first), wrap_script=False, wrap_plot_info=False)
    config = json.dumps(
        {"palette": PALETTE, "records": list(table.names), "spectra": list(table.spectra), "first": first},
        separators=(",", ":"),
    )
    cells = [_cell(k, panel, root) for k, (panel, root) in enumerate(zip(panels, roots, strict=True))]
    text = "\n".join(
        [
            f"<p class='small'>Drag over a panel to mark samples: the same samples are marked in every panel, and the "
            f"spectrum becomes that of the stretches they lie in. {html.escape(table.thinning)}</p>",
            _controls(table.names, first),
            f"<div class='panels'>{''.join(cells)}</div>",
            "<script type='application/json' id='linked-figure'>" + config.replace("</", "<\\u002f") + "</script>",
            "<script>" + bundle + "</script>",
            "<script>" + script.replace("</", "<\\u002f") + "</script>",
            "<script>" + files("fomrc_core.report").joinpath("templates/page.js").read_text("utf-8") + "</script>",
        ]
    )
    return _with_own_names(text)


def _controls(names: Sequence[str], first: int | None) -> str:
    options = [f"<option value='all'{' selected' if first is None else ''}>all records</option>"]
    options += [
        f"<option value='{k}'{' selected' if k == first else ''}>{html.escape(name)}</option>"
        for k, name in enumerate(names)
    ]
    choice = f"<label>Record <select id='record'>{''.join(options)}</select></label> " if len(names) > 1 else ""
    return (
        f"<p class='controls'>{choice}<button type='button' id='reset'>Show all again</button> "
        "<span id='marked' role='status'></span></p>"
    )


def _cell(number: int, panel: Panel, root: Any) -> str:
    keys = ", ".join(
        f"<span class='key {curve.colour}' aria-hidden='true'></span>{html.escape(curve.label)}"
        for curve in panel.curves
    )
    return (
        f"<figure class='panel' aria-labelledby='t{number}' aria-describedby='d{number}'>"
        f"<h3 id='t{number}'>{html.escape(panel.title)}</h3><p class='keys'>{keys}</p>"
        f"<div class='plot' id='{root.elementid}' data-root-id='{root.id}'></div>"
        f"<figcaption id='d{number}'>{html.escape(panel.description)}</figcaption></figure>"
    )


def _plots(table: SampleTable, panels: Sequence[Panel], first: int | None) -> list[Any]:
    from bokeh.models import CDSView, ColumnDataSource, IndexFilter

    records = table.columns["record"]
    columns = {name: np.asarray(values, dtype=np.float32) for name, values in table.columns.items()}
    speeds, linear_v_per_s = _compressed(table.columns["rate"])
    source = ColumnDataSource(columns | {"rate": speeds}, name="samples")
    shown = np.arange(records.size) if first is None else np.flatnonzero(records == first)
    view = CDSView(filter=IndexFilter(indices=shown.tolist(), name="shown"))
    spectrum = ColumnDataSource(_spectrum_columns(table, panels, first), name="spectrum")
    plots: list[Any] = []
    ranges: dict[str, Any] = {}
    for panel in panels:
        is_spectrum = panel.column == "frequency"
        beat("panels")
        plot = _empty_plot(panel)
        if not is_spectrum:
            # What has one name and unit has one range: a curve is as large in every panel.
            plot.y_range = ranges.setdefault(panel.y_label, plot.y_range)
        for curve in panel.curves:
            colour = PALETTE[curve.colour][0]
            if is_spectrum:
                plot.line("frequency", curve.column, source=spectrum, color=colour, line_width=1.6, name=curve.colour)
                continue
            style = {"size": 3.0, "color": colour, "line_color": None, "name": curve.colour}
            alphas = {"fill_alpha": 0.55, "nonselection_fill_alpha": 0.04, "selection_fill_alpha": 0.9}
            plot.scatter(panel.column, curve.column, source=source, view=view, **style, **alphas)
        if panel.column == "rate" and linear_v_per_s > 0.0:
            _label_rates(plot, panel.x_label, table.columns["rate"], linear_v_per_s)
        plots.append(plot)
    return plots


def _empty_plot(panel: Panel) -> Any:
    from bokeh.models import FixedTicker
    from bokeh.plotting import figure

    axes = {"x_axis_type": "log", "y_axis_type": "log"} if panel.column == "frequency" else {}
    tools = _TOOLS.removeprefix("box_select,") if panel.column == "frequency" else _TOOLS
    plot = figure(
        height=_HEIGHT,
        sizing_mode="stretch_width",
        tools=tools,
        toolbar_location="above",
        active_drag="box_zoom" if panel.column == "frequency" else "box_select",
        active_scroll=None,
        x_axis_label=panel.x_label,
        y_axis_label=panel.y_label,
        **axes,
    )
    plot.toolbar.logo = None
    plot.background_fill_color = plot.border_fill_color = None  # that of the page, by day and by night
    plot.xaxis.axis_label_text_font_style = plot.yaxis.axis_label_text_font_style = "normal"
    if panel.column == "phase":
        plot.xaxis.ticker = FixedTicker(ticks=[0, 90, 180, 270, 360])
    return plot


def _spectrum_columns(table: SampleTable, panels: Sequence[Panel], first: int | None) -> dict[str, Array]:
    """Return frequency and amplitude density of each curve, over all stretches of the first record shown."""
    spectrum: Mapping[str, Any] = table.spectra[first or 0]
    found = {"frequency": np.asarray(spectrum["frequency"], dtype=np.float64)}
    for panel in panels:
        for curve in panel.curves if panel.column == "frequency" else ():
            powers = spectrum["power"][curve.column]
            mean = np.mean(powers, axis=0) if powers else np.empty(0)
            found[curve.column] = np.sqrt(np.maximum(mean, np.finfo(np.float64).tiny))
    return found


def _compressed(rate_v_per_s: Array) -> tuple[Array, float]:
    """Return rates, of which jumps lie far off, by their inverse hyperbolic sine; 0 where that is not needed."""
    speeds = np.abs(rate_v_per_s)
    moving = speeds[speeds > 1e-9 * float(speeds.max())]
    if not moving.size or float(moving.max()) <= _WIDE_RATIO * float(np.median(moving)):
        return rate_v_per_s, 0.0
    linear = float(np.median(moving))
    return np.arcsinh(rate_v_per_s / linear), linear


def _label_rates(plot: Any, x_label: str, rate_v_per_s: Array, linear_v_per_s: float) -> None:
    from bokeh.models import FixedTicker

    largest = float(np.max(np.abs(rate_v_per_s)))
    powers = np.arange(np.ceil(np.log10(linear_v_per_s)), np.floor(np.log10(largest)) + 1.0)
    powers = powers[:: max(1, int(np.ceil(powers.size / 3)))]
    values = [0.0, *(sign * 10.0**power for power in powers for sign in (1.0, -1.0))]
    ticks = {float(np.arcsinh(value / linear_v_per_s)): f"{value:g}".replace("-", "−") for value in values}
    plot.xaxis.ticker = FixedTicker(ticks=sorted(ticks))
    plot.xaxis.major_label_overrides = ticks
    plot.xaxis.axis_label = f"{x_label}, log beyond ±{linear_v_per_s:.2g}"


def _with_own_names(text: str) -> str:
    """Return text with the names Bokeh counts up or draws by lot numbered from one: same data, same page."""
    numbers: dict[str, str] = {}
    counter = itertools.count(1)

    def numbered(match: re.Match[str]) -> str:
        return numbers.setdefault(match[0], f"m{next(counter)}")

    head, bundle, tail = text.partition(_bundle() or "")
    names = r"(?<=[\"'])(?:p\d{4,}|[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12})(?=[\"'])"
    return re.sub(names, numbered, head) + bundle + re.sub(names, numbered, tail)


@cache
def _bundle() -> str | None:
    """Return BokehJS, None where there is no Bokeh."""
    try:
        found = files("bokeh").joinpath("server/static/js/bokeh.min.js")
        return found.read_text("utf-8").replace("</script", "<\\/script")
    except (ModuleNotFoundError, FileNotFoundError):
        return None
