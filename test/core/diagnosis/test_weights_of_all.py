"""Weights of plays that training drives leave open: no cause is missing where one set of weights serves all records."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judged_rest import JudgedRest
from fomrc_core.diagnosis.judgement import Judgement, Status
from fomrc_core.diagnosis.weights_of_all import unless_of_weights
from fomrc_core.records.noise import known_noise
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_files import diagnosis_results

STEP_S, NOISE_UM = 1e-3, 5e-4


def loops_um(drive_v: np.ndarray, seed: int) -> np.ndarray:
    """Return what a dozen blocks with friction at chance thresholds add up to [um], shape (n_samples,)."""
    rng = np.random.default_rng(seed)
    half_width_v, weight_um_per_v = rng.uniform(0.1, 4.5, 12), rng.exponential(0.05, 12)
    place, out = np.zeros(12), np.empty(drive_v.size)
    for k, v in enumerate(drive_v):
        place = np.clip(place, v - half_width_v, v + half_width_v)
        out[k] = weight_um_per_v @ place
    return 0.5 * drive_v + out


def swept(turns_v: list[float], n_each: int) -> np.ndarray:
    """Return a drive that goes evenly from turn to turn [V], n_each samples each."""
    parts = [np.linspace(a, b, n_each, endpoint=False) for a, b in pairwise(turns_v)]
    return np.concatenate([np.zeros(20), *parts])


def recordings(seed: int, added: bool) -> tuple[Recording, ...]:
    """Return a coarse training record and two whose turns lie elsewhere; with another cause in the last, if added."""
    rng = np.random.default_rng(100 + seed)
    drives = [swept([0.0, 5.0, -5.0, 5.0, -5.0, 5.0, 0.0], 25)]
    for _ in range(2):
        turns = rng.uniform(-5.0, 5.0, 24)
        drives.append(swept([0.0, 5.0, -5.0, *turns, 0.0], 60))
    found = []
    for k, drive_v in enumerate(drives):
        read_um = loops_um(drive_v, seed) + NOISE_UM * rng.standard_normal(drive_v.size)
        if added and k == 2:
            read_um = read_um + 0.003 * np.sin(2.0 * drive_v)
        found.append(Recording(STEP_S * np.arange(drive_v.size), drive_v, read_um, name=f"record {k}"))
    return tuple(found)


def judged(records: tuple[Recording, ...]) -> tuple[Judgement, Judgement]:
    """Return what the base leaves of the records as it was learned, and with weights learned from all of them."""
    noise = known_noise(records[:1])
    split = split_data(records[:1], records[1], records[2], NOISE_UM)
    base = base_model(split)
    rest = JudgedRest.of(base, base, split, noise, learning_excess=0.0)
    return rest.judgement, unless_of_weights(rest, base, base, split, noise)


@pytest.mark.parametrize("seed", range(2))
def test_what_weights_learned_from_all_records_explain_is_no_cause(seed: int) -> None:
    given, other = judged(recordings(seed, added=False))
    assert not given.is_noise, "the plays were learned from six sweeps in large steps"
    assert other.is_noise
    (told,) = other.rests_on
    assert "weights learned from all records" in told


@pytest.mark.parametrize("seed", range(2))
def test_what_acts_in_one_record_is_not_put_down_to_weights(seed: int) -> None:
    given, other = judged(recordings(seed, added=True))
    assert not given.is_noise
    assert other is given


def test_a_diagnosis_says_what_its_answer_rests_on() -> None:
    train, test, report = recordings(1, added=False)
    found = diagnose(train, test=test, report=report)
    assert found.status is Status.NOTHING_FOUND
    assert "weights learned from all records" in found.summary()
    assert diagnosis_results(found)["rests_on"] == list(found.judgement.rests_on)
    # what is told is what the model that is written gets
    view = next(view for view in found.records if view.name == report.name)
    quoted = np.sqrt(np.mean(view.residual_after_um**2)) / np.ptp(report.measured_um)
    assert found.final_test_percent == pytest.approx(100.0 * quoted, rel=0.05)
