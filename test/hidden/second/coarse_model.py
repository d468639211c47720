"""A model with too few plays, as someone in a hurry would hand over: the lack of a model, not of an actuator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from test.hidden.second.creep import PowerLaw, creep
from test.hidden.second.plays import play_outputs
from test.hidden.second.surrogate import Trace


@dataclass(frozen=True)
class CoarseModel:
    """A slope and two or three plays before power-law creep, (t / reference)^order of a step.

    Args:
        slope_um_per_v: reversible part [um/V].
        thresholds_v: half widths [V], rising.
        weights_um_per_v: weights [um/V].
        creep_order: order of the power law.
        reference_s: time at which a step has come to its own size [s].
    """

    slope_um_per_v: float
    thresholds_v: np.ndarray
    weights_um_per_v: np.ndarray
    creep_order: float
    reference_s: float

    def displacement_um(self, trace: Trace) -> np.ndarray:
        """Return what the model makes of a drive [um]."""
        plays = play_outputs(trace.command_v, np.concatenate([[0.0], self.thresholds_v]))
        y = plays @ np.concatenate([[self.slope_um_per_v], self.weights_um_per_v])
        return creep(y, PowerLaw(self.creep_order, self.reference_s), trace.step_s)


def coarse_model(
    clean_um: np.ndarray, trace: Trace, reach_v: float, order: float, reference_s: float, n_plays: int
) -> CoarseModel:
    """Fit few plays at even thresholds to a record without noise, each with some weight.

    Args:
        clean_um: displacement [um].
        trace: its drive.
        reach_v: largest voltage of either sign [V].
        order: of the creep.
        reference_s: of the creep [s].
        n_plays: how many.
    """
    thresholds_v = 0.7 * reach_v * np.arange(1, n_plays + 1) / (n_plays + 1.0)
    plays = play_outputs(trace.command_v, np.concatenate([[0.0], thresholds_v]))
    columns = creep(plays, PowerLaw(order, reference_s), trace.step_s)
    columns, wanted = columns - columns.mean(axis=0), clean_um - clean_um.mean()
    # At least a hundredth of the slope each, lest a play vanish.
    least = np.append(0.0, np.full(n_plays, 0.01)) * np.ptp(wanted) / np.ptp(trace.command_v)
    weights = least + nnls(columns, wanted - columns @ least)[0]
    return CoarseModel(float(weights[0]), thresholds_v, weights[1:], order, reference_s)
