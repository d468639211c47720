"""Weights of the probability of a name, from hidden causes of the development seeds.

    python test/hidden/study_calibration.py [--seeds 1] [--output calibration.json]

Every case is diagnosed, and a logistic regression (Platt, 1999; a ridge of one observation) of "the name is right" on
the evidence of ``fomrc_core.diagnosis.belief`` is printed, with how often names of each probability were right in cases
left out of the fit (five folds). The weights are written into belief.py by hand: a model is not learned in passing.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from test.hidden import study_second, study_third
from test.hidden.study_recording import recording_of

_GROUPS = ("null", "known", "new", "removed", "pairs", "triples")
_GROUPS_OF_THIRD = ("null", "known", "pairs", "unknown", "forms")
_FOLDS = 5


def main() -> None:
    """Collect, fit, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=1, help="seeds for each kind of case")
    parser.add_argument("--output", type=Path, default=Path("calibration.json"), help="file the rows are kept in")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = json.loads(options.output.read_text()) if options.output.exists() else []
    done = {row["key"] for row in rows}
    specs: list[study_second.SecondSpec | study_third.ThirdSpec] = []
    for group in _GROUPS:
        specs += study_second.plan(group, "development", options.seeds)
    for group in _GROUPS_OF_THIRD:
        specs += study_third.plan(group, "development", options.seeds)
    for spec in specs:
        if spec.key not in done:
            rows += _rows_of(spec)
            options.output.write_text(json.dumps(rows, indent=1))
    report([row for row in rows if row["evidence"] is not None])


def _rows_of(spec: study_second.SecondSpec | study_third.ThirdSpec) -> list[dict[str, Any]]:
    """Return a row for each name given in a case, one without evidence where there is none."""
    from fomrc_core.diagnosis.belief import evidence_of
    from fomrc_core.diagnosis.diagnosis import diagnose
    from fomrc_core.errors import RecordingError

    recordings, model, excluded = _drawn(spec)
    train, test, third = recordings
    none: list[dict[str, Any]] = [{"key": spec.key, "evidence": None}]
    try:
        found = diagnose(train, test=test, report=third, model=model, excluded_causes=excluded)
    except RecordingError as error:
        print(spec.key, f"refused: {error}", flush=True)
        return none
    print(spec.key, found.status.value, [f.cause for f in found.findings], flush=True)
    return [
        {
            "key": spec.key,
            "cause": finding.cause,
            "is_right": finding.cause in spec.causes and finding.cause not in excluded,
            "evidence": list(evidence_of(finding, found.judgement)),
            "status": found.status.value,
        }
        for finding in found.findings
    ] or none


def _drawn(spec: study_second.SecondSpec | study_third.ThirdSpec) -> tuple[list[Any], Any, list[str]]:
    """Return the three recordings of a case, the model that is handed over, and the causes not to try."""
    from fomrc_core.model.causes import cause_classes

    if isinstance(spec, study_third.ThirdSpec):
        third = spec.draw()
        recordings = [recording_of(record) for record in third.records]
        return recordings, study_third.model_of(third, recordings[0]), []
    second = spec.draw()
    excluded = [cause for cause in spec.excluded if cause in cause_classes()]
    return [recording_of(record) for record in second.records], study_second.model_of(second), excluded


def fitted(evidence: np.ndarray, is_right: np.ndarray) -> np.ndarray:
    """Return intercept and weights of the logistic regression, shape (1 + n_evidence,)."""
    columns = np.column_stack((np.ones(len(evidence)), evidence))

    def loss(weights: np.ndarray) -> float:
        odds = columns @ weights
        return float(np.sum(np.logaddexp(0.0, odds) - is_right * odds) + 0.5 * np.sum(weights[1:] ** 2))

    return np.asarray(minimize(loss, np.zeros(columns.shape[1]), method="BFGS").x)


def report(rows: list[dict[str, Any]]) -> None:
    """Print the weights, and the reliability in folds left out."""
    evidence = np.array([row["evidence"] for row in rows], dtype=float)
    is_right = np.array([row["is_right"] for row in rows], dtype=float)
    keys = sorted({row["key"] for row in rows})
    fold = np.array([keys.index(row["key"]) % _FOLDS for row in rows])
    print("weights", np.round(fitted(evidence, is_right), 3), "of", len(rows), "names")
    told = np.zeros(len(rows))
    for k in range(_FOLDS):
        weights = fitted(evidence[fold != k], is_right[fold != k])
        told[fold == k] = 1.0 / (1.0 + np.exp(-(weights[0] + evidence[fold == k] @ weights[1:])))
    for low, high in ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 1.01)):
        inside = (told >= low) & (told < high)
        share = float(np.mean(is_right[inside])) if np.any(inside) else float("nan")
        print(f"told {low:.1f} to {min(high, 1.0):.1f}: {np.count_nonzero(inside)} names, {100.0 * share:.0f} % right")


if __name__ == "__main__":
    main()
