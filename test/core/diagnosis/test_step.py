"""An acceptance and what it is tied with."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from fomrc_core.diagnosis.step import Step


def test_a_tie_with_what_was_found_as_well_is_none():
    models: Any = ("with a", "with b")
    step = Step(None, None, ("a", "b"), models)  # type: ignore[arg-type]  # neither is looked at
    kept = step.tied_but_for(frozenset({"a", "c"}))
    assert kept.tied == ("b",)
    assert kept.tied_models == ("with b",)
    assert math.isnan(step.margin), "not compared, it has no margin"


def test_what_is_left_uncompared_has_no_margin_and_stays_as_it_is_else():
    models: Any = ("with a",)
    step = Step(None, None, ("a",), models, margin=12.0, whitened_margin=9.0).uncompared()  # type: ignore[arg-type]
    assert math.isnan(step.margin)
    assert math.isnan(step.whitened_margin)
    assert step.tied == ("a",)


@pytest.mark.parametrize(
    ("cause", "margin", "tied", "is_bound", "is_beaten"),
    [
        ("transport_delay", -40.0, (), False, True),
        ("transport_delay", -4.0, (), False, False),
        ("transport_delay", 40.0, (), False, False),
        ("transport_delay", math.nan, (), False, False),
        ("transport_delay", -40.0, ("sensor_bandwidth",), False, False),
        ("thermal_drift", -40.0, (), True, False),
        ("asymmetric_hysteresis", -40.0, (), False, False),
    ],
)
def test_a_name_that_another_surely_beats_is_beaten_where_it_was_weighed_at_the_end(
    cause, margin, tied, is_bound, is_beaten
):
    accepted: Any = SimpleNamespace(cause=cause, is_bound=is_bound)
    before: Any = None
    step = Step(before, accepted, tied, (), margin=margin)
    assert step.is_beaten is is_beaten
