"""The confusion matrix: what was hidden against what was answered first."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from test.hidden.effects import CAUSES
from test.hidden.study_scores import Outcome, answer

_WORDS = ("ambiguous", "unexplained", "explained", "suspect", "error")


def confusion(outcomes: list[Outcome]) -> tuple[list[str], list[str], np.ndarray]:
    """Return rows (hidden), columns (answered first) and counts over nulls and single effects."""
    rows = ["nothing", *CAUSES]
    others = sorted({answer(outcome) for outcome in outcomes} - {"nothing_found", *CAUSES, *_WORDS})
    columns = ["nothing_found", *CAUSES, *others, *_WORDS]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for outcome in outcomes:
        hidden = outcome["spec"]["causes"]
        counts[rows.index(hidden[0] if hidden else "nothing"), columns.index(answer(outcome))] += 1
    kept = [j for j, name in enumerate(columns) if name in CAUSES or name == "nothing_found" or counts[:, j].any()]
    return rows, [columns[j] for j in kept], counts[:, kept]


def write_confusion(outcomes: list[Outcome], folder: Path) -> None:
    """Write the confusion matrix as figure and table."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows, columns, counts = confusion(outcomes)
    with (folder / "confusion_matrix.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["hidden", *columns])
        writer.writerows([name, *map(int, line)] for name, line in zip(rows, counts, strict=True))
    figure, axes = plt.subplots(figsize=(10.5, 9.0), layout="constrained")
    shares = counts / np.maximum(1, counts.sum(axis=1, keepdims=True))
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(
            j,
            i,
            str(counts[i, j]),
            ha="center",
            va="center",
            color="white" if shares[i, j] > 0.5 else "black",
        )
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("answered first")
    axes.set_ylabel("hidden")
    figure.savefig(folder / "confusion_matrix.png", dpi=130)
    plt.close(figure)
