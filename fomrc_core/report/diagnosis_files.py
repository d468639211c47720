"""A diagnosis as files: JSON for programs, a model that runs, and a page to read.

    write_report(diagnosis, directory)

The page is made in diagnosis_page.py, its pictures in diagnosis_figures.py, what one can zoom in residual_panels.py.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fomrc_core.records.drive import is_settled
from fomrc_core.records.residual import rms
from fomrc_core.report.diagnosis_figures import png, quoted_record, records_figure, simulation_figure, where_figure
from fomrc_core.report.diagnosis_names import FIGURE_NAME, JSON_NAME, MODEL_NAME, PAGE_NAME
from fomrc_core.report.diagnosis_page import page
from fomrc_core.report.fit_results import thinning_results
from fomrc_core.report.provenance import Provenance
from fomrc_core.report.quality_view import quality_figure, quality_results
from fomrc_core.storage import write_model, write_text
from fomrc_core.storage.atomic import write_bytes

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis
    from fomrc_core.diagnosis.findings import Finding
    from fomrc_core.diagnosis.judgement import Judgement
    from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension


def write_report(diagnosis: Diagnosis, directory: str | os.PathLike[str], provenance: Provenance | None = None) -> None:
    """Write ``diagnosis.json``, ``extended_model.yaml``, ``report.html`` and its main figure as PNG.

    Each file is written whole or not at all; the JSON comes last, so that who sees it finds the others.

    Args:
        diagnosis: what was found.
        directory: existing folder; files of these names are replaced.
        provenance: where the diagnosis comes from; told in page and JSON, nowhere where it is not given.

    Raises:
        StorageError: the folder is missing or cannot be written.
    """
    folder = Path(directory)
    figures = {"simulation": png(simulation_figure(diagnosis)), "where": png(where_figure(diagnosis))}
    all_records = records_figure(diagnosis)
    if all_records is not None:
        figures["records"] = png(all_records)
    faulty = quality_figure(diagnosis)
    if faulty is not None:
        figures["quality"] = png(faulty)
    left = np.concatenate([v.residual_after_um for v in diagnosis.records if v.role == "train"])
    # of single readings, which whoever runs the model will see, not of means of many
    error_um = rms(left) if diagnosis.thinning is None else diagnosis.thinning.rms_um
    write_model(diagnosis.extended_model, folder / MODEL_NAME, error_um)
    write_bytes(figures["where"], folder / FIGURE_NAME)
    results = diagnosis_results(diagnosis)
    write_page_and_results(folder, results, provenance, lambda where: page(diagnosis, figures, where))


def write_page_and_results(
    folder: Path,
    results: dict[str, Any],
    provenance: Provenance | None,
    page_of: Callable[[Provenance | None], str],
) -> None:
    """Write the page and, last, the JSON of a diagnosis whose model is written.

    Args:
        folder: with the model.
        results: what the JSON says, but for where it comes from.
        provenance: where it comes from, the model not counted; None where it is not told.
        page_of: the page, given where it comes from.
    """
    if provenance is not None:
        provenance = provenance.with_file("extended model", folder / MODEL_NAME)
        results = results | {"provenance": provenance.results()}
    write_text(page_of(provenance), folder / PAGE_NAME)
    write_text(json.dumps(results, indent=2, allow_nan=False) + "\n", folder / JSON_NAME)


def diagnosis_results(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as plain numbers, strings and lists, None where there is no number."""
    model = diagnosis.extended_model
    results = {
        "status": diagnosis.status.value,
        "noise_floor_um": diagnosis.noise_floor_um,
        "baseline": {
            "nrmse_percent_train": diagnosis.baseline_train_percent,
            "nrmse_percent_test": diagnosis.baseline_test_percent,
        },
        "findings": [_finding(finding) for finding in diagnosis.findings],
        "ambiguous_with": list(diagnosis.ambiguous_with),
        "unexplained_percent": diagnosis.unexplained_percent,
        "smallest_detectable": {name: dict(size) for name, size in diagnosis.smallest_detectable.items()},
        "next_experiment": diagnosis.next_experiment,
        "extended": {
            "nrmse_percent_test": diagnosis.final_test_percent,
            "creep_order": model.creep_order,
            "n_elements": model.n_elements,
            "effects": [cause.name for cause in model.causes],
            "not_inverted": {cause.name: cause.inverse_note for cause in model.causes if not cause.can_invert},
        },
        "further_terms": _further_terms(diagnosis),
        "stand_ins": [_finding(finding) for finding in diagnosis.stand_ins],
        "unnamed_extension": _unnamed(diagnosis.unnamed),
        "noise": {
            "differences_um": diagnosis.noise.differences_um,
            "repeats_um": diagnosis.noise.repeats_um,
        },
        "probability_of_unknown": diagnosis.probability_of_unknown,
        "doubts": list(diagnosis.doubts),
        "rests_on": list(diagnosis.judgement.rests_on),
        "left_out": list(diagnosis.left_out),
        "remainder": _remainder(diagnosis.judgement),
        "data_quality": [quality_results(quality) for quality in diagnosis.data_quality],
        "beyond_learned": [
            {"record": beyond.name, "widest_play_v": beyond.widest_v, "learned_v": beyond.learned_v}
            for beyond in diagnosis.beyond_learned
        ],
        "thinning": thinning_results(diagnosis.thinning),
        "quoted_on": {"name": diagnosis.quoted_on, "role": quoted_record(diagnosis).role},
        "records": [
            {
                "name": view.name,
                "role": view.role,
                "n_samples": view.time_s.size,
                "rms_um_before": rms(view.residual_before_um[kept]),
                "rms_um_after": rms(view.residual_after_um[kept]),
            }
            for view in diagnosis.records
            for kept in (is_settled(view.time_s, view.voltage_v),)
        ],
    }
    plain = _plain(results)
    assert isinstance(plain, dict)
    return plain


def _unnamed(extension: UnnamedExtension | None) -> dict[str, Any] | None:
    if extension is None:
        return None
    return {
        "words": extension.words,
        "n_terms": extension.n_terms,
        "rms_um_before": extension.rms_before_um,
        "rms_um_after": extension.rms_after_um,
        "p_value": extension.p_value,
        "parameters": {effect.name: effect.to_mapping() for effect in extension.effects},
    }


def _remainder(judgement: Judgement) -> dict[str, Any]:
    tests = [{"on": test.on, "share": test.share, "p_value": test.p_value} for test in judgement.dependences]
    return {"is_noise": judgement.is_noise, "reasons": list(judgement.reasons), "follows_from": tests}


def _further_terms(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    return [_finding(term) | {"of": term.wider_of(diagnosis.findings)} for term in diagnosis.further_terms]


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "cause": finding.cause,
        "parameters": dict(finding.parameters),
        "standard_errors": dict(finding.standard_errors),
        "nrmse_percent_test_before": finding.nrmse_percent_test_before,
        "nrmse_percent_test_after": finding.nrmse_percent_test_after,
        "gain": finding.gain,
        "p_value": finding.p_value,
        "probability": finding.probability,
        "parameters_of_held_out_data_alone": {
            pair.parameter: {"value": pair.held_out, "standard_errors_apart": pair.n_errors} for pair in finding.twice
        },
        "evidence": finding.evidence,
        "meaning": finding.meaning,
    }


def _plain(value: Any) -> Any:
    """Return the value of plain types only; a number that is none, which JSON cannot hold, as None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (str, bool)) or value is None:
        return value
    if isinstance(value, int):
        return value
    return float(value) if math.isfinite(value) else None
