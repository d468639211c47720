"""The base of a diagnosis: hysteresis and creep on a grid of thresholds so fine that it is not what is wrong."""

from __future__ import annotations

from dataclasses import replace

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.base_fit import choose_starts, fit_base, rebased, threshold_grid
from fomrc_core.fitting.fit_record import shortest_time
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.drive import longest_sweep

N_THRESHOLDS = 112  # of the first fit
N_GRID = 224  # from which plays are then chosen: a ceramic's own are not on the grid


def base_model(split: DataSplit, n_thresholds: int = N_THRESHOLDS) -> TrialModel:
    """Return the model without causes that fits the records of a split.

    Args:
        split: records.
        n_thresholds: plays of the first fit.
    """
    columns = ColumnKinds.plays(threshold_grid(split.train, n_thresholds))
    records = (*split.train, *(part.record for part in (*split.held, *split.report)))
    model, _, _ = fit_base(split.train, columns, choose_starts(split.train), shortest_time_s=shortest_time(records))
    n_grid = min(max(longest_sweep([r.voltage_v for r in split.train]), n_thresholds), N_GRID)
    nothing = tuple(() for _ in range(split.n_records))
    model = replace(model, record_effects=nothing, grid_v=threshold_grid(split.train, n_grid))
    return refit(rebased(model, split.train), split.train, n_iterations=3).model
