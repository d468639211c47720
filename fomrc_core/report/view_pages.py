"""Pages to look at what one has: a recording, a model, two models beside each other, models on a recording."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.cause import Cause
from fomrc_core.errors import RecordingError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.record_start import estimate_start, simulate_from
from fomrc_core.records.excitation import concatenate, steps, triangle
from fomrc_core.records.plausibility import summary_line, suspicions
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import normalised_percent, nrmse_percent, rms
from fomrc_core.report.linked_figure import Curve, Panel
from fomrc_core.report.page_parts import document, prose, provenance_section, table
from fomrc_core.report.provenance import Provenance
from fomrc_core.report.quantities import length, number, quantity
from fomrc_core.report.residual_panels import residual_figure
from fomrc_core.report.sample_table import SampledRecord

_MEASURED = Curve("displacement", "measured", "measured")
_COLOURS = ("before", "after")
_MODEL_COLUMNS = ("first", "second")
# Of the drive models are shown on: four falling cycles at 1 Hz, then a step and a rest.
_RATE_HZ, _N_CYCLES, _REST_S = 500.0, 4, 10.0
_SLIPPING = 4.0  # times the largest saturation voltage: the drive turns with every element slipping
_WITHOUT_ELEMENTS_V = 1.0
_NONLINEARITY = "Nonlinearity is the displacement less the straight line through it over the drive"


def recording_page(recording: Recording, provenance: Provenance | None = None) -> str:
    """Return the page of a recording: what it holds, what is wrong with it, and the loop it draws.

    Raises:
        RecordingError: it has no displacement.
    """
    _needs_displacement(recording)
    quality = examine(recording).quality
    wrong = [*suspicions(recording), *(str(fault) for fault in quality.faults)]
    told = f"{prose(summary_line(recording))}; {recording.n_samples} samples"
    body = [
        f"<h1>Recording {html.escape(recording.name)}</h1>",
        f"<p class='verdict{' warn' if wrong else ''}'>{told}.</p>",
        "<h2>Data quality</h2>",
        "<ul>" + "".join(f"<li>{prose(text)}</li>" for text in wrong) + "</ul>"
        if wrong
        else "<p>No spike, dropout, stuck reading or gap was found.</p>",
        "<h2>What it shows</h2>",
        f"<p>{_NONLINEARITY}: hysteresis, creep and all else that is not in proportion to the voltage.</p>",
        _nonlinearity_figure(recording, recording.measured_um, _MEASURED),
        *provenance_section(provenance),
    ]
    return document(f"Recording {recording.name}", body)


def model_page(
    name: str, model: PiezoModel, largest_v: float | None = None, provenance: Provenance | None = None
) -> str:
    """Return the page of a model: its parameters, and what it does on a drive.

    Args:
        name: of the model.
        model: the actuator.
        largest_v: largest voltage of the drive [V]; enough for every element to slip where not given.
        provenance: where the page comes from.
    """
    drive = _drive((model,), largest_v)
    moved_um = model.simulate(drive.steps_s, drive.voltage_v)
    notes = [f"<li><code>{html.escape(c.name)}</code>: {prose(c.inverse_note)}</li>" for c in model.causes]
    body = [
        f"<h1>Model {html.escape(name)}</h1>",
        f"<p class='verdict'>{prose(str(model).splitlines()[0])}, {_gain(model)} at a turning point.</p>",
        "<h2>Parameters</h2>",
        _parameters({name: model}),
        _elements(model),
        "<h2>What it does</h2>",
        f"<p>{_drive_words(drive)} {_NONLINEARITY}.</p>",
        _nonlinearity_figure(drive, moved_um, Curve("displacement", "simulated", "after")),
        *(["<h2>What the compensator does with it</h2>", f"<ul>{''.join(notes)}</ul>"] if notes else []),
        *provenance_section(provenance),
    ]
    return document(f"Model {name}", body)


def comparison_page(
    models: Mapping[str, PiezoModel], largest_v: float | None = None, provenance: Provenance | None = None
) -> str:
    """Return the page of two models: their parameters beside each other, and by how much they differ on one drive.

    Args:
        models: two of them, by name.
        largest_v: largest voltage of the drive [V]; enough for every element of both to slip where not given.
        provenance: where the page comes from.
    """
    drive = _drive(tuple(models.values()), largest_v)
    moved_um = [model.simulate(drive.steps_s, drive.voltage_v) for model in models.values()]
    names = tuple(models)
    difference_um = moved_um[1] - moved_um[0]
    percent = normalised_percent(rms(difference_um), [moved_um[0]])
    largest = length(float(np.max(np.abs(difference_um))))
    record = SampledRecord(
        "drive",
        drive.time_s,
        drive.voltage_v,
        moved_um[0],
        {"difference": difference_um},
        beside_um=dict(zip(_MODEL_COLUMNS, moved_um, strict=True)),
    )
    curves = tuple(Curve(c, n, k) for c, n, k in zip(_MODEL_COLUMNS, names, _COLOURS, strict=True))
    curve = Curve("difference", f"{names[1]} less {names[0]}", "measured")
    title = f"Models {names[0]} and {names[1]}"
    body = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p class='verdict'>On the drive below they differ by {length(rms(difference_um))} rms, "
        f"{number(percent, 3)} % of the range of {html.escape(names[0])}; at most by {largest}.</p>",
        "<h2>Parameters</h2>",
        _parameters(models),
        "<h2>Where they differ</h2>",
        f"<p>{_drive_words(drive)}</p>",
        residual_figure([record], (curve,), "difference", 0, _loops(curves, moved_um[0])),
        *provenance_section(provenance),
    ]
    return document(title, body)


def residual_page(models: Mapping[str, PiezoModel], recording: Recording, provenance: Provenance | None = None) -> str:
    """Return the page of one or two models on a recording: what each leaves of it.

    Args:
        models: one or two, by name.
        recording: with displacement.
        provenance: where the page comes from.

    Raises:
        RecordingError: it has no displacement.
    """
    _needs_displacement(recording)
    left_um, simulated_um, rows = {}, {}, []
    for column, (name, model) in zip(_MODEL_COLUMNS, models.items(), strict=False):
        start = estimate_start(model, recording)
        moved_um = simulate_from(model, recording, start)
        error_um = recording.measured_um - moved_um
        left_um[column], simulated_um[f"simulated_{column}"] = error_um, moved_um
        share = (
            f"{number(nrmse_percent(recording.measured_um, moved_um), 3)} %" if np.ptp(recording.measured_um) else "–"
        )
        rows.append((f"<code>{html.escape(name)}</code>", length(rms(error_um)), share, prose(start.description)))
    record = SampledRecord(
        recording.name, recording.time_s, recording.voltage_v, recording.measured_um, left_um, beside_um=simulated_um
    )
    keys = list(zip(models, left_um, _COLOURS, strict=False))
    curves = tuple(Curve(column, name, colour) for name, column, colour in keys)
    drawn = (_MEASURED, *(Curve(f"simulated_{column}", name, colour) for name, column, colour in keys))
    title = f"{' and '.join(models)} on {recording.name}"
    body = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{prose(summary_line(recording))}; {recording.n_samples} samples. The offset and how the record begins "
        "were estimated from its first samples; nothing else was fitted to it here.</p>",
        table("What is left", ("model", "error, rms", "% of the range", "taken to begin"), rows),
        "<h2>Where it is wrong</h2>",
        residual_figure([record], curves, "residual", 0, _loops(drawn, recording.measured_um)),
        "<h2>Parameters</h2>",
        _parameters(models),
        *provenance_section(provenance),
    ]
    return document(title, body)


def _needs_displacement(recording: Recording) -> None:
    if recording.displacement_um is None:
        raise RecordingError("has no displacement", where=recording.name, allowed="voltage and displacement")


def _drive(models: Sequence[PiezoModel], largest_v: float | None) -> Recording:
    saturation_v = max((float(m.saturation_v.max()) for m in models if m.n_elements), default=0.0)
    amplitude_v = largest_v or _SLIPPING * saturation_v or _WITHOUT_ELEMENTS_V
    # the slope makes the first cycle, there and back on both sides, last a second
    loops = triangle(amplitude_v, slope_v_per_s=4.0 * amplitude_v, n_cycles=_N_CYCLES, rate_hz=_RATE_HZ)
    rest = steps((0.5 * amplitude_v,), dwell_s=_REST_S, rate_hz=_RATE_HZ)
    return concatenate(loops, rest).to_recording()


def _drive_words(drive: Recording) -> str:
    largest_v = quantity(float(np.max(drive.voltage_v)), "V", n_digits=3)
    return (
        f"Simulated from rest: {_N_CYCLES} falling cycles of up to ±{largest_v}, then a step to half of it and "
        f"{number(_REST_S)} s of creep. <code>--max-voltage</code> chooses another."
    )


def _nonlinearity_figure(drive: Recording, moved_um: Array, curve: Curve) -> str:
    voltage_v = drive.voltage_v - float(np.mean(drive.voltage_v))
    power = float(np.sum(voltage_v**2))
    slope = float(np.sum(voltage_v * moved_um)) / power if power > 0.0 else 0.0
    left_um = moved_um - float(np.mean(moved_um)) - slope * voltage_v
    name = drive.name or "drive"
    record = SampledRecord(name, drive.time_s, drive.voltage_v, moved_um, {"left": left_um})
    drive_panel = Panel(
        "Drive against time",
        "time",
        "time [s]",
        "voltage [V]",
        (Curve("voltage", "voltage", "measured"),),
        f"From {number(float(drive.voltage_v.min()))} to {number(float(drive.voltage_v.max()))} V "
        f"in {number(drive.duration_s)} s.",
    )
    curves = (Curve("left", f"{curve.label}, less a straight line", curve.colour),)
    return residual_figure([record], curves, "nonlinearity", 0, [drive_panel, *_loops((curve,), moved_um)])


def _loops(curves: tuple[Curve, ...], moved_um: Array) -> list[Panel]:
    """Return displacement against time and against the drive."""
    range_um = length(float(np.ptp(moved_um)))
    words = f"The displacement ranges over {range_um}."
    labels = ("time", "time [s]"), ("voltage", "voltage [V]")
    titles = ("Displacement against time", "Displacement against drive: the loop")
    return [
        Panel(title, column, label, "displacement [µm]", curves, words)
        for title, (column, label) in zip(titles, labels, strict=True)
    ]


def _gain(model: PiezoModel) -> str:
    return quantity(model.play_form.slope, "um/V")


def _parameters(models: Mapping[str, PiezoModel]) -> str:
    rows: dict[str, list[str]] = {}
    for k, model in enumerate(models.values()):
        for name, value in _parameters_of(model):
            rows.setdefault(name, [""] * len(models))[k] = value
    cells = ((_name(name), *map(html.escape, values)) for name, values in rows.items())
    return table("Parameters", ("parameter", *models), cells)


def _name(text: str) -> str:
    return html.escape(text) if " " in text else f"<code>{html.escape(text)}</code>"


def _parameters_of(model: PiezoModel) -> Iterator[tuple[str, str]]:
    yield "elements", str(model.n_elements)
    yield "creep_order", number(model.creep_order)
    yield "gain at a turning point", _gain(model)
    if model.n_elements:
        yield "gain once all elements slip", quantity(float(model.kappa_um_per_v[-1]), "um/V")
        for name, value in (("least", model.saturation_v.min()), ("largest", model.saturation_v.max())):
            yield f"{name} saturation voltage", quantity(float(value), "V")
    for cause in model.causes:
        yield from _cause_parameters(cause)


def _cause_parameters(cause: Cause) -> Iterator[tuple[str, str]]:
    values = cause.to_mapping()
    for spec in type(cause).parameters:
        value = values.get(spec.name)
        if isinstance(value, (int, float)):
            yield f"{cause.name}.{spec.name}", quantity(float(value), spec.unit)
        elif value is not None:
            yield f"{cause.name}.{spec.name}", f"{len(value)} values"


def _elements(model: PiezoModel) -> str:
    rows = (
        (str(k + 1), quantity(float(kappa), "um/V"), quantity(float(saturation), "V"))
        for k, (kappa, saturation) in enumerate(zip(model.kappa_um_per_v[:-1], model.saturation_v, strict=True))
    )
    return table("Elements", ("number", "gain", "saturation voltage"), rows) if model.n_elements else ""
