"""From the shape of a surface to the displacement of each actuator behind it, as for a deformable mirror.

The surface is linear in the displacements: surface = displacements @ matrix. Targets come as coefficients of modes
(Zernike polynomials, say, or the points of the surface themselves); the displacements that come closest,
regularised (Tikhonov), are one product with a matrix that is made once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import svd

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import ParameterError


@dataclass(frozen=True, eq=False)
class InfluenceMatrix:
    """What each actuator does to a surface.

    Args:
        matrix: surface at each point per displacement of each actuator [um/um], shape (n_actuators, n_points).
        modes: shape of each mode at each point [um per unit of its coefficient], shape (n_modes, n_points); each point
            a mode of its own where not given.
        regularisation: size of displacements weighed against the error of the surface, as a share of the largest
            singular value of the matrix [1], >= 0; 0 for plain least squares.

    Raises:
        ParameterError: shapes that do not fit, values that are not finite, a negative regularisation.
    """

    matrix: Array
    modes: Array | None = None
    regularisation: float = 1e-3

    def __post_init__(self) -> None:
        matrix = _matrix(self.matrix, "matrix")
        object.__setattr__(self, "matrix", matrix)
        if self.modes is not None:
            modes = _matrix(self.modes, "modes")
            if modes.shape[1] != matrix.shape[1]:
                raise ParameterError(
                    "number of points does not fit the matrix",
                    where="modes",
                    value=modes.shape,
                    allowed=f"(n_modes, {matrix.shape[1]})",
                )
            object.__setattr__(self, "modes", modes)
        if not (math.isfinite(self.regularisation) and self.regularisation >= 0.0):
            raise ParameterError(
                "regularisation out of range", where="regularisation", value=self.regularisation, allowed=">= 0"
            )

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        return int(self.matrix.shape[0])

    @property
    def n_targets(self) -> int:
        """Number of modes, or of points where there are none."""
        return int(self.matrix.shape[1] if self.modes is None else self.modes.shape[0])

    @cached_property
    def solution(self) -> Array:
        """Displacement of each actuator for each target [um per unit], shape (n_targets, n_actuators); made once."""
        left, singular, right = svd(self.matrix, full_matrices=False)
        cut = self.regularisation * singular[0]
        # Plain least squares leaves out what the matrix cannot tell from nothing.
        least = max(self.matrix.shape) * np.finfo(np.float64).eps * singular[0]
        inverted = np.where(singular > least, singular / np.maximum(singular**2 + cut**2, least**2), 0.0)
        onto_actuators = (right.T * inverted) @ left.T
        solution: Array = onto_actuators if self.modes is None else self.modes @ onto_actuators
        return solution

    def displacements_um(self, targets: Array) -> Array:
        """Return the displacements [um] that come closest to targets, shape (..., n_actuators).

        Args:
            targets: coefficients of the modes, or the surface at each point [um], shape (..., n_targets).

        Raises:
            ParameterError: a shape that does not fit.
        """
        wanted = np.asarray(targets, dtype=np.float64)
        if wanted.ndim == 0 or wanted.shape[-1] != self.n_targets:
            raise ParameterError(
                "number of targets does not fit",
                where="targets",
                value=wanted.shape,
                allowed=f"(..., {self.n_targets})",
            )
        found: Array = wanted @ self.solution
        return found

    def surface_um(self, displacements_um: Array) -> Array:
        """Return the surface [um] displacements make, shape (..., n_points)."""
        made: Array = np.asarray(displacements_um, dtype=np.float64) @ self.matrix
        return made


def _matrix(values: Array, where: str) -> Array:
    matrix = np.array(values, dtype=np.float64)
    if matrix.ndim != 2 or 0 in matrix.shape:
        raise ParameterError("not a matrix", where=where, value=matrix.shape, allowed="two dimensions, none empty")
    if not np.all(np.isfinite(matrix)):
        raise ParameterError("value is not finite", where=where, allowed="finite numbers")
    matrix.flags.writeable = False
    return matrix
