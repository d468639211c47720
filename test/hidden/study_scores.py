"""What an outcome of the study scores."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

Outcome = dict[str, Any]


def load(folder: Path) -> list[Outcome]:
    """Read all outcomes."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def named(outcome: Outcome) -> list[str]:
    """Return the causes named, in order."""
    return [found["cause"] for found in outcome["findings"]]


def is_first(outcome: Outcome) -> bool:
    """Return whether a true cause is named first."""
    names = named(outcome)
    return bool(names) and names[0] in outcome["spec"]["causes"]


def is_exact(outcome: Outcome) -> bool:
    """Return whether just the true causes are named."""
    return sorted(named(outcome)) == sorted(outcome["spec"]["causes"])


def n_false(outcome: Outcome) -> int:
    """Return how many names are not true."""
    return sum(name not in outcome["spec"]["causes"] for name in named(outcome))


def is_misled(outcome: Outcome) -> bool:
    """Return whether a wrong cause is named and the true one is not left open beside it."""
    if n_false(outcome) == 0:
        return False
    left_open = {*named(outcome), *outcome.get("ambiguous_with", [])} if outcome["status"] == "ambiguous" else set()
    return not left_open & set(outcome["spec"]["causes"])


def answer(outcome: Outcome) -> str:
    """Return the answer in a word: the first name, or the status."""
    names = named(outcome)
    return names[0] if names else str(outcome["status"])


def main_errors(outcomes: Iterable[Outcome]) -> list[float]:
    """Return the relative errors of the main parameters of true findings, where they can be compared."""
    return [
        found["parameter_error"]
        for outcome in outcomes
        for found in outcome["findings"]
        if found.get("parameter_error") is not None
    ]


def share(outcomes: list[Outcome], test: Callable[[Outcome], bool]) -> str:
    """Return how many pass a test, in words."""
    hits = sum(map(test, outcomes))
    return f"{hits}/{len(outcomes)} ({100.0 * hits / len(outcomes):.0f} %)"


def by_noise(outcomes: list[Outcome]) -> list[tuple[float, list[Outcome]]]:
    """Return the outcomes of each noise level [um], rising."""
    levels = sorted({o["spec"]["noise_um"] for o in outcomes})
    return [(level, [o for o in outcomes if o["spec"]["noise_um"] == level]) for level in levels]
