"""The truth itself: against formulas, brute force and a finer grid; and that it is nobody's copy."""

from __future__ import annotations

import ast
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import gamma

pytest.importorskip("numba")

from test.hidden.creep import fractional_integral
from test.hidden.dynamics import first_order, mass_spring_damper, rate_limited
from test.hidden.effects import CAUSES
from test.hidden.hysteresis import MaxwellChain, RelayPlane, asymmetric, draw_chain, draw_plane, envelopes_of
from test.hidden.noise import Noise
from test.hidden.truth import draw_case

_HERE = Path(__file__).parent
_TRUTH_FILES = [f for f in sorted(_HERE.glob("*.py")) if not f.name.startswith(("test_", "study"))]
_HANDED_OVER = {("fomrc_core.records.recording", "Recording"), ("fomrc_core.model.piezo_model", "PiezoModel")}


def _imports(path: Path) -> list[tuple[str, str]]:
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [(node.module or ".", alias.name) for alias in node.names]
    return found


def test_truth_files_are_there() -> None:
    assert {"truth.py", "world.py", "hysteresis.py", "creep.py"} <= {f.name for f in _TRUTH_FILES}


@pytest.mark.parametrize("path", _TRUTH_FILES, ids=lambda p: p.name)
def test_truth_shares_no_code_with_the_product(path: Path) -> None:
    for module, name in _imports(path):
        root = module.split(".")[0]
        if root.startswith("fomrc"):
            assert path.name == "handover.py", f"{path.name} imports {module}"
            assert (module, name) in _HANDED_OVER
        else:
            assert root in sys.stdlib_module_names | {"numpy", "scipy", "numba", "test"}, (
                f"{path.name} imports {module}"
            )
            if root == "test":
                assert module.startswith("test.hidden.")


def test_creep_of_a_ramp_is_the_power_law() -> None:
    step_s, order = 5e-5, 0.02
    time_s = np.arange(200_000) * step_s
    exact = time_s ** (1.0 + order) / gamma(2.0 + order)
    assert np.max(np.abs(fractional_integral(time_s, order, step_s) - exact)) < 1e-9


def test_creep_of_a_step_is_the_power_law() -> None:
    step_s, order = 5e-5, 0.015
    step = np.ones(1_200_000)
    step[0] = 0.0
    time_s = np.arange(step.size) * step_s
    response = fractional_integral(step, order, step_s)
    late = time_s > 5e-3
    # The step took one cell: its middle is the moment it happened.
    exact = (time_s[late] - 0.5 * step_s) ** order / gamma(1.0 + order)
    assert np.max(np.abs(response[late] / exact - 1.0)) < 1e-6


def test_first_order_follows_a_ramp_with_its_lag() -> None:
    step_s, rate = 5e-5, 2.0 * np.pi * 400.0
    time_s = np.arange(2000) * step_s
    exact = 3.0 * (time_s - (1.0 - np.exp(-rate * time_s)) / rate)
    assert np.max(np.abs(first_order(3.0 * time_s, rate, step_s) - exact)) < 1e-5 * 3.0 / rate


def test_resonance_rings_as_the_formula_says() -> None:
    step_s, hertz, ratio = 5e-5, 450.0, 0.03
    time_s = np.arange(4000) * step_s
    w = 2.0 * np.pi * hertz
    damped = w * np.sqrt(1.0 - ratio**2)
    # Response to a ramp of slope 1: the integral of the step response.
    phase = damped * time_s
    decay = np.exp(-ratio * w * time_s)
    exact = time_s - 2.0 * ratio / w
    exact += decay * (2.0 * ratio / w * np.cos(phase) + (2.0 * ratio**2 - 1.0) / damped * np.sin(phase))
    assert np.max(np.abs(mass_spring_damper(time_s, hertz, ratio, step_s) - exact)) < 2e-6 * np.max(time_s)


def test_slew_turns_where_the_lines_meet() -> None:
    step_s = 1e-3
    drive_v = np.array([0.0, 1.0, 2.0, 0.0, -2.0])  # up at 1000 V/s, down at 2000 V/s; the limit is 600 V/s
    out, at, turns_v = rate_limited(drive_v, 600.0, step_s)
    # After 2 ms: 1.2 V against 2 V falling. They meet 0.8 / 2600 s later.
    assert at.tolist() == [3]
    assert turns_v == pytest.approx([1.2 + 600.0 * 0.8 / 2600.0])
    assert out[3] == pytest.approx(turns_v[0] - 600.0 * (step_s - 0.8 / 2600.0))
    assert out[4] == pytest.approx(out[3] - 0.6)


def _relay_sum(plane: RelayPlane, drive_v: np.ndarray, largest_v: float, n: int) -> np.ndarray:
    """Add up relays one by one over a grid of the plane, starting from the demagnetised state."""
    cell = 2.0 * largest_v / n
    grid = -largest_v + (np.arange(n) + 0.5) * cell
    up, down = np.meshgrid(grid, grid, indexing="ij")
    width, centre = up - down, 0.5 * (up + down)
    density = (1.0 - plane.share) * np.exp(-width / plane.decay_1_v)
    density += plane.share * width / plane.decay_2_v * np.exp(-width / plane.decay_2_v)
    weight = np.where(width > 0.0, plane.scale * density * (1.0 + plane.skew_per_v * centre) * cell**2, 0.0)
    weight += np.diag(np.diag(plane.scale * (1.0 - plane.share) * np.ones((n, n)) * cell**2 * 0.5))
    weight *= np.where(width > 0.0, 1.0, np.where(width == 0.0, 1.0 + plane.skew_per_v * centre, 0.0))
    state = np.where(centre < 0.0, 0.5, -0.5)
    start = np.sum(weight * state)
    out = np.empty(drive_v.size)
    for k, u in enumerate(drive_v):
        state = np.where(up < u, 0.5, np.where(down > u, -0.5, state))
        out[k] = plane.slope_um_per_v * u + np.sum(weight * state) - start
    return out


@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_relay_plane_is_a_sum_of_relays(skew: float) -> None:
    rng = np.random.default_rng(5)
    plane = replace(draw_plane(8.0, 0.12, 4.0, rng), skew_per_v=skew)
    drive_v = np.concatenate([[0.0], rng.uniform(-2.0, 2.0, 40), [2.0, -2.0, 1.0, -0.5, 0.7, 2.0]])
    assert np.max(np.abs(plane.run(drive_v) - _relay_sum(plane, drive_v, 2.0, 800))) < 0.005


def test_relay_plane_does_not_care_how_fine_the_way_is() -> None:
    rng = np.random.default_rng(6)
    plane = draw_plane(8.0, 0.12, 4.0, rng)
    turns_v = np.concatenate([[0.0], rng.uniform(-2.0, 2.0, 60)])
    fine_v = np.interp(np.arange(60 * 50 + 1) / 50.0, np.arange(61), turns_v)
    assert np.max(np.abs(plane.run(fine_v)[::50] - plane.run(turns_v))) < 1e-12


def _loops(seed: int) -> list[RelayPlane | MaxwellChain]:
    rng = np.random.default_rng(seed)
    return [draw_plane(7.0, 0.13, 5.0, rng), draw_chain(7.0, 0.13, 5.0, 100, rng)]


@pytest.mark.parametrize("which", [0, 1])
def test_loops_close_are_symmetric_and_have_their_size(which: int) -> None:
    loops = _loops(8)[which]
    cycle_v = np.concatenate([np.linspace(0, 2.5, 26), np.linspace(2.4, -2.5, 50), np.linspace(-2.4, 2.5, 50)])
    x = loops.run(np.concatenate([cycle_v, np.linspace(2.4, -2.5, 50)]))
    top, bottom = x[25], x[75]
    assert x[125] == pytest.approx(top, abs=1e-9)
    assert x[175] == pytest.approx(bottom, abs=1e-9)
    assert top == pytest.approx(-bottom, abs=1e-9)
    assert top - bottom == pytest.approx(7.0, abs=1e-9)
    falling, rising = x[25:76], x[75:126]
    assert np.max(np.abs(falling + rising)) < 1e-9  # point symmetry: down is up, turned round
    assert falling[25] - rising[25] == pytest.approx(0.13 * 7.0, rel=0.02)


def test_chain_balances_its_drive() -> None:
    chain = _loops(9)[1]
    assert isinstance(chain, MaxwellChain)
    drive_v = np.random.default_rng(1).uniform(-2.0, 2.0, 30)
    x = np.concatenate([[0.0], chain.run(np.concatenate([[0.0], drive_v]))[1:]])
    force = np.zeros(chain.strength_v.size)
    for k, move in enumerate(np.diff(x)):
        force = np.clip(force + chain.stiffness_v_per_um * move, -chain.strength_v, chain.strength_v)
        assert force.sum() + chain.spring_v_per_um * x[k + 1] == pytest.approx(drive_v[k], abs=1e-10)


def test_asymmetry_of_no_size_is_symmetry() -> None:
    plane = _loops(10)[0]
    assert isinstance(plane, RelayPlane)
    turns_v = np.concatenate([[0.0], np.random.default_rng(2).uniform(-2.5, 2.5, 50)])
    plain = plane.run(turns_v)
    assert np.max(np.abs(envelopes_of(plane, 3.0, 400, 0.0, False).run(turns_v) - plain)) < 1e-3
    for form in ("skewed_plane", "warped_drive", "bent_envelope"):
        bent = asymmetric(plane, form, 0.05, 2.5).run(turns_v)
        assert np.max(np.abs(bent - plain)) > 5e-3


def test_noise_has_its_rms_and_colour() -> None:
    noise = Noise(1e-3, 0.4, 0.0).draw(200_000, np.random.default_rng(3))
    assert np.std(noise) == pytest.approx(1e-3, rel=0.02)
    assert np.mean(noise[1:] * noise[:-1]) / np.mean(noise**2) == pytest.approx(0.4, abs=0.02)
    flickering = Noise(1e-3, 0.4, 0.08).draw(200_000, np.random.default_rng(3))
    assert np.sqrt(np.mean(flickering**2)) == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    "cause",
    [
        None,
        "amplifier_bandwidth",
        "amplifier_slew_limit",
        "mechanical_resonance",
        "transport_delay",
        "clock_skew",
    ],
)
def test_twenty_steps_per_sample_are_enough(cause: str | None) -> None:
    case = draw_case(17, () if cause is None else (cause,), excitation="short")
    setup, command_v = case.setup, case.recordings[0].voltage_v
    finer = replace(setup.world, oversampling=80)
    difference = setup.clean_um(command_v, "train", "train 1") - setup.clean_um(command_v, "train", "train 1", finer)
    assert np.sqrt(np.mean(difference**2)) < 1e-4


@pytest.mark.parametrize("cause", CAUSES)
def test_every_cause_is_hidden_and_nothing_else(cause: str) -> None:
    case = draw_case(23, (cause,), excitation="short")
    assert set(case.parameters) == {cause}
    assert case.visible_rms_um[cause] > 1.5e-3
    command_v = case.recordings[0].voltage_v
    if cause == "missing_hysteresis":
        assert case.model_mapping is not None
        assert case.setup.world.effects == {}
        return
    assert case.model_mapping is None
    without = case.setup.world.without(cause)
    effect = case.setup.clean_um(command_v, "train", "train 1") - case.setup.clean_um(
        command_v, "train", "train 1", without
    )
    assert np.std(effect) == pytest.approx(case.effect_rms_um[cause], rel=1e-6)


def test_a_seed_gives_one_case() -> None:
    first, second = (draw_case(31, ("mains_hum",), excitation="short") for _ in range(2))
    assert np.array_equal(first.recordings[0].measured_um, second.recordings[0].measured_um)
    other = draw_case(32, ("mains_hum",), excitation="short")
    assert other.parameters != first.parameters
