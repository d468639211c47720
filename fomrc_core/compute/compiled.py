"""Compile a kernel where numba is installed; run the very same function as plain Python where it is not."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

try:
    import numba
    from numba.core import event
    from numba.core.compiler_lock import global_compiler_lock
except ImportError:  # pragma: no cover - exercised in an environment without numba
    numba = None

from fomrc_core.compute.compile_lock import one_process_at_a_time
from fomrc_core.compute.pulse import beat

Function = TypeVar("Function", bound=Callable[..., Any])

IS_COMPILED = numba is not None

if numba is not None:

    class _Compiling(event.Listener):  # type: ignore[misc]
        """Gives a sign of life while kernels are compiled, which takes a minute where none is cached."""

        def on_start(self, event: Any) -> None:
            beat("kernels compiled", 0)

        def on_end(self, event: Any) -> None:
            beat("kernels compiled", 1 if event.kind == "numba:compile" else 0)

    for _kind in ("numba:compile", "numba:run_pass", "numba:llvm_lock"):
        event.register(_kind, _Compiling())


def compiled(function: Function) -> Function:
    """Return the kernel compiled at its first call and cached on disk, or unchanged without numba.

    Strict floating point: sums keep their order, so that plain Python and compiled code agree bit for bit.
    """
    return _compiled(function)


def compiled_sums(function: Function) -> Function:
    """Return the kernel compiled with sums in any order and products joined to sums, or unchanged without numba.

    For sums over elements and modes: they fill the processor's vector registers, several times faster, and
    agree with plain Python to rounding. Infinities, NaN and signed zeros keep their meaning.
    """
    return _compiled(function, fastmath={"reassoc", "contract"})


def compiled_inline(function: Function) -> Function:
    """Return a part of a ``compiled_sums`` kernel that becomes part of its callers' loops."""
    return _compiled(function, fastmath={"reassoc", "contract"}, inline="always")


def compiled_or(plain: Function) -> Callable[[Function], Function]:
    """Return a decorator like ``compiled`` that without numba takes the plain function in the kernel's place."""
    return compiled if numba is not None else lambda _: plain


def _compiled(function: Function, **options: Any) -> Function:
    if numba is None:
        return function
    options = {"error_model": "numpy", "nogil": True, **options}
    try:
        result: Function = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no folder can be written to: compile anew in each process
        return numba.njit(**options)(function)  # type: ignore[no-any-return]
    _stamp_cache(result)
    _compile_once(result)
    return result


def _compile_once(kernel: Any) -> None:
    # Nodes started together would all compile the same kernels, and the last to write the index of one loses what the
    # others wrote. The lock of this process's threads comes first: held the other way round, two processes of two
    # threads each could wait for each other.
    with contextlib.suppress(AttributeError):
        compile_here, lock = kernel.compile, Path(kernel._cache._cache_file._index_path).with_suffix(".lock")

        def compile_once(signature: Any) -> Any:
            with global_compiler_lock, one_process_at_a_time(lock):
                return compile_here(signature)

        kernel.compile = compile_once


def _stamp_cache(kernel: Any) -> None:
    # numba takes a cached kernel for fresh as long as its own file is unchanged, although kernels of other files
    # are compiled into it: the stamp must be that of all these files.
    function = kernel.py_func
    files = {function.__code__.co_filename}
    for name in function.__code__.co_names:
        files |= getattr(function.__globals__.get(name), "_source_files", set())
    kernel._source_files = files
    with contextlib.suppress(AttributeError, OSError):
        stats = [os.stat(file) for file in sorted(files)]
        kernel._cache._cache_file._source_stamp = tuple((s.st_mtime, s.st_size) for s in stats)
