"""Answers to a challenge, read and checked."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from challenge.composition import CAUSES
from challenge.files import ChallengeError

_ROUNDING = 1e-6  # by which probabilities may add up to more than 1


@dataclass(frozen=True)
class Answer:
    """What somebody says of a case.

    Args:
        is_detected: whether anything is hidden.
        probabilities: of causes, together at most 1.
    """

    is_detected: bool
    probabilities: Mapping[str, float] = field(default_factory=dict)


def read_answers(path: Path, cases: Collection[str]) -> dict[str, Answer]:
    """Return the answers of a JSON file by case.

    Args:
        path: the file.
        cases: names of the cases there are.

    Raises:
        ChallengeError: whatever is wrong, with file, case, value and what is allowed.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ChallengeError(f"{path}: {error}; allowed: a JSON file") from error
    if not isinstance(content, dict):
        raise ChallengeError(f"{path}: {type(content).__name__}; allowed: an object with a block for each case")
    answers = {}
    for name, block in content.items():
        if name not in cases:
            raise ChallengeError(f"{path}: {name}: no such case; allowed: {min(cases)} to {max(cases)}")
        answers[name] = _checked(block, f"{path}: {name}")
    return answers


def _checked(block: Any, where: str) -> Answer:
    if not isinstance(block, dict) or not isinstance(block.get("detected"), bool):
        raise ChallengeError(f"{where}: detected: {block!r:.60}; allowed: true or false")
    if unknown := set(block) - {"detected", "probabilities"}:
        raise ChallengeError(f"{where}: {min(unknown)}: unknown; allowed: detected, probabilities")
    given = block.get("probabilities", {})
    if not isinstance(given, dict):
        raise ChallengeError(f"{where}: probabilities: {given!r:.60}; allowed: an object of numbers by cause")
    for cause, value in given.items():
        if cause not in CAUSES:
            raise ChallengeError(f"{where}: probabilities: {cause}: no such cause; allowed: {', '.join(CAUSES)}")
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not 0.0 <= value <= 1.0:
            raise ChallengeError(f"{where}: probabilities: {cause}: {value!r}; allowed: 0 to 1")
    total = math.fsum(given.values())
    if total > 1.0 + _ROUNDING:
        raise ChallengeError(f"{where}: probabilities: together {total:g}; allowed: at most 1")
    return Answer(block["detected"], {cause: float(value) for cause, value in given.items()})
