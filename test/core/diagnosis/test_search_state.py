"""A cause that takes another's place: what had only mended the other goes."""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState, with_rival
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3
_RATE_HZ, _DELAY = 500.0, 3


def _split() -> DataSplit:
    drive = triangle(1.0, slope_v_per_s=8.0, n_cycles=8, rate_hz=_RATE_HZ)
    late = np.concatenate((np.zeros(_DELAY), drive.voltage_v[:-_DELAY]))
    rng = np.random.default_rng(1)
    train, test = (
        Recording(drive.time_s, drive.voltage_v, 2.0 * late + rng.normal(0.0, _NOISE_UM, late.size)) for _ in range(2)
    )
    return split_data((train,), test, None, _NOISE_UM)


def test_what_had_mended_the_one_goes_where_another_takes_its_place() -> None:
    split = _split()
    base = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))

    def found(before: TrialModel, model: TrialModel, cause: str) -> Candidate:
        fitted = fit_until_still(model, split.train, None)
        return candidate_of(PresentModel.of(before, split), split, cause, fitted, bound=False)

    lag = found(base, base.with_cause(AmplifierBandwidth(20.0)), "amplifier_bandwidth")
    mended = found(lag.fitted.model, lag.fitted.model.with_cause(SlowRelaxation(1e-3, 0.05)), "slow_relaxation")
    assert mended.score.log_gain > 0.03, "beside the wrong cause it gains"
    steps = (Step(base, lag, (), ()), Step(lag.fitted.model, mended, (), ()))
    state = SearchState(mended.fitted.model, steps, mended.fitted, frozenset())
    delayed = base.with_cause(TransportDelay(_DELAY / _RATE_HZ)).with_cause(SlowRelaxation(1e-3, 0.05))
    rival = found(base.with_cause(SlowRelaxation(1e-3, 0.05)), delayed, "transport_delay")
    after = with_rival(state, 0, rival, ((), steps[1:]), split, None)
    assert [step.accepted.cause for step in after.steps] == ["transport_delay"]
    assert not after.model.has("slow_relaxation")
    assert after.final.squared_error < 1.1 * _NOISE_UM**2 * split.n_used
