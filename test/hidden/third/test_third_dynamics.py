"""The third world's dynamics: exact where they are linear, converged where not; and noise of the rms it is given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from test.hidden.third.arrays import Array
from test.hidden.third.bench import draw_bench
from test.hidden.third.catalogue import EFFECTS
from test.hidden.third.chain import readings_um
from test.hidden.third.creep_kernel import late
from test.hidden.third.drives import SMOOTH, STEPPED, draw_drive
from test.hidden.third.effect import Hidden
from test.hidden.third.frame import Frame, draw_frame
from test.hidden.third.linear_filters import lag, poles, ring
from test.hidden.third.sensor_noise import NOISE_KINDS, draw_noise


def test_a_ramp_through_linear_filters_is_exact() -> None:
    time_s: Array = np.arange(400) * 1e-3
    for step_s, constant_s in ((1e-3, 5e-3), (1e-3, 2e-4)):
        exact: Array = time_s + constant_s * np.expm1(-time_s / constant_s)
        np.testing.assert_allclose(lag(time_s, constant_s, step_s), exact, atol=1e-12)
        np.testing.assert_allclose(late(time_s, step_s, constant_s), exact, atol=1e-12)
    omega, damping = 2.0 * np.pi * 40.0, 0.2
    shaken = omega * np.sqrt(1.0 - damping**2)
    swing = np.exp(-damping * omega * time_s)
    exact = time_s - 2.0 * damping / omega
    exact += swing * (
        2.0 * damping / omega * np.cos(shaken * time_s) + (2.0 * damping**2 - 1.0) / shaken * np.sin(shaken * time_s)
    )
    np.testing.assert_allclose(ring(time_s, 40.0, damping, 1e-3), exact, atol=1e-11)


@pytest.mark.parametrize("n_poles", [1, 2, 4])
def test_poles_pass_half_the_power_at_their_cutoff(n_poles: int) -> None:
    time_s = np.arange(20_000) * 1e-4
    passed = poles(np.sin(2.0 * np.pi * 20.0 * time_s), 20.0, n_poles, 1e-4)[10_000:]
    assert np.sqrt(2.0 * np.mean(passed**2)) == pytest.approx(np.sqrt(0.5), rel=1e-3)


def _frame(seed: int, name: str) -> tuple[Frame, Hidden]:
    rng = np.random.default_rng(seed)
    bench = draw_bench(rng, "masing", (1200, 1300), is_bipolar=True)
    frame = draw_frame(rng, bench, 0, ("staircase", "tones"), frozenset({"temperature", "cross_voltage"}))
    return frame, EFFECTS[name].drawn(bench, rng)


@pytest.mark.parametrize(
    "name",
    [
        "amplifier_slew_limit",
        "amplifier_bandwidth",
        "drive_resonance",
        "unequal_lag",
        "voltage_dependent_capacitance",
        "rate_dependent_hysteresis",
        "backlash",
        "mechanical_resonance",
        "shear_thinning_glue",
    ],
)
def test_a_finer_grid_changes_little_of_an_effect(name: str) -> None:
    frame, hidden = _frame(3, name)
    finer = replace(frame, n_fine=24)
    effect = readings_um(frame, [hidden]) - readings_um(frame)
    changed = readings_um(finer, [hidden]) - readings_um(frame, [hidden])
    assert np.sqrt(np.mean(changed**2)) < 0.05 * np.sqrt(np.mean(effect**2))


@pytest.mark.parametrize("name", [*EFFECTS])
def test_every_effect_acts_and_grows_with_its_strength(name: str) -> None:
    frame, hidden = _frame(5, name)
    plain = readings_um(frame)

    def size(strength: float) -> float:
        return float(np.sqrt(np.mean((readings_um(frame, [hidden.stronger(strength)]) - plain) ** 2)))

    if hidden.effect.powers.keys() & hidden.values.keys():
        assert 0.0 < size(0.5) < size(2.0) < 3.0 * np.ptp(plain)
    else:
        assert not hidden.effect.acts


@pytest.mark.parametrize("kind", [*SMOOTH, *STEPPED])
def test_a_drive_starts_from_rest_and_takes_the_range(kind: str) -> None:
    rng = np.random.default_rng(7)
    bench = draw_bench(rng, "masing", (2000, 2000), is_bipolar=False)
    for n in (2000, 2500):
        drive_v = draw_drive(rng, (kind,), n, bench)
        assert drive_v.size == n
        assert drive_v[0] == 0.0
        assert np.ptp(drive_v) > 0.45 * bench.span_v
        assert bench.low_v - 1e-9 * bench.span_v <= drive_v.min()
        assert drive_v.max() <= bench.high_v + 1e-9 * bench.span_v


@pytest.mark.parametrize("kind", NOISE_KINDS)
def test_noise_has_the_rms_that_is_asked_for(kind: str) -> None:
    clean_um = np.cumsum(np.random.default_rng(0).standard_normal(20_000)) * 1e-3
    sizes = [
        np.sqrt(np.mean(draw_noise(np.random.default_rng(s), kind, clean_um, 2e-3, share) ** 2))
        for s, share in ((1, 0.1), (2, 0.5), (3, 0.9))
    ]
    # What is slow has few independent values in a record, and a walk's own end far from its mean.
    assert np.mean(sizes) == pytest.approx(2e-3, rel=0.6 if kind == "walk" else 0.12)
