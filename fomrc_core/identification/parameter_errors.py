"""How sure a fit is of each of its parameters."""

from __future__ import annotations

from dataclasses import dataclass

from fomrc_core.compute.arrays import Array


@dataclass(frozen=True, eq=False)
class ParameterErrors:
    """Standard errors of fitted parameters.

    Attributes:
        creep_order: of the creep order [1].
        relative: of slope, weights and thresholds of the play form, shape (2 n + 1,).
        undetermined_elements: elements whose weight or threshold the data leave open, from 0.
    """

    creep_order: float
    relative: Array
    undetermined_elements: tuple[int, ...]
