"""What is written does no worse than the base, where causes are chosen and where it is quoted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fomrc_core.diagnosis import extended_model
from fomrc_core.diagnosis.extended_model import never_worse
from fomrc_core.diagnosis.search import SearchResult


def _kept(
    monkeypatch: pytest.MonkeyPatch, held_um: dict[str, float], quoted_um: dict[str, float], n_records: int = 2
) -> tuple[int, bool]:
    """Return how many of two findings stand, and whether the base does, for errors of each model."""
    parts = [SimpleNamespace(index=1, left=held_um), SimpleNamespace(index=n_records - 1, left=quoted_um)]
    split = SimpleNamespace(held=(parts[0],), report=(parts[1],), train=("train",))
    monkeypatch.setattr(extended_model, "held_residuals", lambda m, part: [np.full(10, part[0].left[m])])
    monkeypatch.setattr(extended_model, "quoted_residuals", lambda m, part: [np.full(10, part[0].left[m])])
    monkeypatch.setattr(extended_model, "_extend", lambda model, _: extended_model.Extension(None, model))
    monkeypatch.setattr(extended_model, "_fitted", lambda model, *_: extended_model.Extension(None, model))
    monkeypatch.setattr(extended_model, "refit", lambda model, *_, **__: SimpleNamespace(model=model))
    monkeypatch.setattr(extended_model, "on_same_grid", lambda model, *_: model)
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


def test_what_a_third_record_denies_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    held, quoted = {"base": 3.0, "one": 2.0, "two": 1.0}, {"base": 3.0, "one": 2.0, "two": 2.5}
    assert _kept(monkeypatch, held, quoted, n_records=3) == (1, False)
    # the record that chose between the two has said so already
    assert _kept(monkeypatch, held, quoted, n_records=2) == (2, False)
    assert _kept(monkeypatch, held, {**quoted, "two": 2.05}, n_records=3) == (2, False), "a little is no denial"


@pytest.mark.parametrize(("held", "quoted", "is_kept"), [(1.0, 1.0, True), (1.0, 2.3, False), (3.1, 1.0, False)])
def test_a_fit_beside_noise_that_wanders_is_kept_where_nothing_is_surely_worse(
    monkeypatch: pytest.MonkeyPatch, held: float, quoted: float, is_kept: bool
) -> None:
    held_um, quoted_um = {"base": 3.0, "plain": 1.1, "quick": held}, {"base": 3.0, "plain": 1.0, "quick": quoted}
    split = SimpleNamespace(held=held_um, report=quoted_um)
    monkeypatch.setattr(extended_model, "held_residuals", lambda m, part: [np.full(10, part[m])])
    monkeypatch.setattr(extended_model, "quoted_residuals", lambda m, part: [np.full(10, part[m])])
    monkeypatch.setattr(extended_model, "_by_least_squares", lambda *_: extended_model.Extension(None, "plain"))
    monkeypatch.setattr(extended_model, "beside_wander", lambda *_: "quick")
    monkeypatch.setattr(extended_model, "as_written", lambda *_: None)
    assert extended_model._fitted("found", "base", split).trial == ("quick" if is_kept else "plain")
