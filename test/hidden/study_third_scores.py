"""What an outcome of the third world scores."""

from __future__ import annotations

from collections.abc import Iterable

from test.hidden.study_scores import Outcome, is_exact, named

# What plays cannot be is truly said by the names of what plays lack.
_NAMES_OF_FORM = frozenset({"asymmetric_hysteresis", "missing_hysteresis"})
# From here on a name is taken for sure.
SURE = 0.9


def accepted(outcome: Outcome) -> frozenset[str]:
    """Return all names that are not wrong."""
    if outcome["spec"]["group"] == "forms":
        return _NAMES_OF_FORM
    return frozenset(outcome["spec"]["causes"])


def wrong_names(outcome: Outcome) -> list[str]:
    """Return the names that are wrong."""
    return [name for name in named(outcome) if name not in accepted(outcome)]


def is_wrong_and_explained(outcome: Outcome) -> bool:
    """Return whether a wrong name is called an explanation."""
    return outcome["status"] == "explained" and bool(wrong_names(outcome))


def is_clean_null(outcome: Outcome) -> bool:
    """Return whether nothing is named and the status says that nothing was found."""
    return not named(outcome) and outcome["status"] == "nothing_found"


def has_all(outcome: Outcome) -> bool:
    """Return whether all that is hidden is named."""
    return set(outcome["spec"]["causes"]) <= set(named(outcome))


def is_exact_and_explained(outcome: Outcome) -> bool:
    """Return whether just what is hidden is named, and called an explanation."""
    return is_exact(outcome) and outcome["status"] == "explained"


def is_left_open(outcome: Outcome) -> bool:
    """Return whether nothing is called an explanation, and no wrong name is given as sure."""
    if outcome["status"] in ("explained", "error"):
        return False
    return all(p < SURE for p, is_right in calibrated([outcome]) if not is_right)


def is_overlooked(outcome: Outcome) -> bool:
    """Return whether nothing was found."""
    return bool(outcome["status"] == "nothing_found")


def calibrated(outcomes: Iterable[Outcome]) -> list[tuple[float, bool]]:
    """Return the probability of every name that carries one, and whether the name is right."""
    return [
        (float(found["probability"]), found["cause"] in accepted(outcome))
        for outcome in outcomes
        for found in outcome["findings"]
        if found.get("probability") is not None
    ]
