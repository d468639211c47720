"""The paper's identification route against parameters that are known."""

import itertools
import math

import numpy as np
import pytest

from fomrc_core.errors import RecordingError
from fomrc_core.identification.paper import (
    creep_order_from_step,
    elements_from_rising_curve,
    identify_paper,
)
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

TRUTH = PiezoModel([8.0, 15.0, 30.0, 1.3], [0.1, 0.11, 0.08], 0.02)


def record(voltage, rate_hz, model=TRUTH):
    steps = np.full(voltage.size, 1.0 / rate_hz)
    return Recording(np.arange(voltage.size) / rate_hz, voltage, model.simulate(steps, voltage))


def staircase(amplitude=2.5, step=0.25, hold=100):
    corners = [0.0, amplitude, -amplitude, 0.6 * amplitude, -0.6 * amplitude, 0.0]
    levels = np.concatenate([np.arange(a, b, math.copysign(step, b - a)) for a, b in itertools.pairwise(corners)])
    return np.repeat(levels[1:], hold)


def test_elements_of_a_quadratic_rising_curve_are_those_of_29_and_30():
    """Of u = x - 0.1 x^2 up to x = 2: slopes are known, so kappa and u_S are."""
    x = np.linspace(0.0, 2.0, 400)
    kappa, saturation = elements_from_rising_curve(x - 0.1 * x**2, x, 4)
    # Slope 1 - 0.2 x at (j - 1/2) dx: falls by 0.1 from one element to the next, the last by half of that.
    np.testing.assert_allclose(1.0 / kappa, [0.1, 0.1, 0.1, 0.05, 0.6], rtol=1e-6)
    np.testing.assert_allclose(saturation * kappa[:-1], [0.5, 1.0, 1.5, 2.0], rtol=1e-12)


def test_double_logarithm_gives_the_order_and_leaves_out_the_first_tenth_of_a_second():
    time_s = np.arange(1, 6000) * 1e-2
    x = -1.3 * time_s**0.017
    x[time_s < 0.1] = -5.0  # ringing, not creep
    assert creep_order_from_step(time_s, x) == pytest.approx(0.017, rel=1e-6)


def test_the_route_recovers_a_model_from_its_own_staircase():
    rising = np.concatenate([np.linspace(0, 2.5, 500)[1:], np.linspace(2.5, -2.5, 1000)[1:]])
    step = np.full(1000, 1.0)
    records = [record(rising, 200.0), record(step, 100.0), record(staircase(), 100.0)]
    shares = []
    fit = identify_paper(records, 3, progress=lambda share, text: shares.append(share))
    assert fit.rms_um < 0.2 * fit.start_rms_um
    assert fit.rms_um < 2e-3  # of 5 um
    assert fit.model.creep_order == pytest.approx(0.02, rel=0.05)
    assert fit.notes == ()
    assert shares[-1] == 1.0


def test_offset_is_found_and_a_start_is_taken():
    one = record(staircase(), 50.0)
    moved = Recording(one.time_s, one.voltage_v, np.asarray(one.displacement_um) + 7.0)
    fit = identify_paper([moved], start=TRUTH, max_iterations=3)
    assert fit.offsets_um[0] == pytest.approx(7.0, abs=1e-6)
    assert fit.rms_um < 1e-6


def test_a_record_that_lacks_a_step_says_so():
    time_s = np.arange(2000) / 200.0
    fit = identify_paper([record(1.8 - 1.8 * np.cos(2 * np.pi * time_s + 1.0), 200.0)], 3, max_iterations=2)
    assert any("alpha" in note for note in fit.notes)
    assert any("29" in note for note in fit.notes)


def test_bad_input_is_one_clear_line():
    with pytest.raises(RecordingError, match="no recordings"):
        identify_paper([])
    with pytest.raises(RecordingError, match="rising curve"):
        elements_from_rising_curve(np.zeros(50), np.zeros(50), 3)
    with pytest.raises(RecordingError, match=r"0\.1 s"):
        creep_order_from_step(np.array([0.01, 0.02]), np.array([1.0, 1.0]))
