"""What terms without a name follow is no noise."""

from __future__ import annotations

import pytest

from fomrc_core.diagnosis.followed_rest import may_be_followed, unless_followed
from fomrc_core.diagnosis.judgement import judge
from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension

_SLOW_NOISE = judge(0.3, False, 5.0, 1.0, 1.0, ())


def _followed(after_um: float) -> UnnamedExtension:
    return UnnamedExtension((), "depends on swings of the drive at 3 Hz", 1.0, after_um, 1e-9)


@pytest.mark.parametrize(("after_um", "is_noise"), [(0.72, True), (0.7, False)])
def test_where_terms_follow_more_than_half_of_its_power_it_is_none(after_um: float, is_noise: bool) -> None:
    assert _SLOW_NOISE.is_noise
    found = unless_followed(_SLOW_NOISE, _followed(after_um))
    assert found.is_noise is is_noise
    assert is_noise or "terms without a name follow 51 % of its power (p 1e-09)" in found.reasons


def test_nothing_followed_and_what_is_no_noise_anyway_stay_as_they_are() -> None:
    assert unless_followed(_SLOW_NOISE, None) is _SLOW_NOISE
    left = judge(0.3, True, 5.0, 1.0, 1.0, ())
    assert unless_followed(left, _followed(0.1)) is left


def test_it_is_asked_only_where_half_of_the_power_may_be_more_than_the_known_noise() -> None:
    assert may_be_followed(1.5, 1.0)
    assert not may_be_followed(1.4, 1.0)
