"""A lag beside a drift many times as large that nobody has found: told by what is quick, where something is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval
from scipy.signal import lfilter

from fomrc_core.diagnosis.acceptance import is_finding
from fomrc_core.diagnosis.beside_slow import found_beside_slow, innovations_score
from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import SUBSTEPS, DataSplit, split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.9, 6)), np.linspace(1.0, 0.1, 6), 0.02, (), ((), ()))
N, STEP_S, NOISE_UM = 4000, 1e-3, 1e-3
N_CAUSES = 30
LAG_S = 2e-3


def _record(seed: int, has_lag: bool, drift_um: float) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = np.arange(N) * STEP_S
    drive_v = np.cumsum(lfilter([0.05], [1.0, -0.95], rng.normal(size=N)))
    drive_v = 2.0 * drive_v / np.max(np.abs(drive_v))
    decay = np.exp(-STEP_S / LAG_S)
    reached_v = lfilter([1.0 - decay], [1.0, -decay], drive_v) if has_lag else drive_v
    moved_um = predict(PLAIN, FitRecord.of(Recording(time_s, reached_v, reached_v), substeps=SUBSTEPS), 0)
    slow_um = drift_um * chebval(2.0 * time_s / time_s[-1] - 1.0, rng.normal(size=6))
    return Recording(time_s, drive_v, moved_um + slow_um + rng.normal(0.0, NOISE_UM, N))


def _asked(seed: int, has_lag: bool, drift_um: float) -> tuple[Candidate, DataSplit]:
    records = [_record(seed + at, has_lag, drift_um) for at in (0, 1000)]
    split = split_data((records[0],), records[1], None, NOISE_UM)
    present = PresentModel.of(refit(PLAIN, split.train).model, split)
    fitted = fit_until_still(present.model.with_cause(AmplifierBandwidth(40.0)), split.train)
    return candidate_of(present, split, "amplifier_bandwidth", fitted, bound=False), split


def test_a_lag_beside_a_large_drift_is_found_by_what_is_quick() -> None:
    hidden, found = 0, 0
    for seed in range(20, 32):
        candidate, split = _asked(seed, has_lag=True, drift_um=30.0 * NOISE_UM)
        hidden += not is_finding(candidate, split, N_CAUSES)
        found += found_beside_slow([candidate], split, N_CAUSES) is candidate
    assert hidden >= 6, "the drift hides it"
    assert found >= 9, "what is quick is the lag's"


@pytest.mark.parametrize("drift_um", [0.0, 30.0 * NOISE_UM, 2.0])
def test_where_nothing_is_quick_nothing_is_found(drift_um: float) -> None:
    for seed in range(40, 48):
        candidate, split = _asked(seed, has_lag=False, drift_um=drift_um)
        assert found_beside_slow([candidate], split, N_CAUSES) is None


def test_of_causes_as_likely_the_one_with_fewest_parameters_is_taken() -> None:
    candidate, split = _asked(21, has_lag=True, drift_um=30.0 * NOISE_UM)
    richer, worse = replace(candidate, n_free=candidate.n_free + 1), _asked(21, has_lag=False, drift_um=0.0)[0]
    assert found_beside_slow([richer, worse, candidate], split, N_CAUSES) is candidate


def test_of_other_held_out_samples_nothing_is_said() -> None:
    candidate, split = _asked(21, has_lag=True, drift_um=30.0 * NOISE_UM)
    assert innovations_score(replace(candidate, held_before=()), split) is None
    assert found_beside_slow([replace(candidate, held_before=())], split, N_CAUSES) is None
