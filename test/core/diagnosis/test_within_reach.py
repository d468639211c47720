"""Which causes that have begun are followed no further: those surely behind whatever they may still gain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.held_out_score import SURE, HeldOutScore
from fomrc_core.diagnosis.within_reach import MORE_ITERATIONS, Reach, may_be_found
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel

_MODEL = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0)


def _begun(squared_error: float, last_log_gain: float = 0.0) -> Refit:
    return Refit(_MODEL, squared_error, (), (), (), False, last_log_gain)


def test_beside_a_small_gain_one_is_behind_where_the_likelihood_says_so() -> None:
    n_independent = 1000.0
    reach = Reach(1.0, math.exp(-0.01), n_independent)
    # of so many samples a difference of this much in the logarithm of the squared error is one of SURE in likelihood
    sure = 2.0 * SURE / n_independent
    least = math.exp(-0.01)
    assert reach.holds(_begun(least * math.exp(0.9 * sure)))
    assert not reach.holds(_begun(least * math.exp(1.1 * sure)))
    # fewer samples are sure of less
    assert replace(reach, n_independent=500.0).holds(_begun(least * math.exp(1.1 * sure)))


def test_one_that_still_falls_is_followed() -> None:
    reach = Reach(1.0, math.exp(-0.2), 1e5)
    behind = math.exp(-0.05)
    assert not reach.holds(_begun(behind, last_log_gain=1e-4))
    assert reach.holds(_begun(behind, last_log_gain=0.1 / MORE_ITERATIONS))


@pytest.mark.parametrize(("gained", "largest"), [(1.0, 0.5), (10.0, math.log(4.0))])
def test_beside_a_large_gain_half_of_it_may_be_the_plays(gained: float, largest: float) -> None:
    reach = Reach(1.0, math.exp(-gained), 1e5)
    assert reach.log_ratio == pytest.approx(largest)


def test_beside_one_at_rest_nobody_is_followed_who_leaves_twice_as_much() -> None:
    reach = Reach(1.0, math.exp(-10.0), 1e5, is_beside_one_at_rest=True)
    assert reach.holds(_begun(1.9 * math.exp(-10.0)))
    assert not reach.holds(_begun(2.1 * math.exp(-10.0)))
    assert reach.holds(_begun(4.0 * math.exp(-10.0), last_log_gain=0.2)), "it still falls"


@pytest.mark.parametrize(("gained", "is_of_little"), [(0.5, True), (0.8, False)])
def test_one_at_rest_that_gains_little_has_bent_no_base(gained: float, is_of_little: bool) -> None:
    assert Reach(1.0, math.exp(-gained), 1e5, is_beside_one_at_rest=True).is_of_little is is_of_little
    assert not Reach(1.0, math.exp(-gained), 1e5).is_of_little, "none is at rest yet"


def test_one_that_has_fallen_behind_may_be_a_finding_on_held_out_data() -> None:
    nothing = HeldOutScore(0.0, 0.0, 0.5, 1.0, 1.0)
    assert not may_be_found(nothing, further=0.01)
    assert may_be_found(nothing, further=0.1), "were as much gained there as is foreseen in training"
    assert may_be_found(replace(nothing, log_gain=0.1), further=0.0)
    # what acts at a few moments is worthwhile there, and little everywhere
    assert may_be_found(replace(nothing, log_gain=0.01, local_log_gain=0.6), further=0.0)
    assert not may_be_found(replace(nothing, log_gain=-0.02, local_log_gain=0.6), further=0.01)
