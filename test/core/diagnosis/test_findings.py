"""A form whose parameters the data do not tell from nothing is no name."""

from __future__ import annotations

import math

import pytest

from fomrc_core.diagnosis.findings import Finding


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
