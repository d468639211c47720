"""A diagnosis as one self-contained HTML page, to be read in two minutes."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from fomrc_core.model.causes import cause_classes
from fomrc_core.report.quality_view import quality_section

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis
    from fomrc_core.diagnosis.findings import Finding

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;padding:0 1.2rem;color:#222}
h1{margin-bottom:.2rem}h2{margin-top:2.2rem;border-bottom:2px solid #eee;padding-bottom:.2rem}
table{border-collapse:collapse;font-size:14px}td,th{padding:.25rem 1.2rem .25rem 0;text-align:left;
border-bottom:1px solid #e4e4e4;vertical-align:top}td.n{text-align:right;font-variant-numeric:tabular-nums}
img{width:100%}.verdict{background:#eef5f7;border-left:5px solid #1f6f8b;padding:.7rem 1rem;font-size:17px}
.warn{background:#fbf1f2;border-left-color:#d1495b}.cause{border:1px solid #d9dee3;border-radius:6px;
padding:.2rem 1.2rem 1rem;margin:1rem 0}.cause h3{margin:.7rem 0 .3rem;font-size:19px}
.big{font-size:19px;font-weight:600}.small{color:#666;font-size:13.5px}code{background:#f3f3f3;padding:.1em .3em}
"""
_VERDICTS = {
    "explained": "Explained: with what was found every record agrees with the model to within 1.5 times the noise.",
    "suspect": "Suspect: causes are named, but something is left that they do not explain, or one is no likelier than "
    "another.",
    "ambiguous": "Ambiguous: this data cannot tell some causes from each other.",
    "unexplained": "Unexplained: the simulation is wrong by more than noise, and no known cause explains it.",
    "nothing_found": "Nothing found: hysteresis and creep explain every record to within 1.5 times the noise.",
}
_GOOD = ("explained", "nothing_found")
_NEVER = 1e9


def page(diagnosis: Diagnosis, figures: Mapping[str, bytes]) -> str:
    """Return the page.

    Args:
        diagnosis: what was found.
        figures: PNG images: "simulation", "where" and, where there are several records, "records"; "quality" where
            readings were left out.
    """
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Diagnosis</title>",
        f"<style>{_STYLE}</style></head><body>",
        *_verdict(diagnosis),
        "<h2>What was simulated, and what is left</h2>",
        f"<p>{_simulated(diagnosis)}</p>",
        _image(figures["simulation"], "measured and simulated displacement over time"),
        "<h2>Data quality</h2>",
        *quality_section(diagnosis),
        *([_image(figures["quality"], "readings that were left out")] if "quality" in figures else []),
        "<h2>Where it is wrong</h2>",
        "<p class='small'>All records together. A lag shows against the rate, a curved scale against the voltage, "
        "wrong loops against the place in the loop, creep and relaxation against the time at rest, hum and "
        "resonance in the spectrum.</p>",
        _image(figures["where"], "residual against voltage, rate, place in the loop, time at rest, frequency"),
        "<h2>Why, and what naming the cause gains</h2>",
        *(_cause(number, finding) for number, finding in enumerate(diagnosis.findings, 1)),
        *_without_findings(diagnosis),
        "<h2>What remains, and what to measure next</h2>",
        *_remains(diagnosis),
        *_detectable(diagnosis),
    ]
    if "records" in figures:
        parts += ["<h2>Every record</h2>", _image(figures["records"], "residual of every record over time")]
    parts += ["<h2>The extended model</h2>", *_model(diagnosis), "</body></html>"]
    return "\n".join(parts) + "\n"


def _verdict(diagnosis: Diagnosis) -> Iterator[str]:
    status = diagnosis.status.value
    names = " and ".join(f"<code>{html.escape(f.cause)}</code>" for f in diagnosis.findings)
    yield f"<h1>Diagnosis: {html.escape(status.replace('_', ' '))}</h1>"
    yield f"<div class='verdict{'' if status in _GOOD else ' warn'}'>{html.escape(_VERDICTS[status])}"
    if names:
        yield (
            f"<br>Named: {names}. Error on held-out data ({html.escape(diagnosis.quoted_on)}): "
            f"<b>{diagnosis.baseline_test_percent:.3g} % → {diagnosis.final_test_percent:.3g} %</b> of the range."
        )
    if diagnosis.ambiguous_with:
        others = ", ".join(f"<code>{html.escape(name)}</code>" for name in diagnosis.ambiguous_with)
        yield f"<br>It could as well be {others}."
    yield f"<br>Next: {_with_code(diagnosis.next_experiment)}.</div>"


def _simulated(diagnosis: Diagnosis) -> str:
    learnt = [v for v in diagnosis.records if v.role == "train"]
    others = [v for v in diagnosis.records if v.role != "train"]
    duration_s = sum(float(v.time_s[-1] - v.time_s[0]) for v in learnt)
    held_out = " and ".join(html.escape(v.name) for v in others) or "blocks of the same records"
    return (
        f"The base model, hysteresis and creep alone, was fitted to {html.escape(', '.join(v.name for v in learnt))} "
        f"({duration_s:.3g} s, {sum(v.time_s.size for v in learnt)} samples). Held out: {held_out}. "
        f"The noise floor is {_length(diagnosis.noise_floor_um)} rms (from differences "
        f"{_length(diagnosis.noise.differences_um)}, from repeats {_length(diagnosis.noise.repeats_um)}). The base "
        f"model errs by {diagnosis.baseline_train_percent:.3g} % of the range where it was fitted and by "
        f"{diagnosis.baseline_test_percent:.3g} % on held-out data."
    )


def _cause(number: int, finding: Finding) -> str:
    kind = cause_classes()[finding.cause]
    rows: list[str] = []
    for spec in kind.parameters:
        if spec.name not in finding.parameters:
            continue
        value = finding.parameters[spec.name]
        error = None if isinstance(value, list) else finding.standard_errors.get(spec.name)
        if value == 0.0 and error is None:
            continue
        css = "" if rows else " class='big'"
        unit = "" if spec.unit == "1" else f" {html.escape(spec.unit)}"
        rows.append(
            f"<tr><td>{html.escape(spec.name)}<td{css}>{_with_error(value, error)}{unit}"
            f"<td>{html.escape(spec.description)}</tr>"
        )
    return (
        f"<div class='cause'><h3>{number}. <code>{html.escape(finding.cause)}</code></h3>"
        f"<p>{html.escape(kind.meaning)}</p><table>{''.join(rows)}</table>"
        f"<p>Held-out error <b>{finding.nrmse_percent_test_before:.4g} % → {finding.nrmse_percent_test_after:.4g} "
        f"%</b>: {100.0 * finding.gain:.3g} % of what was above the noise; p = {finding.p_value:.1e}. "
        f"Probability that this is the cause: <b>{100.0 * finding.probability:.0f} %</b>.</p>"
        f"<p class='small'>Evidence: {html.escape(finding.evidence)}.<br>"
        f"Best seen with: {html.escape(kind.experiment)}.<br>"
        f"Compensator: {html.escape(kind.inverse_note)}.</p></div>"
    )


def _without_findings(diagnosis: Diagnosis) -> Iterator[str]:
    if not diagnosis.findings:
        yield (
            "<p>No cause was accepted: none made the prediction of held-out data better by enough to be more than "
            "chance.</p>"
        )


def _remains(diagnosis: Diagnosis) -> Iterator[str]:
    where = html.escape(diagnosis.quoted_on)
    if diagnosis.findings:
        yield (
            f"<p>On {where} {diagnosis.unexplained_percent:.3g} % of the power the base model left above the noise "
            "is still there.</p>"
        )
    else:
        yield f"<p>On {where} the error is {diagnosis.final_test_percent:.3g} % of the range.</p>"
    for reason in diagnosis.judgement.reasons:
        yield f"<p>What is left is not noise: {html.escape(reason)}.</p>"
    rows = "".join(
        f"<tr><td>{html.escape(test.on)}<td>{100.0 * test.share:.2g} %<td>{test.p_value:.2g}</tr>"
        for test in diagnosis.judgement.dependences
    )
    yield (
        "<p>Whether what is left follows the drive, on blocks it was not learned from:</p>"
        f"<table><tr><th>what it may follow from<th>share of its power<th>p</tr>{rows}</table>"
        f"<p>Probability of something that is not in the library: {100.0 * diagnosis.probability_of_unknown:.0f} %.</p>"
    )
    if diagnosis.unnamed is not None:
        yield f"<p>In the extended model, beside the causes: {html.escape(str(diagnosis.unnamed))}.</p>"
    if diagnosis.ambiguous_with:
        yield f"<p>Not told apart: {html.escape(', '.join(diagnosis.ambiguous_with))}.</p>"
    yield f"<p><b>Measure next:</b> {_with_code(diagnosis.next_experiment)}.</p>"


def _detectable(diagnosis: Diagnosis) -> Iterator[str]:
    found = {finding.cause for finding in diagnosis.findings}
    rows: list[str] = []
    for name, sizes in sorted(diagnosis.smallest_detectable.items()):
        if name in found:
            continue
        kind = cause_classes()[name]
        units = {spec.name: spec.unit for spec in kind.parameters}
        side = "below" if kind.size_exponent < 0.0 else "above"
        for parameter, value in sizes.items():
            unit = "" if units.get(parameter, "1") == "1" else units[parameter]
            rows.append(
                f"<tr><td><code>{html.escape(name)}</code><td>{html.escape(parameter)} {side} "
                f"{value:.3g} {html.escape(unit)}<td>{html.escape(kind.experiment)}</tr>"
            )
    if rows:
        yield "<p>These records would have revealed:</p><table><tr><th>cause<th>if its size was<th>best seen with</tr>"
        yield f"{''.join(rows)}</table>"


def _model(diagnosis: Diagnosis) -> Iterator[str]:
    model = diagnosis.extended_model
    yield (
        f"<p><code>extended_model.yaml</code>: {model.n_elements} elements, creep order {model.creep_order:.4g}"
        + (", with " if model.causes else ", no effects")
        + ", ".join(f"<code>{html.escape(cause.name)}</code>" for cause in model.causes)
        + ". It runs as it is in <code>fomrc simulate</code>, <code>fomrc compensate</code> and the ROS nodes.</p>"
    )
    notes = [f"<li><code>{e.name}</code>: {html.escape(e.inverse_note)}</li>" for e in model.causes]
    if notes:
        yield f"<p>What the compensator does with it:</p><ul>{''.join(notes)}</ul>"


def _with_error(value: float | list[float], error: float | None) -> str:
    """Return a value with its standard error, to the digits the error leaves."""
    if isinstance(value, list):
        return f"{len(value)} values"
    if abs(value) >= _NEVER:
        return "not within the record"
    if error is None or not math.isfinite(error) or error <= 0.0 or value == 0.0:
        return f"{value:.5g}"
    n_digits = max(2, math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 2)
    return f"{value:.{min(n_digits, 12)}g} ± {error:.2g}"


def _with_code(text: str) -> str:
    """Return text for the page, what stands between backticks as code."""
    parts = html.escape(text).split("`")
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def _length(value_um: float) -> str:
    if not math.isfinite(value_um):
        return "none"
    return f"{1e3 * value_um:.3g} nm" if value_um < 0.5 else f"{value_um:.3g} µm"


def _image(content: bytes, description: str) -> str:
    data = base64.b64encode(content).decode("ascii")
    return f"<img alt='{html.escape(description)}' src='data:image/png;base64,{data}'>"
