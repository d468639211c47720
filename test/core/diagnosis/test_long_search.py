"""Long records: thinned, searched and judged on all their readings; named right, and stated what that loses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_files import diagnosis_results
from fomrc_core.report.fit_results import fit_results
from test.core.fitting.test_thinned_record import NOISE_UM, RATE_HZ, jumps_and_loops
from test.core.small_model import MODEL

N = 120_000
LITTLE_GB = 0.56  # for some 4000 samples at a time


def long_record(load_um: float, slow_um: float = 0.0, hum_um: float = 0.0) -> Recording:
    time_s, voltage_v = jumps_and_loops(N)
    moved_um = PiezoModel.from_mapping(MODEL).simulate(np.full(N, 1.0 / RATE_HZ), voltage_v)
    moved_um += load_um * ((time_s > 4.1) & (time_s < 7.9))
    moved_um += hum_um * np.sin(2.0 * np.pi * 50.0 * time_s + 0.3)
    rng = np.random.default_rng(2)
    keep = math.exp(-1.0 / (0.02 * RATE_HZ))
    walk = rng.normal(0.0, slow_um * math.sqrt(1.0 - keep**2), N)
    for k in range(1, N):
        walk[k] += keep * walk[k - 1]
    return Recording(time_s, voltage_v, moved_um + rng.normal(0.0, NOISE_UM, N) + walk, name="long")


def test_a_load_in_a_long_record_is_named_and_the_thinning_stated():
    found = diagnose(long_record(load_um=0.02), max_memory_gb=LITTLE_GB)
    assert [f.cause for f in found.findings] == ["external_load"]
    assert found.findings[0].parameters["displacement_um"] == pytest.approx(0.02, rel=0.02)
    thinning = found.thinning
    assert thinning is not None
    assert thinning.n_samples == N
    assert thinning.n_kept < 5_000
    # on all readings, at their own rate, what is left is their noise
    assert thinning.rms_um < 1.1 * NOISE_UM
    assert thinning.left_within == ()
    assert diagnosis_results(found)["thinning"]["words"] == list(thinning.sentences())


def test_coloured_noise_in_a_long_record_is_no_cause():
    found = diagnose(long_record(load_um=0.0, slow_um=5e-4), max_memory_gb=LITTLE_GB)
    assert found.findings == ()
    assert found.thinning is not None


def test_a_hum_in_a_long_record_gets_no_false_name_and_is_told():
    found = diagnose(long_record(load_um=0.0, hum_um=2e-3), max_memory_gb=LITTLE_GB)
    assert found.findings == ()
    assert found.status is Status.UNEXPLAINED
    stated = diagnosis_results(found)["thinning"]
    (tone,) = stated["tones"]
    assert tone["frequency_hz"] == pytest.approx(50.0, abs=1e-3)
    # the first fit, to readings with the hum, leaves some of the drive at 50 Hz as well
    assert tone["amplitude_um"] == pytest.approx(2e-3, rel=0.02)
    assert any("a steady tone of" in words for words in stated["words"])
    assert stated["rms_um"] < 1.1 * NOISE_UM


def test_a_fit_to_a_long_record_has_the_errors_of_its_single_readings():
    fit = identify(long_record(load_um=0.0), n_elements=3, max_memory_gb=0.53)
    assert fit.thinning is not None
    assert (
        abs(fit.model.creep_order - PiezoModel.from_mapping(MODEL).creep_order) < 5.0 * fit.creep_order_standard_error
    )
    assert abs(fit.rms_um / NOISE_UM - 1.0) < 0.03
    assert fit_results(fit, ["long"], "convex")["thinning"]["n_samples"] == N
