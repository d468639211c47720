"""A diagnosis as one self-contained HTML page, to be read in two minutes."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from fomrc_core.model.causes import cause_classes
from fomrc_core.report.diagnosis_figures import quoted_record, quoted_words
from fomrc_core.report.page_parts import document, image, prose, provenance_section, table
from fomrc_core.report.provenance import Provenance
from fomrc_core.report.quality_view import quality_section
from fomrc_core.report.quantities import length, quantity
from fomrc_core.report.residual_panels import diagnosis_figure

if TYPE_CHECKING:
    from fomrc_core.diagnosis.constancy import ParameterTwice
    from fomrc_core.diagnosis.diagnosis import Diagnosis
    from fomrc_core.diagnosis.findings import Finding

_VERDICTS = {
    "explained": "Explained: with what was found every record agrees with the model to within 1.5 times the noise.",
    "suspect": "Suspect: causes are named, but something is left that they do not explain, or not all of them are "
    "sure.",
    "ambiguous": "Ambiguous: this data cannot tell some causes from each other.",
    "unexplained": "Unexplained: the simulation is wrong by more than noise, and no known cause explains it.",
    "nothing_found": "Nothing found: hysteresis and creep explain every record to within 1.5 times the noise.",
}
_GOOD = ("explained", "nothing_found")
_NEVER = 1e9


def page(diagnosis: Diagnosis, figures: Mapping[str, bytes], provenance: Provenance | None = None) -> str:
    """Return the page.

    Args:
        diagnosis: what was found.
        figures: PNG images: "simulation", "where" and, where there are several records, "records"; "quality" where
            readings were left out.
        provenance: where the diagnosis comes from; the page says nothing of it where not given.
    """
    quoted = quoted_record(diagnosis)
    parts = [
        *_verdict(diagnosis),
        "<h2>What was simulated, and what is left</h2>",
        f"<p>{_simulated(diagnosis)}</p>",
        image(
            figures["simulation"], f"Displacement of {quoted.name} over time, measured and simulated, and what is left."
        ),
        "<h2>Data quality</h2>",
        *quality_section(diagnosis),
        *_thinning(diagnosis),
        *([image(figures["quality"], "Readings that were left out.")] if "quality" in figures else []),
        "<h2>Where it is wrong</h2>",
        "<p>A lag shows against the rate, a curved scale against the drive, wrong loops against the place in the loop, "
        "creep and relaxation against the time at rest, hum and resonance in the spectrum.</p>",
        diagnosis_figure(diagnosis, quoted.name),
        image(
            figures["where"],
            "All records together: residual against voltage, rate, place in the loop and time at rest, its spectrum, "
            "and the error with each cause that was named.",
        ),
        "<h2>Why, and what naming the cause gains</h2>",
        *(_cause(number, finding) for number, finding in enumerate(diagnosis.findings, 1)),
        *_without_findings(diagnosis),
        "<h2>What remains, and what to measure next</h2>",
        *_remains(diagnosis),
        *_detectable(diagnosis),
    ]
    if "records" in figures:
        parts += ["<h2>Every record</h2>", image(figures["records"], "Residual of every record over time.")]
    parts += ["<h2>The extended model</h2>", *_model(diagnosis), *provenance_section(provenance)]
    return document(f"Diagnosis: {diagnosis.status.value.replace('_', ' ')}", parts)


def _verdict(diagnosis: Diagnosis) -> Iterator[str]:
    status = diagnosis.status.value
    names = " and ".join(f"<code>{html.escape(f.cause)}</code>" for f in diagnosis.findings)
    yield f"<h1>Diagnosis: {html.escape(status.replace('_', ' '))}</h1>"
    yield f"<div class='verdict{'' if status in _GOOD else ' warn'}'>{html.escape(_VERDICTS[status])}"
    if names:
        yield (
            f"<br>Named: {names}. Error on {html.escape(quoted_words(diagnosis))}: "
            f"<b>{diagnosis.baseline_test_percent:.3g} % → {diagnosis.final_test_percent:.3g} %</b> of the range."
        )
    if diagnosis.ambiguous_with:
        others = ", ".join(f"<code>{html.escape(name)}</code>" for name in diagnosis.ambiguous_with)
        yield f"<br>It could as well be {others}."
    for doubt in diagnosis.doubts:
        yield f"<br>Doubt: {prose(doubt)}."
    for words in diagnosis.judgement.rests_on:
        yield f"<br>What is left is taken for noise, but: {prose(words)}."
    yield f"<br>Next: {prose(diagnosis.next_experiment)}.</div>"


def _thinning(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.thinning is not None:
        yield "<h2>How the records were thinned, and what that loses</h2><ul>"
        yield from (f"<li>{prose(sentence)}</li>" for sentence in diagnosis.thinning.sentences())
        yield "</ul>"


def _simulated(diagnosis: Diagnosis) -> str:
    learnt = [v for v in diagnosis.records if v.role == "train"]
    others = [v for v in diagnosis.records if v.role != "train"]
    duration_s = sum(float(v.time_s[-1] - v.time_s[0]) for v in learnt)
    held_out = " and ".join(html.escape(v.name) for v in others) or "blocks of the same records"
    return (
        f"The base model, hysteresis and creep alone, was fitted to {html.escape(', '.join(v.name for v in learnt))} "
        f"({duration_s:.3g} s, {sum(v.time_s.size for v in learnt)} samples). Held out: {held_out}. "
        f"The noise floor is {length(diagnosis.noise_floor_um)} rms (from differences "
        f"{length(diagnosis.noise.differences_um)}, from repeats {length(diagnosis.noise.repeats_um)}). The base "
        f"model errs by {diagnosis.baseline_train_percent:.3g} % of the range where it was fitted and by "
        f"{diagnosis.baseline_test_percent:.3g} % on {html.escape(quoted_words(diagnosis))}."
    )


def _cause(number: int, finding: Finding) -> str:
    kind = cause_classes()[finding.cause]
    rows: list[tuple[str, str, str, str]] = []
    twice = {pair.parameter: pair for pair in finding.twice}
    for spec in kind.parameters:
        if spec.name not in finding.parameters:
            continue
        value = finding.parameters[spec.name]
        error = None if isinstance(value, list) else finding.standard_errors.get(spec.name)
        if value == 0.0 and error is None:
            continue
        shown = html.escape(_parameter(value, spec.unit, error))
        rows.append(
            (
                f"<code>{html.escape(spec.name)}</code>",
                shown if rows else f"<span class='big'>{shown}</span>",
                _held_out(twice.get(spec.name), spec.unit),
                prose(spec.description),
            )
        )
    chance = quantity(finding.p_value, "1", n_digits=2)
    return (
        f"<div class='cause'><h3>{number}. <code>{html.escape(finding.cause)}</code></h3><p>{prose(kind.meaning)}</p>"
        + table(
            f"Parameters of {finding.cause}",
            ("parameter", "value ± standard error", "from held-out data alone", "what it is"),
            rows,
        )
        + f"<p>Held-out error <b>{finding.nrmse_percent_test_before:.4g} % → {finding.nrmse_percent_test_after:.4g} "
        f"%</b>: {100.0 * finding.gain:.3g} % of what was above the noise; p = {chance}. "
        f"Probability that this is the cause: <b>{100.0 * finding.probability:.0f} %</b>.</p>"
        f"<p class='small'>Evidence: {prose(finding.evidence)}.<br>"
        f"Best seen with: {prose(kind.experiment)}.<br>"
        f"Compensator: {prose(kind.inverse_note)}.</p></div>"
    )


def _held_out(pair: ParameterTwice | None, unit: str) -> str:
    if pair is None:
        return ""
    return f"{html.escape(_parameter(pair.held_out, unit, None))}, {pair.n_errors:.1f} standard errors apart"


def _without_findings(diagnosis: Diagnosis) -> Iterator[str]:
    if not diagnosis.findings and not diagnosis.stand_ins:
        yield (
            "<p>No cause was accepted: none made the prediction of held-out data better by enough to be more than "
            "chance.</p>"
        )
    for term in diagnosis.further_terms:
        yield f"<p>{prose(term.sentence_of_term(term.wider_of(diagnosis.findings)))}.</p>"
    for form in diagnosis.stand_ins:
        yield f"<p>{prose(form.sentence_of_stand_in())}. It stays in the extended model for what it gains.</p>"


def _remains(diagnosis: Diagnosis) -> Iterator[str]:
    where = f"held-out data ({html.escape(diagnosis.quoted_on)})"
    if diagnosis.findings:
        yield (
            f"<p>On {where} {diagnosis.unexplained_percent:.3g} % of the power the base model left above the noise "
            "is still there.</p>"
        )
    else:
        yield f"<p>On {where} the error is {diagnosis.final_test_percent:.3g} % of the range.</p>"
    yield "<p>Whether what is left follows the drive, on blocks it was not learned from:</p>"
    yield table(
        "What is left, and what it may follow from",
        ("what it may follow from", "share of its power", "p"),
        (
            (prose(test.on), f"{100.0 * test.share:.2g} %", quantity(test.p_value, "1", n_digits=2))
            for test in diagnosis.judgement.dependences
        ),
    )
    unknown_percent = 100.0 * diagnosis.probability_of_unknown
    yield f"<p>Probability of something that is not in the library: {unknown_percent:.0f} %.</p>"
    if diagnosis.unnamed is not None:
        yield f"<p>In the extended model, beside the causes: {prose(str(diagnosis.unnamed))}.</p>"
    if diagnosis.ambiguous_with:
        yield f"<p>Not told apart: {html.escape(', '.join(diagnosis.ambiguous_with))}.</p>"
    yield f"<p><b>Measure next:</b> {prose(diagnosis.next_experiment)}.</p>"


def _detectable(diagnosis: Diagnosis) -> Iterator[str]:
    found = {finding.cause for finding in diagnosis.findings}
    rows: list[tuple[str, str, str]] = []
    for name, sizes in sorted(diagnosis.smallest_detectable.items()):
        if name in found:
            continue
        kind = cause_classes()[name]
        units = {spec.name: spec.unit for spec in kind.parameters}
        side = "below" if kind.size_exponent < 0.0 else "above"
        for parameter, value in sizes.items():
            size = html.escape(quantity(value, units.get(parameter, "1"), n_digits=3))
            told = f"<code>{html.escape(parameter)}</code> {side} {size}"
            rows.append((f"<code>{html.escape(name)}</code>", told, prose(kind.experiment)))
    if rows:
        yield "<p>These records would have revealed:</p>"
        yield table("What would have shown", ("cause", "if its size was", "best seen with"), rows)


def _model(diagnosis: Diagnosis) -> Iterator[str]:
    model = diagnosis.extended_model
    yield (
        f"<p><code>extended_model.yaml</code>: {model.n_elements} elements, creep order {model.creep_order:.4g}"
        + (", with " if model.causes else ", no effects")
        + ", ".join(f"<code>{html.escape(cause.name)}</code>" for cause in model.causes)
        + ". It runs as it is in <code>fomrc simulate</code>, <code>fomrc compensate</code> and the ROS nodes.</p>"
    )
    notes = [f"<li><code>{html.escape(e.name)}</code>: {prose(e.inverse_note)}</li>" for e in model.causes]
    if notes:
        yield f"<p>What the compensator does with it:</p><ul>{''.join(notes)}</ul>"


def _parameter(value: float | list[float], unit: str, error: float | None) -> str:
    if isinstance(value, list):
        return f"{len(value)} values"
    return "not within the record" if abs(value) >= _NEVER else quantity(value, unit, error)
