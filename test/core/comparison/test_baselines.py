"""Each rival against what its publication says of it, and against brute force."""

import numpy as np
import pytest

from fomrc_core.comparison.baselines import all_rivals, training_error_um, training_record
from fomrc_core.comparison.baselines.amplified import Amplified, amplified_voltage
from fomrc_core.comparison.baselines.cascade_rival import CascadeRival
from fomrc_core.comparison.baselines.creep_cascade import linear_creep, logarithmic_creep
from fomrc_core.comparison.baselines.goldfarb_celanovic import GoldfarbCelanovic
from fomrc_core.comparison.baselines.maxwell_slip import MaxwellSlip
from fomrc_core.comparison.baselines.mrc import MaxwellResistiveCapacitor
from fomrc_core.comparison.baselines.prandtl_ishlinskii import ModifiedPrandtlIshlinskii, PlaySum, PrandtlIshlinskii
from fomrc_core.comparison.baselines.preisach import Preisach
from fomrc_core.compute.least_squares import non_negative_fit
from fomrc_core.errors import ParameterError
from fomrc_core.records.recording import Recording

RATE_HZ = 200.0
RNG = np.random.default_rng(11)


def drive(n=1600, seed=3):
    """A sine whose amplitude wanders: minor loops of every size."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / RATE_HZ
    amplitude = np.interp(t, np.linspace(0, t[-1], 9), [0.2, 2.5, 1.0, 2.2, 0.4, 1.8, 0.9, 2.5, 0.1])
    return amplitude * np.sin(2 * np.pi * 0.9 * t) + 0.2 * np.interp(t, np.linspace(0, t[-1], 30), rng.normal(size=30))


def record_of(displacement, voltage):
    return Recording(np.arange(voltage.size) / RATE_HZ, voltage, displacement)


def brute_force_relays(voltage, alpha, beta):
    """One relay, sample by sample, from a demagnetised start: up where alpha + beta < 0."""
    state = 1.0 if alpha + beta < 0.0 else 0.0
    out = np.empty(voltage.size)
    for k, u in enumerate(voltage):
        state = 1.0 if u >= alpha else (0.0 if u <= beta else state)
        out[k] = state
    return out


def test_preisach_shares_are_those_of_a_dense_field_of_relays():
    voltage = drive(500)
    family = Preisach(4, -3.0, 3.0)
    exact = family.columns(voltage)
    cell, n_fine = 1.5, 24
    fine = (np.arange(n_fine) + 0.5) / n_fine
    at = 0
    for i in range(4):
        for j in range(i + 1):
            pairs = [(-3 + cell * (i + a), -3 + cell * (j + b)) for a in fine for b in fine]
            pairs = [(alpha, beta) for alpha, beta in pairs if alpha >= beta]
            counted = np.mean([brute_force_relays(voltage, *pair) for pair in pairs], axis=0)
            assert np.abs(counted - exact[:, at]).max() < 0.09  # the grid of relays, 1 / n_fine either way
            at += 1


def test_preisach_inverse_undoes_it_and_stays_at_its_limit():
    family = Preisach(10, -3.0, 3.0)
    operator = family.operator(RNG.uniform(0.1, 1.0, 55))
    voltage = drive()
    moved = operator.forward(voltage)
    np.testing.assert_allclose(moved, family.columns(voltage) @ operator.weights, rtol=1e-12)
    np.testing.assert_allclose(operator.inverse(moved), voltage, atol=1e-9)
    assert operator.inverse(np.array([moved.max() * 10.0]))[0] == pytest.approx(3.0, abs=1e-9)


def test_preisach_has_wiping_out_and_congruent_minor_loops():
    operator = Preisach(8, -3.0, 3.0).operator(np.ones(36))

    def minor_loop(path):
        return operator.forward(np.array([*path, 1.0, 0.0, 1.0]))[-3:]

    short, detour = minor_loop([2.5, -2.5]), minor_loop([2.5, -2.5, 0.9, 0.1, 0.5])
    np.testing.assert_allclose(short, detour, atol=1e-12)
    other = minor_loop([2.5, -1.0])
    assert short[0] - short[1] == pytest.approx(other[0] - other[1], abs=1e-12)


def test_play_sum_and_its_closed_form_inverse():
    operator = PlaySum(np.array([0.0, 0.3, 0.8, 1.1]), np.array([0.7, 0.2, 0.4, 0.1]))
    voltage = drive()
    np.testing.assert_allclose(operator.inverse(operator.forward(voltage)), voltage, atol=1e-12)
    with pytest.raises(ParameterError, match="no inverse"):
        PlaySum(np.array([0.0, 0.3]), np.array([0.0, 1.0])).inverted()


@pytest.mark.parametrize("creep", [linear_creep(np.array([0.02, 0.05, 0.01])), logarithmic_creep(0.02)])
def test_creep_cascade_undoes_itself_for_any_steps(creep):
    steps = RNG.uniform(1e-3, 2e-2, 800)
    h = np.cumsum(RNG.normal(size=800))
    np.testing.assert_allclose(creep.undo(steps, creep.apply(steps, h)), h, atol=1e-10)


def test_logarithmic_creep_grows_by_the_same_amount_every_decade():
    creep = logarithmic_creep(0.03)
    times = np.geomspace(1e-3, 1e3, 3000)
    response = creep.apply(np.diff(np.append(0.0, times)), np.ones(3000))
    decades = np.interp([0.3, 3.0, 30.0], times, response)
    np.testing.assert_allclose(np.diff(decades), 0.03, rtol=0.02)


def test_a_non_negative_fit_ignores_columns_that_never_move():
    columns = RNG.normal(size=(200, 3)) @ np.diag([1.0, 1.0, 0.0])
    weights = non_negative_fit([columns], [columns @ np.array([2.0, 0.5, 9.0])])
    np.testing.assert_allclose(weights, [2.0, 0.5, 0.0], atol=1e-12)


@pytest.mark.parametrize("creep", ["none", "logarithmic", "linear"])
def test_a_cascade_recovers_itself(creep):
    voltage = drive()
    truth = PlaySum(np.array([0.0, 0.5, 1.0, 1.5]), np.array([0.8, 0.15, 0.1, 0.2]))
    cascade = {
        "none": linear_creep(np.zeros(3)),
        "logarithmic": logarithmic_creep(0.01),
        "linear": linear_creep(np.array([0.03, 0.0, 0.05])),
    }[creep]
    x = cascade.apply(np.full(voltage.size, 1 / RATE_HZ), truth.forward(voltage)) + 3.0
    record = training_record(record_of(x, voltage))
    fitted = CascadeRival(PrandtlIshlinskii(16), creep).fit([record])
    assert training_error_um(fitted, [record]) < 2e-2 * np.std(x)


def test_modified_operator_follows_a_loop_without_point_symmetry_where_the_classical_cannot():
    voltage = drive()
    inner = PlaySum(np.array([0.0, 0.5, 1.0]), np.array([1.0, 0.2, 0.3])).forward(voltage)
    record = training_record(record_of(inner + 0.05 * inner**2, voltage))
    classical = training_error_um(CascadeRival(PrandtlIshlinskii()).fit([record]), [record])
    fitted = ModifiedPrandtlIshlinskii().fit([record])
    assert training_error_um(fitted, [record]) < 0.3 * classical
    x = fitted.simulate(record.steps_s, voltage)
    np.testing.assert_allclose(fitted.invert(record.steps_s, x), voltage, atol=1e-9)


def test_mrc_and_classical_prandtl_ishlinskii_are_the_same_operator():
    """Krejci and Kuhnen 2001: the inverse of a sum of stops is a sum of plays; both fit the data."""
    voltage = drive()
    x = PlaySum(np.array([0.0, 0.4, 0.9, 1.4]), np.array([0.8, 0.1, 0.15, 0.1])).forward(voltage)
    record = training_record(record_of(x, voltage))
    for rival in (MaxwellResistiveCapacitor(24), CascadeRival(PrandtlIshlinskii(24))):
        assert training_error_um(rival.fit([record]), [record]) < 1e-2 * np.std(x)


def test_maxwell_slip_has_no_element_that_never_slips():
    voltage = drive()
    x = PlaySum(np.array([0.0, 0.4, 0.9]), np.array([0.8, 0.1, 0.15])).forward(voltage)
    record = training_record(record_of(x, voltage))
    fitted = MaxwellSlip().fit([record])
    assert fitted.last_v_per_um == 0.0
    assert training_error_um(fitted, [record]) < 0.02 * np.std(x)


def test_goldfarb_celanovic_finds_the_mechanics():
    """A slow stage: the second-order lag is in the data and comes out."""
    from fomrc_core.comparison.baselines.goldfarb_celanovic import FittedGoldfarbCelanovic
    from fomrc_core.comparison.baselines.mrc import FittedStops

    truth = FittedGoldfarbCelanovic(FittedStops(np.array([0.4, 1.2]), np.array([0.1, 0.15]), 0.8), 25.0, 0.5, 2.5e-3)
    voltage = drive(1200)
    steps = np.full(voltage.size, 1 / RATE_HZ)
    record = training_record(record_of(truth.simulate(steps, voltage), voltage))
    found = GoldfarbCelanovic().fit([record])
    assert found.resonance_hz == pytest.approx(25.0, rel=0.15)
    assert not found.has_inverse
    with pytest.raises(ParameterError, match="no inverse"):
        found.invert(steps, voltage)


def test_the_amplifier_is_found_for_any_rival():
    voltage = drive()
    steps = np.full(voltage.size, 1 / RATE_HZ)
    lagged = amplified_voltage(steps, voltage, 0.02)
    x = PlaySum(np.array([0.0, 0.4, 0.9]), np.array([0.8, 0.1, 0.15])).forward(lagged)
    record = training_record(record_of(x, voltage), skip_s=0.2)
    fitted = Amplified(MaxwellResistiveCapacitor(), 25).fit([record])
    assert fitted.cutoff_hz == pytest.approx(1 / (2 * np.pi * 0.02), rel=0.1)


def test_every_rival_of_the_paper_is_there_with_a_name_and_a_publication():
    rivals = all_rivals()
    assert len({rival.name for rival in rivals}) == len(rivals) == 12
    assert all(rival.publication for rival in rivals)
