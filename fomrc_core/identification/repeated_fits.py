"""By how much the noise of records moves what is identified from them: identified anew with as much noise again.

Which elements of the grid are joined to one is decided anew with every draw of the noise. On poor records that moves
the creep order more than any slope about a fit tells (``uncertainty`` is linearized about one); and structure that a
fit leaves beside noise, which a bootstrap takes for noise, does not change from one recording to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.identification.convex import identify
from fomrc_core.identification.fit import Fit
from fomrc_core.identification.moving_blocks import moving_blocks
from fomrc_core.records.recording import Recording

N_DRAWS = 16  # a spread from so many is known to a fifth
_IS_NOISE = 1.2  # times the noise: what a fit leaves up to this is noise, with its colour


def creep_order_error(
    fit: Fit,
    recordings: Sequence[Recording],
    noise_um: float,
    *,
    n_draws: int = N_DRAWS,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> float:
    """Return the standard error of the creep order [1].

    Args:
        fit: from ``identify``, of records that were not thinned.
        recordings: the records it was fitted on.
        noise_um: their noise floor [um].
        n_draws: of noise, 2 or more.
        seed: of the noise.
        progress: called with the share done and a word.
    """
    rng = np.random.default_rng(seed)
    n_elements, orders = fit.model.n_elements, []
    for draw in range(n_draws):
        if progress is not None:
            progress(draw / n_draws, "identified again with as much noise again")
        again = []
        for record, left_um in zip(recordings, fit.residuals_um, strict=True):
            moved_um = record.measured_um + _noise_like(np.asarray(left_um), noise_um, rng)
            again.append(replace(record, displacement_um=moved_um))
        orders.append(identify(again, n_elements=n_elements).model.creep_order)
    return float(np.std(orders, ddof=1))


def _noise_like(left_um: Array, noise_um: float, rng: np.random.Generator) -> Array:
    """Return a draw of the noise of a record [um], of blocks of what a fit leaves where that is noise, else white."""
    if np.std(left_um) > _IS_NOISE * noise_um:
        white: Array = rng.normal(0.0, noise_um, left_um.size)
        return white
    drawn: Array = moving_blocks(left_um, 1, rng)[0]
    return drawn
