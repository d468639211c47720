"""A diagnosis of several axes as files: JSON for programs, a model that runs, and a page to read."""

from __future__ import annotations

import html
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from fomrc_core.report.diagnosis_figures import png
from fomrc_core.report.diagnosis_files import write_page_and_results
from fomrc_core.report.diagnosis_names import FIGURE_NAME, MODEL_NAME
from fomrc_core.report.page_parts import document, image, prose, provenance_section, table
from fomrc_core.report.provenance import Provenance
from fomrc_core.storage.atomic import write_bytes
from fomrc_core.storage.axes_files import write_axes_model

if TYPE_CHECKING:
    from fomrc_core.diagnosis.axes import AxesDiagnosis, AxesFinding

_MEASURED, _BEFORE, _AFTER = "#9aa5b1", "#d1495b", "#1f6f8b"
_N_SMOOTH = 9  # lines of which the root mean square is drawn
_N_CHARACTERS = 90  # of a list in the table of a cause


def write_axes_report(
    diagnosis: AxesDiagnosis, directory: str | os.PathLike[str], provenance: Provenance | None = None
) -> None:
    """Write ``diagnosis.json``, ``extended_model.yaml``, ``report.html`` and its figure as PNG, the JSON last.

    Args:
        diagnosis: what was found.
        directory: existing folder; files of these names are replaced.
        provenance: where it comes from; told in page and JSON.

    Raises:
        StorageError: the folder is missing or cannot be written.
    """
    folder = Path(directory)
    figure = png(residual_figure(diagnosis))
    write_axes_model(diagnosis.extended_model, folder / MODEL_NAME, 0.01 * diagnosis.percent_after)
    write_bytes(figure, folder / FIGURE_NAME)
    results = axes_diagnosis_results(diagnosis)
    write_page_and_results(folder, results, provenance, lambda where: axes_page(diagnosis, figure, where))


def axes_diagnosis_results(diagnosis: AxesDiagnosis) -> dict[str, Any]:
    """Return a diagnosis of several axes as plain numbers, strings and lists, None where there is no number."""
    return {
        "status": diagnosis.status.value,
        "n_inputs": diagnosis.base_model.n_inputs,
        "n_outputs": diagnosis.base_model.n_outputs,
        "percent_of_rms": {
            "before": diagnosis.percent_before,
            "after": diagnosis.percent_after,
            "floor": diagnosis.percent_floor,
        },
        "outputs": [
            {"output": o + 1, "before": before, "after": after, "floor": floor}
            for o, (before, after, floor) in enumerate(diagnosis.axis_percent.tolist())
        ],
        "findings": [_finding(finding) for finding in diagnosis.findings],
        "axes": [
            {
                "axis": axis.axis,
                "status": axis.diagnosis.status.value,
                "findings": [
                    {"cause": f.cause, "parameters": dict(f.parameters), "probability": f.probability}
                    for f in axis.diagnosis.findings
                ],
            }
            for axis in diagnosis.axes
        ],
        "axes_not_asked": list(diagnosis.not_asked),
        "doubts": list(diagnosis.doubts),
        "unexplained_percent": 100.0 * diagnosis.judgement.unexplained_share,
        "probability_of_unknown": diagnosis.probability_of_unknown,
        "remainder": {"is_noise": diagnosis.judgement.is_noise, "reasons": list(diagnosis.judgement.reasons)},
        "next_experiment": diagnosis.next_experiment,
        "records": [
            {"name": r.name, "n_samples": r.n_samples, "level_v": r.level_v, "is_periodic": r.is_periodic}
            for r in diagnosis.records
        ],
    }


def _finding(finding: AxesFinding) -> dict[str, Any]:
    return {
        "cause": finding.cause,
        "kind": finding.kind,
        "parameters": dict(finding.parameters),
        "percent_before": finding.percent_before,
        "percent_after": finding.percent_after,
        "gain": finding.gain,
        "p_value": finding.p_value,
        "margin": finding.margin if math.isfinite(finding.margin) else None,
        "ambiguous_with": list(finding.tied),
        "probability": finding.probability,
        "evidence": finding.evidence,
        "meaning": finding.meaning,
    }


def residual_figure(diagnosis: AxesDiagnosis) -> Figure:
    """Return displacement and residuals before and after over frequency, a panel for each output, all records."""
    n_out = diagnosis.base_model.n_outputs
    figure = Figure(figsize=(8.0, 2.3 * n_out), layout="constrained")
    panels = figure.subplots(n_out, 1, sharex=True, squeeze=False)[:, 0]
    n = min(record.n_samples for record in diagnosis.records)
    hz = np.fft.rfftfreq(n, 1.0 / diagnosis.records[0].rate_hz)[1:]
    curves = {"displacement": np.zeros((n_out, hz.size)), "model": np.zeros((n_out, hz.size))}
    curves["with what was found"] = np.zeros((n_out, hz.size))
    for record in diagnosis.records:
        series = (
            record.displacement_um,
            record.residual_um(diagnosis.base_model),
            record.residual_um(diagnosis.extended_model),
        )
        for power, values in zip(curves.values(), series, strict=True):
            power += (np.abs(np.fft.rfft(values[:n] / record.scale_um, axis=0)[1:]).T * (np.sqrt(2.0) / n)) ** 2
    smooth = np.ones(_N_SMOOTH) / _N_SMOOTH
    for o, axes in enumerate(panels):
        for (name, power), colour in zip(curves.items(), (_MEASURED, _BEFORE, _AFTER), strict=True):
            mean = np.convolve(power[o] / len(diagnosis.records), smooth, mode="same")
            label = name if name == "displacement" else f"residual, {name}"
            axes.loglog(hz, np.sqrt(np.maximum(mean, 1e-24)), color=colour, lw=0.9, label=label)
        axes.set_ylabel(f"output {o + 1}, of rms")
        axes.grid(alpha=0.3)
    panels[-1].set_xlabel("frequency [Hz]")
    panels[0].legend(loc="best", fontsize=7)
    return figure


def axes_page(diagnosis: AxesDiagnosis, figure: bytes, provenance: Provenance | None = None) -> str:
    """Return the page.

    Args:
        diagnosis: what was found.
        figure: PNG image of the residuals.
        provenance: where the diagnosis comes from; the page says nothing of it where not given.
    """
    status = diagnosis.status.value.replace("_", " ")
    rows = (
        (str(o + 1), f"{before:.3g} %", f"{after:.3g} %", f"{floor:.3g} %")
        for o, (before, after, floor) in enumerate(diagnosis.axis_percent.tolist())
    )
    parts = [
        f"<h1>Diagnosis of {diagnosis.base_model.n_outputs} axes: {html.escape(status)}</h1>",
        f"<div class='verdict{'' if diagnosis.judgement.is_noise else ' warn'}'>Held-out error "
        f"<b>{diagnosis.percent_before:.3g} % → {diagnosis.percent_after:.3g} %</b> of the displacements' rms; "
        f"floor {diagnosis.percent_floor:.3g} %.<br>Next: {prose(diagnosis.next_experiment)}.</div>",
        "<h2>Where it is wrong</h2>",
        image(figure, "Displacement and what models leave of it over frequency, a panel for each output."),
        table("Error on held-out samples", ("output", "model", "with what was found", "floor"), rows),
        "<h2>Why, and what naming the cause gains</h2>",
        *(_cause(number, finding) for number, finding in enumerate(diagnosis.findings, 1)),
    ]
    if not diagnosis.findings:
        parts.append("<p>No cause of several axes was accepted.</p>")
    parts += [f"<p>{prose(line)}</p>" for axis in diagnosis.axes for line in str(axis).splitlines()]
    if diagnosis.not_asked:
        axes = ", ".join(map(str, diagnosis.not_asked))
        parts.append(f"<p>Not asked for one-axis causes, as what is left is at the modes: axis {axes}.</p>")
    parts += ["<h2>What remains</h2>", *_remains(diagnosis), *provenance_section(provenance)]
    return document(f"Diagnosis of several axes: {status}", parts)


def _cause(number: int, finding: AxesFinding) -> str:
    kind = f", {html.escape(finding.kind)}" if finding.kind else ""
    tied = f" It could as well be {html.escape(', '.join(finding.tied))}." if finding.tied else ""
    return (
        f"<div class='cause'><h3>{number}. <code>{html.escape(finding.cause)}</code>{kind}</h3>"
        f"<p>{prose(finding.meaning)}{tied}</p>"
        + table(f"Parameters of {finding.cause}", ("parameter", "value"), _parameters(finding.parameters))
        + f"<p>Held-out error <b>{finding.percent_before:.4g} % → {finding.percent_after:.4g} %</b>; "
        f"p = {finding.p_value:.1e}. Probability that this is the cause: <b>{100.0 * finding.probability:.0f} %</b>."
        f"</p><p class='small'>Evidence: {prose(finding.evidence)}.<br>Best seen with: {prose(finding.experiment)}."
        "</p></div>"
    )


def _parameters(parameters: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, value in parameters.items():
        shown = (
            ", ".join(f"{v:.5g}" for v in value)
            if isinstance(value, list)
            else (value if isinstance(value, str) else f"{value:.5g}")
        )
        yield f"<code>{html.escape(name)}</code>", html.escape(shown[:_N_CHARACTERS])


def _remains(diagnosis: AxesDiagnosis) -> Iterator[str]:
    unexplained, unknown = 100.0 * diagnosis.judgement.unexplained_share, 100.0 * diagnosis.probability_of_unknown
    yield f"<p>{unexplained:.3g} % of the power the model left above the floor is still there.</p>"
    for doubt in diagnosis.doubts:
        yield f"<p>Doubt: {prose(doubt)}.</p>"
    yield f"<p>Probability of something that is not in the library: {unknown:.0f} %.</p>"
