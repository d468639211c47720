"""Creep, dynamics, noise and faults of the second truth, against closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import welch

from test.hidden.second.creep import CreepLaw, Logarithmic, PowerLaw, Relaxations, creep
from test.hidden.second.data_faults import FAULT_KINDS, apply_fault, draw_fault
from test.hidden.second.linear_dynamics import first_order_lag, leak, low_pass, oscillator
from test.hidden.second.sensor_noise import NOISE_KINDS, SensorNoise
from test.hidden.second.stateful_dynamics import backlash, charged_through, rate_limited, unequal_lag

_LAWS: list[CreepLaw] = [
    PowerLaw(0.02, 100.0),
    Logarithmic(0.03, 0.5),
    Relaxations((0.03, 0.02, 0.04), (0.3, 5.0, 200.0)),
]


@pytest.mark.parametrize("law", _LAWS, ids=lambda law: type(law).__name__)
def test_creep_of_a_step_is_the_step_response(law: CreepLaw) -> None:
    step_s = 0.01
    n = 20_000
    step = np.ones(n)
    step[0] = 0.0
    time_s = np.arange(n) * step_s
    late = time_s > 100 * step_s
    # The step took one cell: its middle is the moment it happened.
    expected = law.of_step(time_s[late] - 0.5 * step_s)
    assert creep(step, law, step_s)[late] == pytest.approx(expected, rel=1e-5)


def test_logarithmic_creep_grows_by_its_share_each_decade() -> None:
    step = np.ones(1_100_000)
    step[0] = 0.0
    out = creep(step, Logarithmic(0.025, 1e-3), 0.01)
    decades = out[[100, 1_000, 10_000, 100_000, 1_000_000]]
    assert np.diff(decades) == pytest.approx(0.025, rel=1e-2)


def test_creep_adds_up() -> None:
    rng = np.random.default_rng(0)
    first, second = np.cumsum(rng.standard_normal((2, 4000)), axis=1)
    both = np.stack([first, second, first + second], axis=1)
    out = creep(both, _LAWS[1], 1e-3)
    assert out[:, 0] + out[:, 1] == pytest.approx(out[:, 2], abs=1e-9)
    assert out[:, 0] == pytest.approx(creep(first, _LAWS[1], 1e-3), abs=1e-9)


def _ramp_and_hold(step_s: float, n: int = 4000) -> np.ndarray:
    return np.minimum(np.arange(n) * step_s, 0.4 * n * step_s)


Rate = Callable[[float, np.ndarray], list[float]]


@pytest.mark.parametrize("kind", ["lag", "leak", "oscillator"])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_linear_dynamics_solve_their_equations(kind: str, unit: float) -> None:
    step_s = 1e-3
    values = _ramp_and_hold(step_s)
    corner = 0.4 * 4000 * step_s

    def drive(t: float) -> float:
        return min(t, corner)

    w = 4.0 * np.pi
    rates: dict[str, Rate] = {
        "lag": lambda t, y: [(drive(t) - y[0]) / 0.2],
        "leak": lambda t, y: [float(t < corner) - y[0] / 0.7],
        "oscillator": lambda t, y: [y[1], w**2 * (drive(t) - y[0]) - 0.2 * w * y[1]],
    }
    found = {
        "lag": lambda: first_order_lag(values, 0.2 * unit, step_s * unit),
        "leak": lambda: leak(values, 0.7 * unit, step_s * unit),
        "oscillator": lambda: oscillator(values, 2.0 / unit, 0.1, step_s * unit),
    }[kind]()
    time_s = np.arange(values.size) * step_s
    start = [0.0] * (2 if kind == "oscillator" else 1)
    exact = solve_ivp(rates[kind], (0.0, time_s[-1]), start, t_eval=time_s, rtol=1e-9, atol=1e-12, max_step=5e-3)
    assert found == pytest.approx(exact.y[0], abs=2e-6)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_sensor_filter_is_three_decibels_down_at_its_cutoff(order: int) -> None:
    step_s, cutoff_hz = 1e-4, 40.0
    time_s = np.arange(60_000) * step_s
    for hertz in (4.0, 40.0, 80.0):
        gain = 1.0 / np.sqrt(1.0 + (hertz / cutoff_hz) ** (2 * order))
        out = low_pass(np.sin(2 * np.pi * hertz * time_s), cutoff_hz, order, step_s)[30_000:]
        assert np.sqrt(2.0 * np.mean(out**2)) == pytest.approx(gain, rel=3e-3)


def test_stateful_dynamics() -> None:
    step_s = 1e-3
    values = np.concatenate([_ramp_and_hold(step_s), np.zeros(4000)])
    assert unequal_lag(values, 0.2, 0.2, step_s) == pytest.approx(first_order_lag(values, 0.2, step_s), abs=1e-9)
    assert charged_through(values, 0.2, 0.0, step_s) == pytest.approx(first_order_lag(values, 0.2, step_s), abs=1e-9)
    slow = unequal_lag(values, 0.2, 0.6, step_s)
    late = slow[4000:]  # falls from its value with the other time constant
    assert late[1500] / late[500] == pytest.approx(np.exp(-1.0 / 0.6), rel=1e-3)
    lags = rate_limited(values, 0.5, step_s)
    assert np.max(np.abs(np.diff(lags))) <= 0.5 * step_s * (1.0 + 1e-9)
    assert lags[3999] == pytest.approx(1.6)
    gap = backlash(np.array([0.0, 1.0, 0.95, 0.85, 0.5]), 0.2)
    assert gap == pytest.approx([0.0, 0.9, 0.9, 0.9, 0.6])


def test_capacitance_that_grows_with_voltage_charges_more_slowly() -> None:
    step_s = 1e-4
    exact = solve_ivp(lambda t, z: (1.0 - z) / (0.1 * (1.0 + 0.8 * z)), (0, 0.3), [0.0], rtol=1e-10, atol=1e-12)
    step = np.ones(3001)
    out = charged_through(np.concatenate([[0.0], step]), 0.1, 0.8, step_s)
    # The step takes one cell.
    assert out[-1] == pytest.approx(exact.y[0, -1], abs=2e-4)


@pytest.mark.parametrize("kind", NOISE_KINDS)
def test_noise_has_its_rms(kind: str) -> None:
    n = 4000
    noise = SensorNoise(kind, 2e-3, 0.9, 0.6, n, 1.0)
    true_um = np.sin(np.linspace(0.0, 60.0, n))
    found = [noise.read(true_um, np.random.default_rng(k)) - true_um for k in range(300)]
    about_mean = np.sqrt(np.mean([np.var(e) if kind == "walk" else np.mean(e**2) for e in found]))
    assert about_mean == pytest.approx(2e-3, rel=0.06)


@pytest.mark.parametrize(("kind", "slope"), [("white", 0.0), ("flicker", -1.0), ("walk", -2.0)])
def test_noise_has_its_colour(kind: str, slope: float) -> None:
    n = 1 << 17
    noise = SensorNoise(kind, 1.0, 0.9, 1.0, n, 1.0).read(np.zeros(n), np.random.default_rng(8))
    frequency, power = welch(noise, nperseg=1 << 13)
    kept = (frequency > 1e-3) & (frequency < 0.1)
    assert np.polyfit(np.log(frequency[kept]), np.log(power[kept]), 1)[0] == pytest.approx(slope, abs=0.12)


def test_autoregressive_noise_forgets_at_its_rate() -> None:
    noise = SensorNoise("autoregressive", 1.0, 0.9, 0.0, 10, 1.0).read(np.zeros(200_000), np.random.default_rng(8))
    for lag in (1, 5):
        assert np.mean(noise[lag:] * noise[:-lag]) == pytest.approx(0.9**lag, abs=0.03)


def test_proportional_noise_grows_with_displacement() -> None:
    noise = SensorNoise("proportional", 1e-3, 0.0, 0.0, 10, 1.0)
    true_um = np.repeat([0.0, 1.0], 20_000)
    error = noise.read(true_um, np.random.default_rng(1)) - true_um
    assert np.std(error[20_000:]) / np.std(error[:20_000]) == pytest.approx(6.0, rel=0.05)


@pytest.mark.parametrize("kind", FAULT_KINDS)
def test_faults_are_where_they_are_said_to_be(kind: str) -> None:
    rng = np.random.default_rng(2)
    true_um = 5.0 * np.sin(np.linspace(0.0, 40.0, 3000))
    measured_um = true_um + 1e-3 * rng.standard_normal(3000)
    fault = draw_fault(kind, 3000, measured_um, rng)
    out = apply_fault(fault, measured_um, true_um, rng)
    assert out.shape == measured_um.shape
    changed = np.flatnonzero(out != measured_um)
    assert changed.size > 0
    if kind in ("spikes", "dropouts", "stuck"):
        assert set(changed) <= set(fault.samples)
        assert changed.size >= 0.9 * len(fault.samples)
    elif kind in ("lost_samples", "doubled_samples"):
        assert changed[0] >= fault.samples[0]
        shift = len(fault.samples) if kind == "lost_samples" else -len(fault.samples)
        middle = slice(fault.samples[-1] + 10, 2900)
        assert out[middle] == pytest.approx(np.roll(measured_um, -shift)[middle])
    elif kind == "clipping":
        assert out.max() == fault.size
        assert 0.02 <= np.mean(measured_um > fault.size) <= 0.07
