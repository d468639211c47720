"""What plays get wrong between their knees repeats with the knees; an interpolator's error does so more often."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.between_knees import repeats_between_knees
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.cyclic_sensor_error import CyclicSensorError
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

_ELEMENTS = ColumnKinds.plays(np.array([0.0]))
_KNEES = tuple(np.linspace(-0.8, 0.8, 9).tolist())  # ten stretches over -1 V to 1 V
_NAME = "cyclic_sensor_error"


def _smooth_loop(drive_v: np.ndarray) -> np.ndarray:
    """Return a drive that is bent smoothly: a scale, and no play, so that every branch goes the same way."""
    return drive_v + 0.2 * np.tanh(1.3 * drive_v)


def _line_left_by_knees() -> float:
    """Return the period, in the drive, of what least squares with knees leave of a smooth bend: the strongest line."""
    drive = np.linspace(-1.0, 1.0, 4001)
    hinges = [np.maximum(drive - knee, 0.0) for knee in _KNEES]
    columns = np.column_stack([np.ones_like(drive), drive, *hinges])
    bend = np.sin(2.5 * drive) + drive**3
    left = bend - columns @ np.linalg.lstsq(columns, bend, rcond=None)[0]
    power = np.abs(np.fft.rfft(left * np.hanning(left.size)))
    return 2.0 / int(np.argmax(power[1:]) + 1)


@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e4])
def test_the_period_that_knees_leave_is_theirs_and_a_finer_one_is_the_sensors(scale: float) -> None:
    time_s = np.arange(2000) / 100.0
    records = []
    for hertz in (0.31, 0.47, 0.23):
        drive_v = np.sin(2.0 * np.pi * hertz * time_s)
        records.append(Recording(time_s, drive_v, scale * _smooth_loop(drive_v)))
    split = split_data((records[0],), records[1], records[2], 1e-3 * scale)
    plays = AsymmetricHysteresis((0.1,) * 9, _KNEES, (0.1,) * 9)
    moved_um = scale * float(np.ptp(_smooth_loop(np.array([-1.0, 1.0]))))

    def told(period_um: float, other: AsymmetricHysteresis, name: str = _NAME) -> bool:
        # as a search holds it: plays in the columns of the linear part, the rest in the effect
        columns = _ELEMENTS.joined(ColumnKinds.plays_of(other))
        error = CyclicSensorError(period_um=period_um, sine_um=1e-3 * scale)
        bare = AsymmetricHysteresis(warp_per_v=other.warp_per_v)
        weights = np.ones(columns.thresholds_v.size)
        return repeats_between_knees(TrialModel(columns, weights, 0.0, (bare, error), ((), (), ())), split, name)

    left_um = _line_left_by_knees() * moved_um / 2.0
    assert left_um == pytest.approx(0.1 * moved_um, rel=0.3)
    assert told(left_um, plays)
    assert not told(0.2 * left_um, plays)
    assert not told(left_um, AsymmetricHysteresis(warp_per_v=0.1))  # no knees, no arcs
    assert not told(left_um, plays, plays.name)
