"""How good answers are: detection, false alarms, and the probability given to the true cause.

The measures are those of the LiU-ICE competition on fault diagnosis (D. Jung, E. Frisk, M. Krysander, "The LiU-ICE
benchmark", 2024), for whole records in place of moments.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from challenge.answers import Answer
from challenge.files import Truth


@dataclass(frozen=True)
class CauseScore:
    """Score over the cases that hide one cause, alone or beside others.

    Args:
        n_hidden: cases.
        n_detected: of them, with an alarm.
        true_probability: given to this cause on average; of a case with several, what is given to all of them.
    """

    n_hidden: int
    n_detected: int
    true_probability: float


@dataclass(frozen=True)
class Score:
    """Score of somebody's answers.

    Args:
        n_cases: cases there are.
        n_answered: cases with an answer; the others count as nothing detected.
        n_hidden: cases that hide something.
        n_detected: of them, with an alarm.
        n_empty: cases that hide nothing.
        n_false_alarms: of them, with an alarm.
        true_probability: given to what is hidden on average over cases that hide something, 0 where undetected.
        n_first: cases that hide something in which a true cause has the largest probability, alone.
        by_cause: the same for each cause.
    """

    n_cases: int
    n_answered: int
    n_hidden: int
    n_detected: int
    n_empty: int
    n_false_alarms: int
    true_probability: float
    n_first: int
    by_cause: Mapping[str, CauseScore] = field(default_factory=dict)


def score(truths: Mapping[str, Truth], answers: Mapping[str, Answer]) -> Score:
    """Return the score of answers.

    Args:
        truths: the key, by case.
        answers: what somebody says, by case; a case left out counts as nothing detected.
    """
    said = {name: answers.get(name, Answer(False)) for name in truths}
    hidden = {name: truth.causes for name, truth in truths.items() if truth.causes}
    empty = [name for name, truth in truths.items() if not truth.causes]
    by_cause = {}
    for cause in sorted({c for causes in hidden.values() for c in causes}):
        mine = {name: causes for name, causes in hidden.items() if cause in causes}
        by_cause[cause] = CauseScore(
            n_hidden=len(mine),
            n_detected=sum(said[name].is_detected for name in mine),
            true_probability=_mean(_given(said[name], causes) for name, causes in mine.items()),
        )
    return Score(
        n_cases=len(truths),
        n_answered=sum(name in answers for name in truths),
        n_hidden=len(hidden),
        n_detected=sum(said[name].is_detected for name in hidden),
        n_empty=len(empty),
        n_false_alarms=sum(said[name].is_detected for name in empty),
        true_probability=_mean(_given(said[name], causes) for name, causes in hidden.items()),
        n_first=sum(_is_first(said[name], causes) for name, causes in hidden.items()),
        by_cause=by_cause,
    )


def _given(answer: Answer, causes: tuple[str, ...]) -> float:
    """Return the probability an answer gives to what is hidden; nothing detected is nothing given."""
    return sum(answer.probabilities.get(cause, 0.0) for cause in causes) if answer.is_detected else 0.0


def _is_first(answer: Answer, causes: tuple[str, ...]) -> bool:
    if not answer.is_detected:
        return False
    best = max((answer.probabilities.get(cause, 0.0) for cause in causes), default=0.0)
    others = (p for cause, p in answer.probabilities.items() if cause not in causes)
    return best > 0.0 and all(p < best for p in others)


def _mean(values: Iterable[float]) -> float:
    kept = list(values)
    return sum(kept) / len(kept) if kept else 0.0
