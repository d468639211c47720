"""What an outcome of the second world scores."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from test.hidden.study_scores import Outcome, named

# What may be named beside a cause without being wrong: a stage with two modes has a resonance too.
_ALSO_TRUE: dict[str, tuple[str, ...]] = {"second_mode": ("mechanical_resonance",)}
# On a hysteresis that plays cannot be, the product's own names for what plays lack say nothing false.
_NAMES_OF_FORM = ("asymmetric_hysteresis", "missing_hysteresis", "rate_dependent_hysteresis")
# Plays can be a backlash, wholly, so that nothing found is a right answer to it.
ABSORBED = "backlash"
SURE = 0.9
# What the nearest other cause leaves of a hidden one, over the noise: below, no drive in the records tells them apart.
LEAST_DISTINCT = 0.5


def accepted(outcome: Outcome) -> set[str]:
    """Return all names that are not wrong."""
    spec = outcome["spec"]
    names = set(spec["causes"])
    for cause in spec["causes"]:
        names.update(_ALSO_TRUE.get(cause, ()))
    truth = outcome.get("truth", {})
    if not truth.get("is_representable", True) and truth.get("form_error_over_noise", 0.0) > 1.0:
        names.update(_NAMES_OF_FORM)
    return names


def wrong_names(outcome: Outcome) -> list[str]:
    """Return the names that are wrong; a cause that was taken out of the library cannot be named."""
    return [name for name in named(outcome) if name not in accepted(outcome)]


def is_wrong_and_explained(outcome: Outcome) -> bool:
    """Return whether a wrong name is called an explanation."""
    return outcome["status"] == "explained" and bool(wrong_names(outcome))


def is_first_right(outcome: Outcome) -> bool:
    """Return whether a true cause is named first."""
    names = named(outcome)
    return bool(names) and names[0] in accepted(outcome)


def is_first_or_open(outcome: Outcome) -> bool:
    """Return whether a true cause is first, or left open beside the first where these drives cannot tell them apart."""
    rival = outcome.get("truth", {}).get("rival")
    if is_first_right(outcome) or rival is None or rival["distinct_over_noise"] >= LEAST_DISTINCT:
        return is_first_right(outcome)
    open_ones = {*named(outcome), *outcome.get("ambiguous_with", [])} if outcome["status"] == "ambiguous" else set()
    return bool(open_ones & set(outcome["spec"]["causes"]))


def is_right_and_complete(outcome: Outcome) -> bool:
    """Return whether all that is hidden is named, and nothing wrong beside it."""
    return not wrong_names(outcome) and set(outcome["spec"]["causes"]) <= set(named(outcome))


def is_clean_null(outcome: Outcome) -> bool:
    """Return whether nothing is named and the status says that nothing was found."""
    return not named(outcome) and outcome["status"] == "nothing_found"


def excess(over_noise: float) -> float:
    """Return what is left beside the noise, over the noise: errors add in power."""
    return float(np.sqrt(max(over_noise**2 - 1.0, 0.0)))


def is_halved(outcome: Outcome) -> bool:
    """Return whether the third record's error is at least halved towards the noise."""
    if "report_over_noise_after" not in outcome:
        return False
    before, after = excess(outcome["report_over_noise_before"]), excess(outcome["report_over_noise_after"])
    return after <= 0.5 * before


def is_worse(outcome: Outcome) -> bool:
    """Return whether the extended model does worse on the third record by more than 5 %."""
    if "report_over_noise_after" not in outcome:
        return True
    return bool(outcome["report_over_noise_after"] > 1.05 * outcome["report_over_noise_before"])


def calibrated(outcomes: Iterable[Outcome]) -> list[tuple[float, bool]]:
    """Return the probability of every name that carries one, and whether the name is right."""
    return [
        (float(found["probability"]), found["cause"] in accepted(outcome))
        for outcome in outcomes
        for found in outcome["findings"]
        if found.get("probability") is not None
    ]


def cpu_seconds(outcomes: Iterable[Outcome]) -> list[float]:
    """Return the processor time of every diagnosis that ended [s]."""
    return [float(o["cpu_s"]) for o in outcomes if "cpu_s" in o]


def errors_of(outcomes: Iterable[Outcome], cause: str | None = None) -> list[float]:
    """Return the relative errors of main parameters of true findings, of one cause or of all."""
    found: list[Any] = [f for o in outcomes for f in o["findings"] if f.get("parameter_error") is not None]
    return [float(f["parameter_error"]) for f in found if cause is None or f["cause"] == cause]
