"""One hypothesis on what has changed, as it was fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.watch.window import Window
from fomrc_core.model.piezo_model import PiezoModel

# A change shows in motion: it may be as much older, or a little younger, than it seemed.
_OLDER_S, _YOUNGER_S = 16.0, 4.0
_MOMENT_STEP_S = 1.0
# Of what no change at all leaves: the error of a trial that cannot be.
HOPELESS = 1e3
REFINE_TOLERANCE = 2e-2


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One that was fitted.

    Attributes:
        cause: its name; of an effect, the effect's.
        parameters: what was found, by name.
        n_parameters: how many numbers were fitted beside the offset.
        change_um: by how much displacement differs from the model's [um], shape (n_samples,) of the window.
        model: the model extended by it; None where no model can follow it.
        since_s: when it began, from the start of the window [s].
        is_addition: whether it is one of the many effects the model has not had.
    """

    cause: str
    parameters: Mapping[str, float]
    n_parameters: int
    change_um: Array
    model: PiezoModel | None
    since_s: float
    is_addition: bool = False


def moments(window: Window, since_s: float) -> list[float]:
    """Return when it may have begun: what shows in motion only may be older than it seems [s]."""
    found = since_s + np.arange(-_OLDER_S, _YOUNGER_S + 0.1, _MOMENT_STEP_S)
    return [float(m) for m in found if 0.0 <= m < window.duration_s - 1.0] or [since_s]


def sharpened(window: Window, since_s: float, error: Callable[[float], float]) -> float:
    """Return the moment near another one at which a change that begins there fits best [s].

    Args:
        window: the recent past.
        since_s: best of ``moments``, within two seconds of the one looked for.
        error: squared error of the change, fitted anew, that begins at a moment [s].
    """
    best, best_error, step_s = since_s, error(since_s), _MOMENT_STEP_S
    # To the sample: one that is off by a part of what is known after it leaves as large a part of the change, which is
    # often more than what tells two causes apart.
    while step_s > 0.5 * window.period_s:
        for moment in (best - step_s, best + step_s):
            if 0.0 <= moment < window.duration_s - 1.0 and (tried := error(moment)) < best_error:
                best, best_error = moment, tried
        step_s *= 0.5
    return best
