"""The period of a cyclic error is the shortest way after which all comes again."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.cyclic_sensor_error import CyclicSensorError
from fomrc_core.effects.dead_zone import DeadZone


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e4])
def test_a_cycle_of_which_only_the_second_harmonic_is_there_is_half_as_long(scale: float) -> None:
    long = CyclicSensorError(0.8 * scale, 1e-4 * scale, -2e-4 * scale, 3e-3 * scale, 4e-3 * scale)
    short = long.in_shortest_form()
    assert short.period_um == 0.4 * scale
    moved_um = np.linspace(-2.0, 2.0, 500) * scale
    read_um, again_um = (e.run(e.initial_state(), moved_um, np.ones(500)) for e in (long, short))
    assert np.max(np.abs(again_um - read_um)) < 3e-4 * scale
    assert short.in_shortest_form() is short


def test_what_has_a_first_harmonic_or_none_at_all_stays() -> None:
    for error in (CyclicSensorError(0.8, 1e-3, 0.0, 3e-3, 4e-3), CyclicSensorError(0.8)):
        assert error.in_shortest_form() is error
    zone = DeadZone(0.1)
    assert zone.in_shortest_form() is zone


@pytest.mark.parametrize("n_cycles", [2.2, 2.77, 3.4, 5.3, 40.0])
@pytest.mark.parametrize("stroke_um", [0.02, 15.0, 2e4])
def test_an_error_of_few_cycles_and_of_many_is_proposed(n_cycles: float, stroke_um: float) -> None:
    rng = np.random.default_rng(5)
    time_s = np.arange(4000) * 1e-3
    moved = np.sin(2.0 * np.pi * 0.9 * time_s) + 0.6 * np.sin(2.0 * np.pi * 0.37 * time_s + 1.0)
    moved_um = stroke_um * (moved - np.min(moved)) / np.ptp(moved)
    size_um = 1e-3 * stroke_um
    left_um = size_um * np.sin(2.0 * np.pi * n_cycles * moved_um / stroke_um + 0.7)
    left_um += rng.normal(0.0, 0.1 * size_um, time_s.size)
    record = RecordEvidence(time_s, np.full(4000, 1e-3), moved_um / stroke_um, moved_um, left_um)
    best = 0.0
    for error in CyclicSensorError.screening(Evidence((record,), 0.1 * size_um)):
        shape_um = error.run(error.initial_state(), moved_um, np.ones(time_s.size)) - moved_um
        best = max(best, float(np.corrcoef(shape_um, left_um)[0, 1]))
    # near enough for a fit to come to the period
    assert best > 0.6


def test_less_than_two_cycles_over_the_stroke_are_a_curve() -> None:
    assert CyclicSensorError(3.9, 0.02).is_shown_over(8.0)
    assert not CyclicSensorError(3.9, 0.02).is_shown_over(7.3)
    assert DeadZone(0.1).is_shown_over(1e-3)
