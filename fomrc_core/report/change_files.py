"""A change that the watch has noticed, as files: JSON for programs, a page to read, and the extended model."""

from __future__ import annotations

import html
import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fomrc_core.diagnosis.watch.alarm import Alarm, Case
from fomrc_core.diagnosis.watch.naming import ChangeDiagnosis
from fomrc_core.report.diagnosis_figures import AFTER, BEFORE, png
from fomrc_core.report.page_parts import document, image, prose, table
from fomrc_core.storage import write_model, write_text

JSON_NAME, PAGE_NAME, MODEL_NAME = "change.json", "change.html", "extended_model.yaml"
_N_DRAWN = 4000
_DIGITS = 6


def change_results(alarm: Alarm, found: ChangeDiagnosis | None, began_s: float = 0.0) -> dict[str, Any]:
    """Return an alarm and what it was about as plain numbers, strings and lists, None where there is no number.

    Args:
        alarm: the alarm.
        found: its diagnosis; None while there is none.
        began_s: when the recording of the diagnosis began, from the start of the watch [s].
    """
    results: dict[str, Any] = {
        "noticed_s": _number(alarm.time_s),
        "since_s": _number(alarm.since_s),
        "statistic": alarm.statistic,
        "level_nm": _number(alarm.level_nm),
        "normal_nm": _number(alarm.normal_nm),
        "motion_s": _number(alarm.motion_s),
    }
    if found is None:
        return results
    return results | {
        "since_s": _number(began_s + found.since_s),
        "cause": found.cause,
        "size_nm": _number(found.size_nm),
        "meaning": found.meaning,
        "ambiguous_with": list(found.ambiguous_with),
        "causes": [
            {
                "cause": named.cause,
                "parameters": {name: _number(value) for name, value in named.parameters.items()},
                "probability": _number(named.probability),
                "explained": _number(named.explained),
            }
            for named in found.named
        ],
        "data_after": {
            "in_force_nm": _number(found.before_nm),
            "extended_nm": _number(found.after_nm),
            "is_better": found.model is not None,
        },
    }


def change_line(alarm: Alarm, found: ChangeDiagnosis, began_s: float) -> str:
    """Return an alarm and what it was about in one line, both times from the start of the watch."""
    since_s = began_s + found.since_s
    return f"{replace(found, since_s=since_s)}; {replace(alarm, since_s=since_s)}"


def write_change(case: Case, found: ChangeDiagnosis, folder: str | os.PathLike[str]) -> None:
    """Write ``change.json``, ``change.html`` and, where a model can follow the change, ``extended_model.yaml``.

    Args:
        case: the alarm and what was measured.
        found: what it was about.
        folder: existing folder; files of these names are replaced.

    Raises:
        StorageError: the folder is missing or cannot be written.
    """
    results = change_results(case.alarm, found, case.began_s)
    if found.model is not None:
        write_model(found.model, Path(folder, MODEL_NAME), 1e-3 * found.after_nm)
    write_text(_page(case, found), Path(folder, PAGE_NAME))
    write_text(json.dumps(results, indent=2, allow_nan=False) + "\n", Path(folder, JSON_NAME))


def _number(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None


def _page(case: Case, found: ChangeDiagnosis) -> str:
    rows = (
        (
            f"<code>{html.escape(n.cause)}</code>",
            f"{n.probability:.2f}",
            f"{n.explained:.2f}",
            html.escape(", ".join(f"{name} {value:.4g}" for name, value in n.parameters.items())),
        )
        for n in found.named[:8]
    )
    after = f"<p>On data no hypothesis was fitted to: {found.before_nm:.3g} nm rms with the model in force" + (
        f", {found.after_nm:.3g} nm with the change in it.</p>" if math.isfinite(found.after_nm) else ".</p>"
    )
    line = prose(change_line(case.alarm, found, case.began_s))
    body = [
        f"<h1>{html.escape(found.cause)}</h1><p>{prose(found.meaning)}</p><p>{line}</p>{after}",
        image(png(_figure(case, found)), "The drive and the residual of the model in force over time."),
        table("What it may be", ("cause", "probability", "explained", "size"), rows),
    ]
    return document("What has changed", body)


def _figure(case: Case, found: ChangeDiagnosis) -> Figure:
    record = case.recording
    predicted_um = case.model.simulate(record.steps_s, record.voltage_v, case.state.copy())
    residual_nm = 1e3 * (record.measured_um - predicted_um)
    residual_nm -= float(np.mean(residual_nm[record.time_s <= max(found.since_s, record.time_s[1])]))
    every = max(1, record.n_samples // _N_DRAWN)
    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    drive, error = figure.subplots(2, 1, sharex=True)
    time_s = case.began_s + record.time_s[::every]
    drive.plot(time_s, record.voltage_v[::every], color=AFTER, lw=0.8)
    drive.set_ylabel("drive [V]")
    drive.set_title("drive", fontsize=10)
    error.plot(time_s, residual_nm[::every], color=BEFORE, lw=0.8)
    error.axvline(case.began_s + found.since_s, color="black", lw=0.8, ls="--")
    error.axvline(case.alarm.time_s, color="black", lw=0.8, ls=":")
    error.set_ylabel("residual [nm]")
    error.set_title("measured less the model in force", fontsize=10)
    error.set_xlabel("time since the watch began [s]; dashed: since when, dotted: noticed")
    return figure
