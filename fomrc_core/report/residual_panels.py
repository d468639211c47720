"""The panels of a residual: against time, drive, rate, displacement and place in the loop, and its spectrum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.pulse import beat
from fomrc_core.records.drive import is_settled
from fomrc_core.records.residual import rms
from fomrc_core.report.linked_figure import Curve, Panel, linked_figure
from fomrc_core.report.quantities import number
from fomrc_core.report.residual_views import binned, loop_phase_deg, rate_v_per_s
from fomrc_core.report.sample_table import SampledRecord, SampleTable, sample_table

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis

_NM_BELOW_UM = 0.5  # rms, above which residuals read better in um

Against = Callable[[SampledRecord], Array | None]
_PLACES: tuple[tuple[str, str, str, Against], ...] = (
    ("voltage", "drive", "voltage [V]", lambda r: r.voltage_v),
    ("rate", "rate", "rate [V/s]", lambda r: rate_v_per_s(r.time_s, r.voltage_v)),
    ("displacement", "displacement", "displacement [µm]", lambda r: r.displacement_um),
    ("phase", "place in the loop", "place in the loop [°], up, then down", lambda r: loop_phase_deg(r.voltage_v)),
)


def diagnosis_figure(diagnosis: Diagnosis, first: str) -> str:
    """Return the residual of all records, before and after, as a figure to be zoomed and brushed.

    Args:
        diagnosis: what was found.
        first: name of the record to be shown at first.
    """
    curves = [Curve("before", "base model", "before")]
    if diagnosis.findings or diagnosis.stand_ins or diagnosis.unnamed is not None:
        curves.append(Curve("after", "with what was found", "after"))
    records = [
        SampledRecord(
            view.name,
            view.time_s,
            view.voltage_v,
            view.measured_um,
            {c.column: getattr(view, f"residual_{c.column}_um") for c in curves},
            is_settled(view.time_s, view.voltage_v),
        )
        for view in diagnosis.records
    ]
    names = [record.name for record in records]
    return residual_figure(records, tuple(curves), "residual", names.index(first) if first in names else 0)


def residual_figure(
    records: Sequence[SampledRecord],
    curves: tuple[Curve, ...],
    name: str,
    first: int | None = None,
    before: Sequence[Panel] = (),
) -> str:
    """Return what is left of records as six panels.

    Args:
        records: one or more, with these curves [um].
        curves: what to draw.
        name: what the curves are: residual, difference.
        first: number of the record shown at first; None for all.
        before: panels that stand before these.
    """
    is_small = max(rms(values) for record in records for values in record.curves_um.values()) < _NM_BELOW_UM
    scale, unit = (1e3, "nm") if is_small else (1.0, "µm")
    table = sample_table(records, scale)
    y_label = f"{name} [{unit}]"
    title = name.capitalize()
    several = "all records" if len(records) > 1 else "the whole record"
    sizes = "; ".join(f"{c.label}: {number(scale * _rms_of(records, c), 3)} {unit} rms" for c in curves)
    panels = [*before, Panel(f"{title} against time", "time", "time [s]", y_label, curves, f"Over {several}: {sizes}.")]
    for column, what, x_label, against in _PLACES:
        beat("panels", 0)
        shares = [(curve, _share(records, against, curve)) for curve in curves]
        told = "; ".join(f"{c.label}: {100.0 * s:.0f} %" for c, s in shares if np.isfinite(s))
        description = f"Share of its power that follows from this alone, {told}." if told else "Nothing is known of it."
        panels.append(Panel(f"{title} against {what}", column, x_label, y_label, curves, description))
    panels.append(
        Panel(
            f"Spectrum of the {name}",
            "frequency",
            "frequency [Hz]",
            f"{name} [{unit}/√Hz]",
            curves,
            _spectrum_words(table, curves, first or 0),
        )
    )
    return linked_figure(table, panels, first)


def _rms_of(records: Sequence[SampledRecord], curve: Curve) -> float:
    return rms(np.concatenate([_shown(record, record.curves_um[curve.column]) for record in records]))


def _shown(record: SampledRecord, values: Array) -> Array:
    kept = values if record.is_shown is None else values[record.is_shown]
    return kept if kept.size else values


def _share(records: Sequence[SampledRecord], against: Against, curve: Curve) -> float:
    """Return the share of a curve's power that its means in bins of something else hold, nan where there are none."""
    places, values = [], []
    for record in records:
        place = against(record)
        if place is not None:
            places.append(_shown(record, place))
            values.append(_shown(record, record.curves_um[curve.column]))
    if not places:
        return float("nan")
    bins = binned(np.concatenate(places), np.concatenate(values), by_rank=True)
    power = float(np.sum(bins.counts * (bins.means**2 + bins.spreads**2)))
    return float(np.sum(bins.counts * bins.means**2)) / power if power > 0.0 else float("nan")


def _spectrum_words(table: SampleTable, curves: Sequence[Curve], index: int) -> str:
    spectrum = table.spectra[index]
    if not spectrum["frequency"]:
        return "Too few samples for a spectrum."
    peaks = []
    for curve in curves:
        mean = np.mean(spectrum["power"][curve.column], axis=0)
        peaks.append(f"{curve.label}: at {number(spectrum['frequency'][int(np.argmax(mean))], 3)} Hz")
    return f"{table.names[index]}; largest, {'; '.join(peaks)}."
