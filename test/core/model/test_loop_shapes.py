"""Figure 12 as signs: as the slope rises loops get shorter, wider, rotate clockwise; the minor loop detaches.

The same statements for the model and for the electromechanical plant, which share no code and no form.

Power-law creep has no time scale of its own: at c times the slope the loop is the same but c^-alpha as
high. So creep alone makes it wider for its height; wider in volts it gets by a lag, tested apart.
"""

import itertools

import numpy as np
import pytest

from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.plants.paper_stage import KAPPA_UM_PER_V, SATURATION_V

SLOPES_V_PER_S = (0.2, 2.0, 20.0)
N_PER_RAMP = 250  # samples per volt, so that every slope is sampled alike


def make_model(creep_order):
    return PiezoModel(KAPPA_UM_PER_V, SATURATION_V, creep_order)


def make_plant(creep_order):
    return table1_plant(15, creep_order=creep_order, substep_s=2e-3)


MAKERS = pytest.mark.parametrize("make", [make_model, make_plant], ids=["model", "electromechanical"])


def ramps(corners_v, slope_v_per_s):
    """(steps, voltage, index of each corner) of a zigzag through the corners."""
    parts, ends = [], []
    for start, stop in itertools.pairwise([0.0, *corners_v]):
        n = round(abs(stop - start) * N_PER_RAMP)
        parts.append(start + (stop - start) * np.arange(1, n + 1) / n)
        ends.append(sum(part.size for part in parts) - 1)
    voltage = np.concatenate(parts)
    return np.full(voltage.size, 1.0 / (N_PER_RAMP * slope_v_per_s)), voltage, ends


def steady_loop(actuator, slope_v_per_s):
    """The third full cycle: (voltage, displacement) of the falling and of the rising branch."""
    steps, u, ends = ramps([2.5, -2.5, 2.5, -2.5, 2.5, -2.5, 2.5], slope_v_per_s)
    x = actuator.simulate(steps, u)
    x = x - 0.5 * (x[ends[4]] + x[ends[5]])
    falling, rising = slice(ends[4], ends[5] + 1), slice(ends[5], ends[6] + 1)
    return (u[falling], x[falling]), (u[rising], x[rising])


def loop_shape(actuator, slope_v_per_s):
    """Height [um], width at mid height [V], tilt of the regression line [um/V]."""
    (u_down, x_down), (u_up, x_up) = steady_loop(actuator, slope_v_per_s)
    width = np.interp(0.0, x_up, u_up) - np.interp(0.0, x_down[::-1], u_down[::-1])
    tilt = np.polyfit(np.append(u_down, u_up), np.append(x_down, x_up), 1)[0]
    return np.ptp(np.append(x_down, x_up)), width, tilt


@MAKERS
def test_loops_get_shorter_wider_and_rotate_clockwise_as_the_slope_rises(make):
    heights, widths, tilts = np.array([loop_shape(make(0.015), slope) for slope in SLOPES_V_PER_S]).T
    assert np.all(np.diff(heights) < 0.0)
    assert np.all(np.diff(widths / heights) > 0.0)
    assert np.all(np.diff(tilts) < 0.0)
    # About 3.5 % a decade: t^alpha with alpha = 0.015; the width in volts stays.
    np.testing.assert_allclose(heights[1:] / heights[:-1], 10**-0.015, rtol=0.01)
    np.testing.assert_allclose(widths, widths[0], rtol=2e-3)


def test_with_an_amplifier_the_loop_gets_wider_in_volts_too():
    amplified = make_model(0.015).with_effects(AmplifierBandwidth(400.0))
    heights, widths, tilts = np.array([loop_shape(amplified, slope) for slope in (2.0, 20.0, 100.0)]).T
    assert np.all(np.diff(heights) < 0.0)
    assert np.all(np.diff(widths) > 0.0)
    assert np.all(np.diff(tilts) < 0.0)
    # A lag of tau delays each branch by tau times the slope, and cuts the amplitude by as much.
    assert widths[2] - widths[0] == pytest.approx(2.0 * 98.0 / (2 * np.pi * 400.0), rel=0.15)


@MAKERS
def test_without_creep_the_loop_does_not_depend_on_the_slope(make):
    shapes = np.array([loop_shape(make(0.0), slope) for slope in SLOPES_V_PER_S])
    np.testing.assert_allclose(shapes, np.tile(shapes[0], (len(SLOPES_V_PER_S), 1)), rtol=2e-3)  # plant: c / k = 17 us


def minor_loop_gap_um(actuator, slope_v_per_s):
    """Displacement where the minor loop returns to its starting voltage, less that where it left."""
    steps, u, ends = ramps([2.5, -2.5, 1.0, 0.0, 1.0], slope_v_per_s)
    x = actuator.simulate(steps, u)
    return x[ends[4]] - x[ends[2]]


@MAKERS
def test_the_minor_loop_detaches_with_creep_and_closes_without(make):
    gaps = [minor_loop_gap_um(make(0.015), slope) for slope in SLOPES_V_PER_S]
    assert min(gaps) > 0.02  # 1 V, of 1.1 um: the actuator has crept upwards meanwhile
    closed = [minor_loop_gap_um(make(0.0), slope) for slope in SLOPES_V_PER_S]
    assert np.abs(closed).max() < 5e-3 * min(gaps)  # the lag c / k at 20 V/s
