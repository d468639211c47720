"""How sure a name is told."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from fomrc_core.diagnosis.belief import evidence_of, probability_of_unknown, sureness_of, with_probabilities
from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import LEAST_OF_BENDING, LEAST_OF_EACH, Judgement, Status
from fomrc_core.diagnosis.remainder import Dependence

_NOISE = Judgement(1.0, True, 0.0, (), ())
_MORE = Judgement(1.0, False, 0.3, (), ("it is 3 times the noise",))


def _told(margin: float, judgement: Judgement, whitened: float | None = None, cause: str = "transport_delay") -> float:
    margins = margin, margin if whitened is None else whitened
    finding = Finding(cause, {}, {}, 2.0, 1.0, 0.5, 1e-6, "", "", *margins)
    return with_probabilities((finding,), judgement)[0].probability


def _log_odds(probability: float) -> float:
    return math.log(probability / (1.0 - probability))


@pytest.mark.parametrize("judgement", [_NOISE, _MORE])
def test_a_larger_margin_is_never_told_less(judgement: Judgement) -> None:
    told = [_told(margin, judgement) for margin in (-1e6, -300.0, -10.0, -1.0, 0.0, 1.0, 10.0, 300.0, 1e6)]
    assert told == sorted(told)
    assert all(0.0 < value < 1.0 for value in told)
    assert _told(-50.0, judgement) < _told(math.nan, judgement) < _told(50.0, judgement), "not compared is in between"


def test_what_noise_that_wanders_hides_of_a_margin_the_whitened_one_tells() -> None:
    assert _told(8.0, _NOISE, -20.0) < _told(8.0, _NOISE, math.nan) < _told(8.0, _NOISE, 2000.0)


def test_the_same_margin_says_more_where_noise_is_left() -> None:
    assert all(_told(margin, _NOISE) > _told(margin, _MORE) for margin in (0.3, 3.0, 30.0))
    assert _told(0.0, _NOISE) == _told(0.0, _MORE), "no margin is none, whatever is left"
    assert _told(-30.0, _MORE) < 0.5 < _told(3000.0, _MORE)
    gained = [_told(30.0, judgement) - _told(0.0, judgement) for judgement in (_NOISE, _MORE)]
    assert gained[0] > gained[1] + 0.1, "of two models that are both wrong the likelier one says less"
    # as far as a margin reaches, where a probability near one can gain no more
    gained = [_log_odds(_told(3000.0, judgement)) - _log_odds(_told(3.0, judgement)) for judgement in (_NOISE, _MORE)]
    assert gained[0] > gained[1]
    assert _told(-30.0, _NOISE) < _told(-30.0, _MORE), "and the same of what another beats"


def _told_after(after: float, cause: str) -> float:
    finding = Finding(cause, {}, {}, 1.0, after, 0.5, 1e-6, "", "", 100.0, 100.0)
    return with_probabilities((finding,), _NOISE)[0].probability


def test_what_befell_a_record_is_asked_what_it_mends_of_that_record() -> None:
    of_all = Finding("initial_state", {}, {}, 1.0, 0.98, 0.5, 1e-6, "", "", 100.0, 100.0)
    of_one = [replace(of_all, own_log_gain=gain) for gain in (0.0, 0.3, 1.0, 5.0)]
    told = [with_probabilities((finding,), _NOISE)[0].probability for finding in (of_all, *of_one)]
    assert told[0] == told[1] < told[2] < told[3] == told[4]
    # and one that acts in the quoted record as well is no less sure
    gained = replace(of_all, nrmse_percent_test_after=0.3)
    assert with_probabilities((replace(gained, own_log_gain=0.1),), _NOISE)[0].probability == told[4]


def test_what_mends_little_may_mend_what_the_model_of_the_others_gets_wrong() -> None:
    told = [_told_after(after, "thermal_drift") for after in (1.0, 0.95, 0.8, 0.5, 1e-3)]
    assert told[0] < told[1] < told[2] < told[3] == told[4]
    explains = [
        _NOISE.status([_told_after(after, "thermal_drift")], False) is Status.EXPLAINED for after in (0.95, 0.5)
    ]
    assert explains == [False, True], "no explanation rests on what mends a tenth of the power"


def test_a_form_that_follows_what_others_do_is_believed_less_where_it_mends_little() -> None:
    # a drift follows whatever is slow, a dead zone only what stands about zero
    assert _told_after(0.9, "thermal_drift") < 0.75 < _told_after(0.9, "dead_zone"), "asked for by an explanation"
    assert _told_after(0.9, "dead_zone") == _told_after(0.3, "dead_zone")


def test_what_is_left_speaks_against_a_name_where_it_surely_follows_the_drive_however_little_it_is() -> None:
    def told(p_value: float) -> float:
        return _told(30.0, replace(_NOISE, dependences=(Dependence("rate", 1e-3, p_value),)))

    assert told(0.0) == told(1e-9) < told(1e-3) < told(0.5) < told(1.0) == _told(30.0, _NOISE)


def test_nothing_found_and_more_than_noise_left_is_most_likely_something_unknown() -> None:
    assert probability_of_unknown(_MORE, ()) > 0.5 > probability_of_unknown(_NOISE, ())


def test_evidence_is_finite_and_odd_in_the_margin() -> None:
    of = lambda margin: evidence_of(Finding("dead_zone", {}, {}, 2.0, 1.0, 0.5, 0.0, "", "", margin), _MORE)  # noqa: E731
    assert of(25.0)[0] == -of(-25.0)[0] > 0.0
    assert of(math.nan)[0] == 0.0
    assert all(math.isfinite(value) for value in of(math.inf))


def test_a_name_of_an_axis_is_asked_as_that_of_a_stage_and_one_of_several_axes_as_any() -> None:
    of_axis = SimpleNamespace(cause="thermal_drift", probability=0.89)
    of_all = SimpleNamespace(cause="cross_coupling", probability=0.89)
    probabilities, asked = sureness_of([of_all, of_axis])
    assert probabilities == (0.89, 0.89)
    assert asked == (LEAST_OF_EACH, LEAST_OF_BENDING)
    assert _NOISE.status(probabilities[:1], False, asked=asked[:1]) is Status.EXPLAINED
    assert _NOISE.status(probabilities[1:], False, asked=asked[1:]) is Status.SUSPECT
