"""Leave out what matters least: parameters at zero whose loss the others make good.

The rise of the cost with one parameter held at zero and all others free to follow is x_i^2 / (2 (H^-1)_ii) of the
linearised problem (Hassibi and Stork, Optimal brain surgeon, NIPS 1992), taken many at a time and fitted again.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fomrc_core.identification.axes.fit import AxesFit, NormalEquations, is_sound
from fomrc_core.identification.axes.parameters import AxesParameters, Mask

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

# What a model can do without; poles, real shapes of one gauge, delay and exponent it cannot.
_MAY_GO = (
    "output_im",
    "input_im",
    "output_re",
    "input_re",
    "softening",
    "softening_squared",
    "damping_change",
    "gain_change",
    "static",
    "static_change",
    "joint",
)
_FREE_LOSS = 1e-5  # relative rise of the cost at which a parameter goes even where there is room
_ROUND = 0.25  # share of what is to go in one round


def pruned(
    fit: AxesFit, par: AxesParameters, free: Mask, n_max: int, tell: Progress
) -> tuple[AxesParameters, Mask, NormalEquations]:
    """Return parameters, what of them is free, and the problem at the end.

    Args:
        fit: whose cost counts.
        par: fitted.
        free: what of the vector was free.
        n_max: number of free parameters not to exceed, scales of shapes not counted.
        tell: told share and text.
    """
    par = par.in_one_gauge()
    free = free & ~_gauge(par)
    par, problem = fit.fitted(par, free, n_steps=3, still=3e-4)
    while True:
        over = int(free.sum()) - n_max
        loss, order = _losses(par, free, problem)
        n_cheap = int(np.sum(loss < _FREE_LOSS * problem.cost))
        n_out = max(n_cheap, int(np.ceil(max(over, 0) * _ROUND)), min(over, 4) if over > 0 else 0)
        if n_out == 0:
            break
        gone = order[:n_out]
        x = par.vector()
        free = free.copy()
        free[gone] = False
        made_good = par.moved_to(_with_the_others(x, gone, free, problem))
        x[gone] = 0.0
        left_out = par.moved_to(x)
        start = made_good if is_sound(made_good, fit.response.step_s) else left_out
        par, problem = fit.fitted(start, free, n_steps=3, still=3e-4)
        tell(0.9, f"{int(free.sum())} parameters, error {100.0 * np.sqrt(problem.cost):.2f} %")
        if over <= 0:
            break
    par, problem = fit.fitted(par, free, n_steps=8, still=1e-4)
    return par, free, problem


def _gauge(par: AxesParameters) -> Mask:
    """Return the entries that are 1 and 0 by the choice of scale: each mode's largest input shape."""
    places = par.places()
    mask = np.zeros(par.vector().size, dtype=bool)
    for m, i in enumerate(np.argmax(np.abs(par.input_shape), axis=1)):
        mask[places["input_re"][m, i]] = mask[places["input_im"][m, i]] = True
    return mask


def _losses(par: AxesParameters, free: Mask, problem: NormalEquations) -> tuple[Array, NDArray[np.int64]]:
    """Return the rise of the cost for each that may go, ascending, and their places."""
    block = problem.matrix[np.ix_(free, free)]
    scale = np.sqrt(np.diag(block) + 1e-300)
    inverse = np.linalg.inv(block / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    variance = np.diag(inverse) / scale**2
    may = par.mask(*_MAY_GO)[free]
    at = np.flatnonzero(free)
    loss = np.where(may, par.vector()[free] ** 2 / variance, np.inf)
    order = np.argsort(loss)
    order = order[np.isfinite(loss[order])]
    return loss[order], at[order]


def _with_the_others(x: Array, gone: NDArray[np.int64], free: Mask, problem: NormalEquations) -> Array:
    """Return the vector with some at zero and the rest moved to make good for them."""
    moved = x.copy()
    block = problem.matrix[np.ix_(free, free)]
    moved[gone] = 0.0
    right = problem.matrix[np.ix_(free, gone)] @ x[gone]
    moved[free] += np.linalg.solve(block + 1e-9 * np.diag(np.diag(block)), right)
    return moved
