"""Uncertainty of identified parameters: intervals that cover, elements that are open, advice that helps."""

import numpy as np
import pytest

from fomrc_core.errors import ParameterError
from fomrc_core.identification.convex import identify
from fomrc_core.identification.uncertainty import estimate_uncertainty
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records import excitation
from fomrc_core.records.recording import Recording

TRUTH = PiezoModel([8.0, 15.0, 1.3], [0.05, 0.10], 0.02)


def record(wave, seed, noise_um=1e-3):
    steps = np.diff(wave.time_s, prepend=2 * wave.time_s[0] - wave.time_s[1])
    noise = np.random.default_rng(seed).normal(0.0, noise_um, wave.n_samples)
    return Recording(wave.time_s, wave.voltage_v, TRUTH.simulate(steps, wave.voltage_v) + noise, name=wave.name)


def rich(seed, noise_um=1e-3):
    return record(excitation.staircase(2.5, rate_hz=50.0), seed, noise_um)


def test_intervals_cover_the_truth_and_their_width_is_that_of_repeated_measurements():
    fits = [identify(rich(seed), n_elements=2) for seed in range(12)]
    found = estimate_uncertainty(fits[0], rich(0))
    repeated = np.std([fit.model.creep_order for fit in fits], ddof=1)
    low, high = found.creep_order_interval
    assert (high - low) / 3.92 == pytest.approx(repeated, rel=0.6)
    covered = [
        low <= 0.02 <= high
        for low, high in (estimate_uncertainty(f, rich(s)).creep_order_interval for s, f in enumerate(fits[:6]))
    ]
    assert sum(covered) >= 4
    assert found.n_determined == 2
    assert found.advice == ()


def test_more_noise_is_wider_in_proportion():
    widths = []
    for noise in (1e-3, 4e-3):
        found = estimate_uncertainty(identify(rich(3, noise), n_elements=2), rich(3, noise))
        widths.append(np.diff(found.creep_order_interval)[0])
    assert widths[1] / widths[0] == pytest.approx(4.0, rel=0.5)


def test_an_element_beyond_the_drive_is_open_and_the_advice_measures_it():
    """Small loops: the element that saturates at 1.9 V has not been seen; driven as advised, it is."""
    small = record(excitation.triangle(0.6, slope_v_per_s=1.0, rate_hz=200.0), 5)
    fit = identify(small, n_elements=2)
    beside = type(fit)(**{**vars(fit), "model": TRUTH})  # the true elements, questioned on poor data
    poor = estimate_uncertainty(beside, small)
    assert not poor.elements[1].is_determined
    assert any("never saturates" in text and "drive up to" in text for text in poor.advice)
    rich_drive = record(excitation.triangle(2.5, slope_v_per_s=1.0, rate_hz=200.0), 6)
    better = estimate_uncertainty(identify([small, rich_drive], n_elements=2), [small, rich_drive])
    assert better.n_determined == 2


def test_a_drive_without_holds_leaves_the_creep_order_to_the_advice():
    time_s = np.arange(400) / 200.0
    voltage = 2.0 * np.sin(2 * np.pi * 5.0 * time_s)
    wave = excitation.Excitation(time_s, voltage, "short sine")
    short = record(wave, 7, 0.05)
    found = estimate_uncertainty(identify(short, n_elements=2), short)
    assert any("creep order" in text and "hold steps" in text for text in found.advice)


def test_too_few_replicates_are_refused():
    one = rich(1)
    with pytest.raises(ParameterError, match="replicates"):
        estimate_uncertainty(identify(one, n_elements=2), one, n_replicates=3)
