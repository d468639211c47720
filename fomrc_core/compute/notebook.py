"""How results show themselves in a notebook: their text as HTML, their curves as a figure."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a model alone does not wait for matplotlib
    from matplotlib.figure import Figure

_COLOURS = ("#333333", "#c5384a", "#1f6f8b")
_N_DRAWN_MAX = 20_000


@dataclass(frozen=True, eq=False)
class CurvePanel:
    """Curves over one axis: a title, labels with units, x of shape (n,) and each y, by name, of the same shape."""

    title: str
    x_label: str
    y_label: str
    x: NDArray[np.float64]
    curves: Mapping[str, NDArray[np.float64]]


def shown_as_html(title: str, text: str) -> str:
    """Return the text a result prints as HTML, its lines kept."""
    return (
        f"<div><strong>{html.escape(title)}</strong>"
        f"<pre style='white-space:pre-wrap;margin:.3em 0'>{html.escape(text)}</pre></div>"
    )


def curves_figure(panels: Sequence[CurvePanel]) -> Figure:
    """Return panels beside each other; of more than 20 000 samples every second, third and so on is drawn."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0 * len(panels), 3.6), layout="constrained")
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        every = slice(None, None, max(1, panel.x.size // _N_DRAWN_MAX))
        for (name, values), colour in zip(panel.curves.items(), _COLOURS, strict=False):
            axes.plot(panel.x[every], values[every], color=colour, lw=1.0, label=name)
        axes.set_title(panel.title, fontsize=10)
        axes.set_xlabel(panel.x_label)
        axes.set_ylabel(panel.y_label)
        axes.grid(alpha=0.25)
        if len(panel.curves) > 1:
            axes.legend(fontsize=8)
    return figure
