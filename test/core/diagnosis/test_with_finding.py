"""By how much a cause is likelier than the next is known of one that was asked for beside all that had been found."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.with_finding import with_finding
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_NOISE_UM, _RATE_HZ, _LAG_S = 1e-3, 500.0, 0.02
_CAUSES = ("amplifier_bandwidth", "gain_drift", "sensor_nonlinearity")


def _split() -> DataSplit:
    """Return records of a line behind a lag, read by a sensor that bends."""
    drive = triangle(1.0, slope_v_per_s=8.0, n_cycles=8, rate_hz=_RATE_HZ)
    late, decay = np.zeros(drive.voltage_v.size), math.exp(-1.0 / (_RATE_HZ * _LAG_S))
    for k in range(1, late.size):
        late[k] = drive.voltage_v[k - 1] + decay * (late[k - 1] - drive.voltage_v[k - 1])
    moved_um, rng = 2.0 * late + 0.04 * late**2, np.random.default_rng(1)
    train, test = (
        Recording(drive.time_s, drive.voltage_v, moved_um + rng.normal(0.0, _NOISE_UM, late.size)) for _ in range(2)
    )
    return split_data((train,), test, None, _NOISE_UM)


@pytest.fixture(scope="module")
def found() -> tuple[DataSplit, SearchState, Candidate, list[Candidate]]:
    """Return a state with a lag of a pair, what is accepted next, and all it is compared with."""
    split = _split()
    base = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))

    def fitted(before: TrialModel, model: TrialModel, cause: str) -> Candidate:
        at_rest = fit_until_still(model, split.train, None)
        return candidate_of(PresentModel.of(before, split), split, cause, at_rest, bound=False)

    lag = fitted(base, base.with_cause(AmplifierBandwidth(1.0 / (2.0 * math.pi * _LAG_S))), "amplifier_bandwidth")
    beside = lag.fitted.model
    bent = fitted(beside, beside.with_cause(SensorNonlinearity(0.01, 0.0)), "sensor_nonlinearity")
    drifts = fitted(beside, beside.with_cause(GainDrift(1e-4)), "gain_drift")
    state = SearchState(beside, (Step(base, lag, (), ()),), lag.fitted, frozenset({"amplifier_bandwidth"}))
    return split, state, bent, [bent, drifts]


def test_what_was_asked_for_beside_a_pair_was_compared(
    found: tuple[DataSplit, SearchState, Candidate, list[Candidate]],
) -> None:
    split, state, bent, candidates = found
    assert math.isnan(state.steps[-1].margin), "those of a pair are compared at last"
    after = with_finding(state, bent, candidates, split, _CAUSES, None)
    assert [step.accepted.cause for step in after.steps] == ["amplifier_bandwidth", "sensor_nonlinearity"]
    assert min(after.steps[-1].margin, after.steps[-1].whitened_margin) > SURE


def test_the_second_of_a_pair_was_not_compared_beside_the_first(
    found: tuple[DataSplit, SearchState, Candidate, list[Candidate]],
) -> None:
    split, state, bent, candidates = found
    after = with_finding(state, bent, candidates, split, _CAUSES, None, is_second=True)
    assert [step.accepted.cause for step in after.steps] == ["amplifier_bandwidth", "sensor_nonlinearity"]
    assert math.isnan(after.steps[-1].margin)
    assert math.isnan(after.steps[-1].whitened_margin)
