"""Three actuators that set a gap: piston, tip and tilt, and the 3x3 matrix between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from fomrc_core.errors import InputError, ParameterError

MOTIONS = ("piston", "tip", "tilt")
_WORST_CONDITION = 1e6

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GapGeometry:
    """Displacements of three actuators from piston, tip and tilt, and back.

    Args:
        matrix: displacement of each actuator [m] per piston [m], tip [rad] and tilt [rad], shape (3, 3).

    Raises:
        ParameterError: not 3x3, or motions that cannot be told apart.
    """

    matrix: Array

    def __post_init__(self) -> None:
        if self.matrix.size != 9:
            raise ParameterError("not a 3x3 matrix", where="geometry", value=self.matrix.size, allowed="9 numbers")
        matrix = np.array(self.matrix, dtype=np.float64).reshape(3, 3)
        # Columns are in different units: only their directions can say whether they can be told apart.
        lengths = np.linalg.norm(matrix, axis=0)
        if np.any(lengths == 0.0) or np.linalg.cond(matrix / np.where(lengths, lengths, 1.0)) > _WORST_CONDITION:
            raise ParameterError(
                "motions cannot be told apart",
                where="geometry",
                value=matrix.tolist(),
                allowed="an invertible matrix",
            )
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def from_list(cls, entries: Sequence[float]) -> GapGeometry:
        """Return the geometry of nine numbers, row by row."""
        return cls(np.array(entries, dtype=np.float64))

    def displacements_m(self, motions: Array) -> Array:
        """Return the displacement of each actuator [m] for piston [m], tip [rad], tilt [rad], shape (3,)."""
        return np.asarray(self.matrix @ motions)

    def motions(self, displacements_m: Array) -> Array:
        """Return piston [m], tip [rad], tilt [rad] for the displacement of each actuator [m], shape (3,)."""
        return np.asarray(np.linalg.solve(self.matrix, displacements_m))


def motions_of(message: JointState) -> Array:
    """Return piston, tip and tilt of a message, shape (3,); raises InputError where one is missing or not finite."""
    found = dict(zip(message.name, message.position, strict=False))
    missing = [name for name in MOTIONS if name not in found]
    if missing:
        raise InputError("not in the message", where="JointState.name", value=missing, allowed=", ".join(MOTIONS))
    motions = np.array([found[name] for name in MOTIONS])
    if not np.all(np.isfinite(motions)):
        raise InputError("not finite", where="JointState.position", value=motions.tolist(), allowed="finite")
    return motions
