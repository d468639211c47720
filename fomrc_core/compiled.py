"""Compile a kernel where numba is installed; run the very same function as plain Python where it is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

try:
    import numba
except ImportError:  # pragma: no cover - exercised in an environment without numba
    numba = None

Function = TypeVar("Function", bound=Callable[..., Any])

IS_COMPILED = numba is not None


def compiled(function: Function) -> Function:
    """Return the kernel compiled at its first call and cached on disk, or unchanged without numba.

    Strict floating point: sums keep their order, so that plain Python and compiled code agree to rounding.
    """
    if numba is None:
        return function
    result: Function = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return result
