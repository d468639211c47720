"""How a stage of a model under fit goes after a small step of its drive, hysteresis and creep aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

_LONGEST = 1000  # samples
_STEP = 0.1  # of the range of the drive
_N_BEFORE = 2  # samples at rest: a record has more than one


def step_response(trial: TrialModel, record: FitRecord) -> Array:
    """Return the displacement after a step of the drive, of its end [1], from the step's sample on, (n_response,).

    One where nothing lags, or no step can be simulated.

    Args:
        trial: the model; what belongs to single records is left out.
        record: whose sampling, and range of the drive, the step has.
    """
    effects = tuple(e for e in trial.effects if not (e.owns_columns or e.replaces_creep or e.follows_elements))
    span_v, moved_um = float(np.ptp(record.voltage_v)), float(np.ptp(record.measured_um[record.is_used]))
    if not effects or not span_v > 0.0:
        return np.ones(1)
    slope = np.array([moved_um / span_v])
    plain = replace(
        trial,
        columns=ColumnKinds.plays(np.zeros(1)),
        weights=slope,
        creep_order=0.0,
        effects=effects,
        record_effects=((),),
        starts=(),
    )
    n = _N_BEFORE + min(_LONGEST, record.time_s.size)
    time_s, resting_v = float(np.median(record.steps_s)) * np.arange(n), np.full(n, float(np.mean(record.voltage_v)))
    stepping_v = resting_v + np.where(np.arange(n) < _N_BEFORE, 0.0, _STEP * span_v)
    drives = (Recording(np.asarray(time_s), drive_v, np.zeros(n)) for drive_v in (resting_v, stepping_v))
    try:
        rested_um, stepped_um = (predict(plain, FitRecord.of(r, substeps=record.substeps), 0) for r in drives)
    except ParameterError:
        return np.ones(1)
    response_um = (stepped_um - rested_um)[_N_BEFORE:]
    return np.asarray(response_um / response_um[-1]) if response_um[-1] != 0.0 else np.ones(1)
