"""The arrays all computation is done in."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Double precision, of any shape."""

Mask: TypeAlias = NDArray[np.bool_]
"""Which of the samples."""

ComplexArray: TypeAlias = NDArray[np.complex128]
"""Gains at frequencies, of any shape."""
