"""Leave out what matters least: parameters at zero whose loss the others make good.

The rise of the cost with one parameter held at zero and all others free to follow is x_i^2 / (2 (H^-1)_ii) of the
linearised problem (Hassibi and Stork, Optimal brain surgeon, NIPS 1992), taken many at a time and fitted again.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import whitening_of
from fomrc_core.identification.axes.fit import AxesFit, AxesProblem, is_sound
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
FREE_LOSS = 3e-5  # relative rise of the cost at which a parameter goes even where there is room
_MOST_LOSS = 0.01  # relative rise of the cost by all of these
_ROUND = 0.25  # share of what is to go in one round


def pruned(
    fit: AxesFit, par: AxesParameters, free: Mask, n_max: int, tell: Progress
) -> tuple[AxesParameters, Mask, Mask]:
    """Return parameters, what of them could have been free, and what is at the end.

    Args:
        fit: whose cost counts.
        par: fitted.
        free: what of the vector was free.
        n_max: number of free parameters not to exceed, scales of shapes not counted.
        tell: told share and text.
    """
    par = par.in_one_gauge()
    asked = free = free & ~_gauge(par)
    par = fit.fitted(par, free, n_steps=3, still=3e-4)
    problem = fit.linearised(par)
    while True:
        over = int(free.sum()) - n_max
        gone, x = _leaving(par, free, problem, int(np.ceil(max(over, 0) * _ROUND)))
        if gone.size == 0:
            break
        fewer = free.copy()
        fewer[gone] = False
        start = par.moved_to(x)
        if not is_sound(start, fit.response.step_s) or fit.cost(start) > 2.0 * problem.cost:
            start = par.moved_to(np.where(fewer | ~free, par.vector(), 0.0))
        left = fit.fitted(start, fewer, n_steps=4, still=3e-4)
        left_problem = fit.linearised(left)
        if over <= 0 and left_problem.cost > (1.0 + _MOST_LOSS) * problem.cost:
            break  # what seemed free by the linearised problem was not
        par, free, problem = left, fewer, left_problem
        tell(0.9, f"{int(free.sum())} parameters, error {100.0 * np.sqrt(problem.cost):.2f} %")
        if over <= 0:
            break
    par = fit.fitted(par, free, n_steps=6, still=2e-4)
    return par, asked, free


def _gauge(par: AxesParameters) -> Mask:
    """Return the entries that are 1 and 0 by the choice of scale: each mode's largest input shape."""
    places = par.places()
    mask = np.zeros(par.vector().size, dtype=bool)
    for m, i in enumerate(np.argmax(np.abs(par.input_shape), axis=1)):
        mask[places["input_re"][m, i]] = mask[places["input_im"][m, i]] = True
    return mask


def _leaving(par: AxesParameters, free: Mask, problem: AxesProblem, n_least: int) -> tuple[NDArray[np.int64], Array]:
    """Return what leaves, and the vector without it, the rest moved to make good for it.

    One after another, each where the loss is least by the linearised problem without those before it: of several
    that stand in for one another one stays.
    """
    x, at = par.vector(), np.flatnonzero(free)
    block = problem.equations.gram[np.ix_(free, free)]
    scale = np.sqrt(np.diag(block) + 1e-300)
    whitening = whitening_of(block / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    inverse = whitening @ whitening.T
    y, may = x[at] * scale, par.mask(*_MAY_GO)[free]
    gone: list[int] = []
    while True:
        loss = np.where(may, y**2 / np.maximum(np.diag(inverse), 1e-12), np.inf)
        k = int(np.argmin(loss))
        if not np.isfinite(loss[k]) or (loss[k] > FREE_LOSS * problem.cost and len(gone) >= n_least):
            break
        y = y - inverse[:, k] * (y[k] / inverse[k, k])
        inverse = inverse - np.outer(inverse[:, k], inverse[k]) / inverse[k, k]
        may[k] = False
        gone.append(k)
    x[at] = y / scale
    x[at[gone]] = 0.0
    return at[gone], x
