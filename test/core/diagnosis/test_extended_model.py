"""What is written does no worse than the base, where causes are chosen and where it is quoted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fomrc_core.diagnosis import extended_model
from fomrc_core.diagnosis.extended_model import never_worse
from fomrc_core.diagnosis.search import SearchResult


def _kept(monkeypatch: pytest.MonkeyPatch, held_um: dict[str, float], quoted_um: dict[str, float]) -> tuple[int, bool]:
    """Return how many of two findings stand, and whether the base does, for errors of each model."""
    split = SimpleNamespace(held="held", report="quoted", train=())
    left = {"held": held_um, "quoted": quoted_um}
    monkeypatch.setattr(extended_model, "held_residuals", lambda model, part: [np.full(10, left[part][model])])
    monkeypatch.setattr(extended_model, "_extend", lambda model, _: extended_model.Extension(None, model))
    monkeypatch.setattr(extended_model, "_fitted", lambda model, _: extended_model.Extension(None, model))
    monkeypatch.setattr(extended_model, "refit", lambda model, *_, **__: SimpleNamespace(model=model))
    monkeypatch.setattr(extended_model, "follow_held", lambda model, _: model)
    steps = tuple(SimpleNamespace(before=before, accepted=after) for before, after in (("base", "one"), ("one", "two")))
    found, extension = never_worse(SearchResult("two", steps, None, (), None), "base", split)
    return len(found.steps), extension.is_base


def test_a_finding_that_does_worse_where_it_is_quoted_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    held = {"base": 3.0, "one": 2.0, "two": 1.0}
    assert _kept(monkeypatch, held, {"base": 3.0, "one": 2.0, "two": 1.0}) == (2, False)
    assert _kept(monkeypatch, held, {"base": 3.0, "one": 2.0, "two": 30.0}) == (1, False)
    assert _kept(monkeypatch, held, {"base": 3.0, "one": 9.0, "two": 30.0}) == (0, True)
    assert _kept(monkeypatch, held, {"base": 3.0, "one": 2.0, "two": 3.1}) == (2, False), (
        "as good, as far as one can tell"
    )
    assert _kept(monkeypatch, {**held, "two": 3.1}, {"base": 3.0, "one": 2.0, "two": 1.0}) == (1, False)
