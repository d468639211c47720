"""The reproduction: every bar met on the simulated plant, every number labelled, every file there."""

import json
import math
import re

import numpy as np
import pytest

from fomrc_core.plants import paper_stage
from fomrc_core.plants.simulated_rig import SimulatedRig, first_order
from fomrc_core.records import excitation
from fomrc_core.reproduction.claims import Claim
from fomrc_core.reproduction.identified_models import with_fast_effects
from fomrc_core.reproduction.reproduction import reproduce


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    directory = tmp_path_factory.mktemp("reproduction")
    shares = []
    return reproduce(directory, lambda share, _: shares.append(share), n_starts=1), directory, shares


def test_every_bar_is_met(made):
    claims = made[0].claims
    assert [claim for claim in claims if claim.is_met is False] == []
    assert sum(claim.where == "Table 2" and claim.is_met is True for claim in claims) == len(
        paper_stage.STEP_NRMSE_PERCENT
    )
    extended = [claim for claim in claims if "amplifier and resonance" in claim.what]
    assert len(extended) == len(paper_stage.SLOPE_NRMSE_PERCENT)
    assert max(claim.value for claim in extended) <= 0.40
    named = [claim for claim in claims if "diagnosis" in claim.what]
    assert len(named) == 5  # above 5 V/s
    assert all("amplifier_bandwidth" in claim.what for claim in named)


def test_every_figure_is_there_twice_and_the_page_needs_nothing_else(made):
    reproduction, directory, _ = made
    for name in reproduction.figure_names:
        assert (directory / f"{name}.png").stat().st_size > 10_000
        assert "<svg" in (directory / f"{name}.svg").read_text()
    text = (directory / "reproduction.html").read_text()
    assert text.count("data:image/png;base64,") == len(reproduction.figure_names) == 12
    assert not re.search(r"(src|href)='(?!data:)", text)
    assert "measured stage" in text
    assert "simulated plant" in text


def test_json_says_for_every_number_what_is_behind_it(made):
    data = json.loads((made[1] / "reproduction.json").read_text())
    assert {claim["paper_source"] for claim in data["claims"]} == {"measured"}
    assert {claim["value_source"] for claim in data["claims"]} == {"simulated plant"}
    assert len(data["claims"]) == len(made[0].claims)


def test_progress_only_rises(made):
    assert made[2] == sorted(made[2])
    assert made[2][-1] == 1.0


def test_a_claim_without_a_bar_is_neither_met_nor_missed():
    assert Claim("here", "what", "nm", math.nan, 1.0).is_met is None
    assert Claim("here", "what", "nm", math.nan, 1.0, 0.9).is_met is False


def test_the_rig_quantises_delays_and_adds_noise():
    quiet = SimulatedRig(noise_um=0.0)
    wave = excitation.triangle(1.0, slope_v_per_s=100.0, n_cycles=1)
    record = quiet.measure(wave)
    grid = record.measured_um / quiet.adc_step_um
    np.testing.assert_allclose(grid, np.round(grid), atol=1e-6)
    noisy = SimulatedRig(noise_um=0.01).measure(wave, seed=3)
    assert np.std(noisy.measured_um - record.measured_um) == pytest.approx(0.01, rel=0.3)
    again = SimulatedRig(noise_um=0.01).measure(wave, seed=3)
    np.testing.assert_array_equal(noisy.measured_um, again.measured_um)
    slow = SimulatedRig(noise_um=0.0, amplifier_cutoff_hz=20.0).measure(wave)
    assert np.argmax(slow.measured_um) > np.argmax(record.measured_um)


def test_first_order_lag_in_closed_form():
    t = np.arange(1, 400) * 1e-3
    ramp = first_order(np.full(t.size, 1e-3), t, 0.02)
    np.testing.assert_allclose(ramp, t - 0.02 * (1 - np.exp(-t / 0.02)), atol=1e-12)


def test_amplifier_and_resonance_are_found_on_the_rig():
    from fomrc_core.model.piezo_model import PiezoModel

    rig = SimulatedRig()
    gain = 1.0 / 1.22  # small signals: the elements hardly move
    fast = rig.measure(excitation.multisine(0.05, lowest_hz=2, highest_hz=3000, period_s=0.2, n_periods=2, rate_hz=1e4))
    model = PiezoModel([30.0, gain], [1.0], 0.015)
    found = {effect.name: effect for effect in with_fast_effects(model, fast).effects}
    assert found["amplifier_bandwidth"].cutoff_hz == pytest.approx(250.0, rel=0.1)
    assert found["mechanical_resonance"].frequency_hz == pytest.approx(2000.0, rel=0.15)
