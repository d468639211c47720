"""Weights of the probability of a name, from the outcomes of a study whose seeds are not reported any more.

    python test/hidden/study_calibration.py FOLDER [FOLDER ...]

FOLDER holds outcomes of the second world as ``study.py --part second`` writes them, a file each. A logistic regression
(Platt, 1999) of "the name is right" on the evidence of ``fomrc_core.diagnosis.belief`` is printed, about the weights
that stand there as prior knowledge worth so many names, with what it says of names in cases left out of the fit (ten
folds), beside what the weights that stand say. They are written into belief.py by hand: a model is not learned in
passing.
"""

from __future__ import annotations

import argparse
import json
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from test.hidden.study_second_scores import accepted

_FOLDS = 10
_PRIORS = (10.0, 30.0, 100.0)  # names that the weights before count as
_EDGES = (0.0, 0.3, 0.6, 0.9, 1.01)


def main() -> None:
    """Read, fit, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, help="folders of outcomes")
    options = parser.parse_args()
    files = sorted(file for folder in options.folders for file in folder.glob("second_*.json"))
    if not files:
        asked = ", ".join(str(folder) for folder in options.folders)
        parser.exit(2, f"study_calibration: no outcome in {asked}; allowed: folders with second_*.json of a study\n")
    report([json.loads(file.read_text(encoding="utf-8")) for file in files])


def rows_of(outcomes: list[dict[str, Any]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the evidence of every name, whether it is right, and the number of its case, shapes (n, k), (n,), (n,)."""
    from fomrc_core.effects import effect_classes

    evidence, is_right, case = [], [], []
    for number, outcome in enumerate(outcomes):
        # what went before a record is no effect, and cannot be taken out
        right = accepted(outcome) - (set(outcome["spec"]["excluded"]) & set(effect_classes()))
        for found in outcome["findings"]:
            if "evidence" in found:
                evidence.append(found["evidence"])
                is_right.append(found["cause"] in right)
                case.append(number)
    return np.array(evidence, dtype=float), np.array(is_right, dtype=float), np.array(case)


def standing_weights() -> np.ndarray:
    """Return intercept and weights as they stand in belief.py, shape (1 + n_evidence,)."""
    from fomrc_core.diagnosis import belief

    return np.array([belief._INTERCEPT, *belief._WEIGHTS])


def fitted(evidence: np.ndarray, is_right: np.ndarray, about: np.ndarray, worth: float) -> np.ndarray:
    """Return intercept and weights of the logistic regression, shape (1 + n_evidence,).

    Args:
        evidence: of each name, shape (n, n_evidence).
        is_right: 1 where it is, shape (n,).
        about: the weights before, shape (1 + n_evidence,).
        worth: number of names they count as, by a ridge in units of the evidence's spread.
    """
    columns = np.column_stack((np.ones(len(evidence)), evidence))
    precision = worth * np.mean(columns**2, axis=0) * 0.25  # what so many names know where nobody knows anything

    def loss(weights: np.ndarray) -> float:
        odds = columns @ weights
        return float(
            np.sum(np.logaddexp(0.0, odds) - is_right * odds) + 0.5 * np.sum(precision * (weights - about) ** 2)
        )

    return np.asarray(minimize(loss, about, method="BFGS").x)


def told_by(weights: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Return the probabilities that weights tell, shape (n,)."""
    return np.asarray(1.0 / (1.0 + np.exp(-(weights[0] + evidence @ weights[1:]))))


def report(outcomes: list[dict[str, Any]]) -> None:
    """Print the weights, and the reliability in folds left out."""
    evidence, is_right, case = rows_of(outcomes)
    before = standing_weights()
    print(
        f"{len(is_right)} names in {len(set(case))} of {len(outcomes)} cases, {100.0 * np.mean(is_right):.0f} % right"
    )
    _print_reliability("as they stand", told_by(before, evidence), is_right)
    for worth in _PRIORS:
        told = np.zeros(len(is_right))
        for k in range(_FOLDS):
            is_out = case % _FOLDS == k
            told[is_out] = told_by(fitted(evidence[~is_out], is_right[~is_out], before, worth), evidence[is_out])
        weights = ", ".join(f"{w:.3f}" for w in fitted(evidence, is_right, before, worth))
        _print_reliability(f"prior worth {worth:.0f} names: {weights}", told, is_right)


def _print_reliability(title: str, told: np.ndarray, is_right: np.ndarray) -> None:
    mean = float(np.mean(is_right * np.log(told) + (1.0 - is_right) * np.log1p(-told)))
    print(f"{title}\n  mean logarithm of what is told of the truth {mean:.4f}")
    for low, high in pairwise(_EDGES):
        inside = (told >= low) & (told < high)
        if np.any(inside):
            share = 100.0 * float(np.mean(is_right[inside]))
            print(f"  told {low:.1f} to {min(high, 1.0):.1f}: {np.count_nonzero(inside)} names, {share:.0f} % right")


if __name__ == "__main__":
    main()
