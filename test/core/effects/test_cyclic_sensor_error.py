"""The period of a cyclic error is the shortest way after which all comes again."""

from __future__ import annotations

import numpy as np
import pytest

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
