"""Whether anything is left that follows the drive, as a search asks before it tries two causes at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.nothing_left import nothing_is_left
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 0.4, 1.0])), np.array([1.5, 0.4, 0.3]), 0.02, (), ((), ()))


def _split(chain: TrialModel, colour: float) -> DataSplit:
    recordings = []
    for seed, slope_v_per_s in enumerate((2.0, 5.0)):
        drive = triangle(2.0, slope_v_per_s=slope_v_per_s, n_cycles=8, rate_hz=200.0)
        blank = Recording(drive.time_s, drive.voltage_v, drive.voltage_v)
        moved_um = predict(chain, FitRecord.of(blank, substeps=Substeps.BENDS), 0)
        white_um = np.random.default_rng(seed).normal(0.0, _NOISE_UM, moved_um.size)
        recordings.append(Recording(drive.time_s, drive.voltage_v, moved_um + lfilter([1.0], [1.0, -colour], white_um)))
    return split_data((recordings[0],), recordings[1], None, _NOISE_UM)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_of_any_colour_is_nothing_and_a_lag_is_something(colour: float) -> None:
    assert nothing_is_left(_PLAIN, _split(_PLAIN, colour))
    lagging = _PLAIN.with_cause(AmplifierBandwidth(40.0))
    assert not nothing_is_left(_PLAIN, _split(lagging, colour))
    assert nothing_is_left(lagging, _split(lagging, colour))
