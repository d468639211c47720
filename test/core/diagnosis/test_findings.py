"""A form whose parameters the data do not tell from nothing is no name."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.findings import Finding, findings_of
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects import Effect
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording


@pytest.mark.parametrize(
    ("cause", "parameters", "errors", "is_undetermined"),
    [
        (
            "second_mode",
            {"frequency_hz": 0.2, "participation": 3e-4},
            {"frequency_hz": 0.01, "participation": 2e-3},
            True,
        ),
        (
            "second_mode",
            {"frequency_hz": 0.2, "participation": 0.3},
            {"frequency_hz": 0.01, "participation": 2e-3},
            False,
        ),
        # one of its terms is told
        ("thermal_drift", {"um_per_s": 1e-3, "um_per_s2": 1e-5}, {"um_per_s": 1e-3, "um_per_s2": 1e-6}, False),
        ("thermal_drift", {"um_per_s": 1e-3, "um_per_s2": 1e-7}, {"um_per_s": 1e-3, "um_per_s2": 1e-6}, True),
        # a reach a thousandth of its error wide is that of creep in proportion
        (
            "amplitude_dependent_creep",
            {"switched_per_decade": 0.01, "reach_um": 1e-9},
            {"switched_per_decade": 6e-4, "reach_um": 1e-6},
            True,
        ),
        ("amplifier_bandwidth", {"cutoff_hz": 100.0}, {"cutoff_hz": 400.0}, True),
        ("amplifier_bandwidth", {"cutoff_hz": 100.0}, {"cutoff_hz": 60.0}, True),
        ("amplifier_bandwidth", {"cutoff_hz": 100.0}, {"cutoff_hz": 40.0}, False),
        ("amplifier_bandwidth", {"cutoff_hz": 100.0}, {"cutoff_hz": math.inf}, True),
        ("amplifier_bandwidth", {"cutoff_hz": 100.0}, {}, False),
        # plays of its own, and a past that need not be known to act
        ("asymmetric_hysteresis", {"warp_per_v": 1e-4}, {"warp_per_v": 1e-3}, False),
        ("initial_state", {"extreme_v": 3.0, "held_s": 1e-9}, {"extreme_v": 0.1, "held_s": 1.0}, False),
    ],
)
def test_sizes_and_scales_within_two_of_their_errors(cause, parameters, errors, is_undetermined):
    finding = Finding(cause, parameters, errors, 2.0, 1.0, 0.5, 1e-6, "", "")
    assert finding.is_undetermined is is_undetermined
    assert ("no larger than twice their errors" in finding.sentence_of_stand_in()) is is_undetermined


def test_a_relaxation_is_a_term_of_a_law_of_creep_and_a_name_where_there_is_none():
    law = Finding("creep_law", {"per_decade": 0.1}, {}, 2.0, 1.0, 0.5, 1e-6, "", "")
    relaxation = Finding("slow_relaxation", {"amplitude": 0.1, "time_constant_s": 3.0}, {}, 1.0, 0.5, 0.5, 1e-6, "", "")
    other = Finding("mains_hum", {"frequency_hz": 50.0}, {}, 2.0, 1.0, 0.5, 1e-6, "", "")
    assert relaxation.wider_of((law, relaxation)) == relaxation.wider_of((relaxation, law)) == "creep_law"
    assert relaxation.wider_of((relaxation, other)) == ""
    assert law.wider_of((law, relaxation)) == ""
    assert "one more term of creep_law" in relaxation.sentence_of_term("creep_law")


def _relaxed_and_bent(seed: int) -> Recording:
    """A straight line with a slow share of itself beside it, read by a bent sensor."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(4000) * 2e-3
    voltage_v = np.sum([np.sin(2.0 * np.pi * f * time_s + p) for f, p in rng.uniform(0.2, 6.0, (5, 2))], axis=0)
    slow_v = lfilter([1.0 - np.exp(-2e-3 / 0.3)], [1.0, -np.exp(-2e-3 / 0.3)], voltage_v)
    moved_um = 2.0 * (voltage_v + 0.03 * slow_v)
    return Recording(time_s, voltage_v, moved_um + 0.05 * moved_um**2 + rng.normal(0.0, 5e-3, time_s.size))


def test_what_bends_to_much_is_asked_what_it_takes_beside_all_the_others() -> None:
    split = split_data((_relaxed_and_bent(1),), _relaxed_and_bent(2), _relaxed_and_bent(3), 5e-3)
    base = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((), (), ()))

    def found(before: TrialModel, cause: Effect) -> Candidate:
        fitted = fit_until_still(before.with_cause(cause), split.train, None)
        return candidate_of(PresentModel.of(before, split), split, cause.name, fitted, bound=False)

    slow = found(base, SlowRelaxation(0.03, 0.3))
    bent = found(slow.fitted.model, SensorNonlinearity(0.05, 0.0))
    steps = (Step(base, slow, (), ()), Step(slow.fitted.model, bent, (), ()))
    relaxation, sensor = findings_of(steps, bent.fitted.model, bent.fitted, split, 5e-3, 1)
    before, after = relaxation.nrmse_percent_test_before, relaxation.nrmse_percent_test_after
    assert 2.0 * math.log(before / after) < 0.2, "the sensor hid what it mends"
    assert relaxation.own_log_gain is not None
    assert relaxation.own_log_gain > 1.0
    assert sensor.own_log_gain is None, "it bends to nothing else"
