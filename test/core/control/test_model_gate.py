"""The gate of a calibration: a sound stage passes, on a busy machine too; a broken one does not."""

from __future__ import annotations

import numpy as np
import pytest
from small_model import MODEL

from fomrc_core.control.model_gate import outlier_share, why_refused
from fomrc_core.control.plausible_model import check_plausible
from fomrc_core.errors import ParameterError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records import excitation
from fomrc_core.records.recording import Recording

RATE_HZ = 500.0
TRUTH = PiezoModel.from_mapping(MODEL)


def recorded(spoil=lambda moved, random: moved, noise_um: float = 1e-3) -> Recording:
    triangle = excitation.triangle(1.0, slope_v_per_s=5.0, rate_hz=RATE_HZ).voltage_v
    staircase = excitation.staircase(1.0, step_v=0.5, dwell_s=0.2, rate_hz=RATE_HZ).voltage_v
    voltage_v = np.concatenate((triangle, staircase))
    random = np.random.default_rng(2)
    moved = TRUTH.simulate(np.full(voltage_v.size, 1.0 / RATE_HZ), voltage_v)
    moved = spoil(moved + noise_um * random.standard_normal(moved.size), random)
    return Recording(np.arange(voltage_v.size) / RATE_HZ, voltage_v, moved, name="test")


def with_outliers(share: float):
    return lambda moved, random: moved + (random.random(moved.size) < share) * random.choice([-1.0, 1.0], moved.size)


def late_at_times(moved, random):
    """Give a tenth of the samples the displacement of up to four samples before."""
    late = np.where(random.random(moved.size) < 0.1, random.integers(1, 5, moved.size), 0)
    return moved[np.maximum(np.arange(moved.size) - late, 0)]


@pytest.mark.parametrize("spoil", [lambda moved, random: moved, late_at_times], ids=["sound", "late at times"])
def test_the_truth_passes(spoil):
    assert why_refused(TRUTH, recorded(spoil)) == ""


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda moved, random: random.standard_normal(moved.size), "unexplained"),
        (lambda moved, random: -moved, "falls as the voltage rises"),
        (lambda moved, random: np.where(np.arange(moved.size) > 900, moved[900], moved), "unexplained"),
        (with_outliers(0.01), "outliers"),
        (lambda moved, random: np.zeros(moved.size), "did not move"),
    ],
    ids=["noise", "reversed", "stuck", "outliers", "dead"],
)
def test_what_a_broken_sensor_gives_does_not(spoil, said):
    # Whichever sign the slope of pure noise happens to have, it is refused; the reason may be either.
    reason = why_refused(TRUTH, recorded(spoil))
    assert said in reason or (said == "unexplained" and "falls" in reason)


def test_a_few_outliers_in_ten_thousand_are_let_pass():
    assert why_refused(TRUTH, recorded(with_outliers(2e-4))) == ""


def test_a_model_worse_than_the_one_in_force_is_refused():
    worse = PiezoModel.from_mapping(MODEL | {"creep_order": 0.03})
    assert why_refused(worse, recorded()) == ""
    assert "worse than the model in force" in why_refused(worse, recorded(), in_force=TRUTH)
    assert why_refused(TRUTH, recorded(), in_force=worse) == ""
    assert why_refused(TRUTH, recorded(), in_force=TRUTH) == ""


@pytest.mark.parametrize(
    "change",
    [
        {"kappa_um_per_v": [20.0, 12.0, 1e308, 1.4]},
        {"kappa_um_per_v": [20.0, 12.0, 9.0, 1e5]},
        {"kappa_um_per_v": [1e-5, 12.0, 9.0, 1.4]},
        {"saturation_v": [0.02, 0.07, 1e5]},
        {"creep_order": 0.5},
    ],
)
def test_what_no_piezo_has_is_implausible(change):
    with pytest.raises(ParameterError, match="implausible"):
        check_plausible(PiezoModel.from_mapping(MODEL | change))


def test_a_model_that_errs_for_a_while_has_no_outliers():
    """A stretch in which a voltage was held up: 60 of 3000 samples are off by forty times the noise, together."""
    generator = np.random.default_rng(7)
    error_um = 1e-3 * generator.standard_normal(3000)
    error_um[1000:1060] += 0.04 * np.exp(-np.arange(60) / 40.0)
    still_um = np.zeros(3000)
    assert outlier_share(error_um, still_um) == 0.0
    error_um[generator.choice(3000, 30, replace=False)] += 0.1
    assert outlier_share(error_um, still_um) == pytest.approx(0.01, abs=1e-3)
