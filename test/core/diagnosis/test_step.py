"""An acceptance and what it is tied with."""

from __future__ import annotations

import math
from typing import Any

from fomrc_core.diagnosis.step import Step


def test_a_tie_with_what_was_found_as_well_is_none():
    models: Any = ("with a", "with b")
    step = Step(None, None, ("a", "b"), models)  # type: ignore[arg-type]  # neither is looked at
    kept = step.tied_but_for(frozenset({"a", "c"}))
    assert kept.tied == ("b",)
    assert kept.tied_models == ("with b",)
    assert math.isnan(step.margin), "not compared, it has no margin"
