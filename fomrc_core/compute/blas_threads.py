"""Keep linear algebra to one thread where matrices are tall and thin: threads that wait cost four times the time."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

Function = TypeVar("Function", bound=Callable[..., Any])


def with_one_algebra_thread(function: Function) -> Function:
    """Return the function with BLAS held to one thread while it runs; the limit before it comes back after."""

    @wraps(function)
    def limited(*arguments: Any, **options: Any) -> Any:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*arguments, **options)

    return limited  # type: ignore[return-value]
