"""Whether an error that repeats with the displacement is what one-sided plays get wrong between their knees.

Between two knees plays follow a smooth loop by as good as straight lines. What they leave is an arc, and the next one
begins at the next knee: an error in as many cycles over the stroke as there are knees, which no sensor makes. Where
the period is that of the knees nothing tells the two apart.
"""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.trial_model import TrialModel

# Of the way between knees. An arc is a line at the knees' spacing with little in the harmonics, the second a quarter
# of it; branches of a loop bend the way by less than twice.
_SHORTEST = 0.5


def repeats_between_knees(model: TrialModel, split: DataSplit, cause: str) -> bool:
    """Return whether a cause errs in cycles that are half as long as the way between knees of one-sided plays, or more.

    Args:
        model: with the cause.
        split: records.
        cause: its name.
    """
    effects = model.actuator_effects()
    cycle_um = max((effect.cycle_um for effect in effects if effect.name == cause), default=0.0)
    knees_v = np.unique(np.concatenate([effect.plays()[1] for effect in effects] or [np.zeros(0)]))
    if not cycle_um > 0.0 or knees_v.size < 2:
        return False
    spacing_v = float(np.max(np.diff(knees_v)))
    moved_um = max(float(np.ptp(record.measured_um[record.is_used])) for record in split.train)
    driven_v = max(float(np.ptp(record.voltage_v)) for record in split.train)
    return cycle_um > _SHORTEST * spacing_v * moved_um / driven_v
