"""A lead that opens before a stage that rings is found: the stage does not stand, and rings on once it is closed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from fomrc_core.effects.base.evidence import RecordEvidence
from fomrc_core.effects.base.open_behind import open_times_behind
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.step_response import step_response
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.recording import Recording

_STEP_S, _N, _UM_PER_V, _NOISE_UM = 1e-3, 3000, 0.4, 1e-3
_FREQUENCY_HZ, _DAMPING = 60.0, 0.03


def _drive() -> np.ndarray:
    """Return some slow sines [V], shape (n_samples,)."""
    time_s = _STEP_S * np.arange(_N)
    return np.asarray(5.0 * np.sin(2 * np.pi * 1.3 * time_s) + 3.0 * np.sin(2 * np.pi * 3.1 * time_s + 1.0))


def _rung(volts: np.ndarray, scale: float = _UM_PER_V) -> np.ndarray:
    """Return what a mass on a spring does of it, straight between samples [um], shape of the volts."""
    omega = 2.0 * np.pi * _FREQUENCY_HZ
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * _DAMPING * omega]])
    system = (a, np.array([[0.0], [omega**2]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    _, out, _ = dlsim(cont2discrete(system, _STEP_S, method="foh"), volts)
    return scale * out[:, 0]


def _record(openings: list[tuple[int, int]], gain: float = 1.0) -> RecordEvidence:
    drive_v, rng = _drive(), np.random.default_rng(3)
    behind_v = drive_v.copy()
    for begin, end in openings:
        behind_v[begin:end] = drive_v[begin - 1]
    model_um, left_um = _rung(drive_v), gain * (_rung(behind_v) - _rung(drive_v)) + rng.normal(0.0, _NOISE_UM, _N)
    time_s = _STEP_S * np.arange(_N)
    return RecordEvidence(time_s, np.full(_N, _STEP_S), drive_v, model_um, left_um)


def _response() -> np.ndarray:
    return _rung(np.ones(600), 1.0)


def test_openings_before_a_stage_that_rings_are_found_to_the_sample() -> None:
    openings = [(700, 730), (1500, 1512), (2200, 2260)]
    opens_s, closes_s = open_times_behind(_record(openings), _NOISE_UM, _response())
    assert np.array(opens_s) == pytest.approx(_STEP_S * np.array([a - 0.5 for a, _ in openings]), abs=1.1 * _STEP_S)
    assert np.array(closes_s) == pytest.approx(_STEP_S * np.array([b - 0.5 for _, b in openings]), abs=1.1 * _STEP_S)


def test_two_openings_of_which_the_second_comes_while_the_stage_still_rings() -> None:
    openings = [(2200, 2230), (2260, 2280)]
    opens_s, closes_s = open_times_behind(_record(openings), _NOISE_UM, _response())
    assert np.array(opens_s) == pytest.approx(_STEP_S * np.array([a - 0.5 for a, _ in openings]), abs=2.1 * _STEP_S)
    assert np.array(closes_s) == pytest.approx(_STEP_S * np.array([b - 0.5 for _, b in openings]), abs=2.1 * _STEP_S)


@pytest.mark.parametrize("gain", [0.2, -1.0, 4.0])
def test_what_is_not_what_the_stage_would_miss_is_no_opening(gain: float) -> None:
    assert open_times_behind(_record([(700, 730)], gain), _NOISE_UM, _response()) == ((), ())


def test_noise_and_a_kick_from_without_are_no_openings() -> None:
    quiet = _record([])
    assert open_times_behind(quiet, _NOISE_UM, _response()) == ((), ())
    kicked = np.zeros(_N)
    kicked[900] = 20.0
    pushed = RecordEvidence(
        quiet.time_s, quiet.steps_s, quiet.voltage_v, quiet.predicted_um, quiet.residual_um + _rung(kicked)
    )
    opens_s, _ = open_times_behind(pushed, _NOISE_UM, _response())
    assert len(opens_s) <= 1, "one at most, that other tests refuse"


def test_where_nothing_lags_it_is_left_to_the_stage_that_stands() -> None:
    assert open_times_behind(_record([(700, 730)]), _NOISE_UM, np.ones(1)) == ((), ())


def test_the_response_of_a_model_is_that_of_its_masses_alone() -> None:
    drive_v = _drive()
    record = FitRecord.of(Recording(_STEP_S * np.arange(_N), drive_v, _rung(drive_v)), substeps=Substeps.BENDS)
    plays = ColumnKinds.plays(np.array([0.0, 0.5, 2.0]))
    model = TrialModel(plays, np.array([0.3, 0.05, 0.05]), 0.02, (), ((),))
    assert step_response(model, record) == pytest.approx(np.ones(1))
    ringing = model.with_cause(MechanicalResonance(_FREQUENCY_HZ, _DAMPING))
    told = step_response(ringing.with_cause(SensorNonlinearity(0.01, 0.0)), record)
    # the drive is straight from sample to sample: so is the step
    expected = _rung(np.r_[np.zeros(1), np.ones(599)], 1.0)[1:]
    assert told[:599] == pytest.approx(expected, abs=0.02)
