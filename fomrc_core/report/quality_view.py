"""What was wrong with the samples of records, for programs and for eyes."""

from __future__ import annotations

import html
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from fomrc_core.records.quality import DataQuality, FaultKind
from fomrc_core.report.page_parts import prose
from fomrc_core.report.residual_views import envelope

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis

_N_LISTED = 1000  # samples named one by one in the JSON
_MARKS = {
    FaultKind.SPIKES: "x",
    FaultKind.DROPOUTS: "v",
    FaultKind.STUCK: "_",
    FaultKind.LOST: "<",
    FaultKind.DOUBLED: ">",
}


def quality_results(quality: DataQuality) -> dict[str, Any]:
    """Return what is wrong with the samples of one record as plain numbers, strings and lists."""
    return {
        "record": quality.name,
        "n_samples": quality.n_samples,
        "n_masked": quality.n_masked,
        "faults": [
            {
                "kind": fault.kind.value,
                "n_samples": int(fault.samples.size),
                "samples": fault.samples[:_N_LISTED].tolist(),
                "first_s": float(fault.times_s[0]),
                "last_s": float(fault.times_s[-1]),
                "size": float(fault.size),
                "is_masked": fault.is_masked,
                "meaning": str(fault),
            }
            for fault in quality.faults
        ],
    }


def quality_section(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield the section of the page; nothing is wrong with most records, and one sentence says so."""
    faulty = [quality for quality in diagnosis.data_quality if quality.faults]
    for beyond in diagnosis.beyond_learned:
        yield f"<p>Beyond what was learned: {prose(str(beyond))}.</p>"
    if not faulty:
        yield "<p>No spike, dropout, stuck reading or gap was found in any record.</p>"
        return
    yield "<ul>"
    for quality in faulty:
        for fault in quality.faults:
            yield f"<li>{html.escape(quality.name)}: {prose(str(fault))}</li>"
    yield "</ul>"


def quality_figure(diagnosis: Diagnosis) -> Figure | None:
    """Return the readings of each record with some left out, those marked; None where all count."""
    shown = [(q, v) for q in diagnosis.data_quality for v in diagnosis.records if v.name == q.name and q.n_masked]
    if not shown:
        return None
    figure = Figure(figsize=(10.0, 0.6 + 1.8 * len(shown)), layout="constrained")
    for axes, (quality, view) in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
        axes.plot(*envelope(view.time_s, view.measured_um), color="#333333", lw=0.9)
        for fault in quality.faults:
            if fault.is_masked:
                # the record may have been thinned since
                place = fault.samples * (view.time_s.size - 1) / (quality.n_samples - 1)
                at = np.interp(place, np.arange(view.time_s.size), view.time_s)
                axes.plot(at, fault.readings_um, _MARKS[fault.kind], color="#d1495b", ms=5, label=fault.kind.value)
        axes.set_title(f"{view.name}: readings left out", fontsize=10)
        axes.set_ylabel("displacement [µm]")
        axes.legend(loc="upper right", ncols=3)
        axes.margins(x=0.0)
    figure.axes[-1].set_xlabel("time [s]")
    return figure
