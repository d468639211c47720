"""Processes that start together compile each kernel once among them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from fomrc_core.compute.compile_lock import one_process_at_a_time

_KERNELS = """
import sys
from fomrc_core.compute.compiled import compiled, compiled_sums

@compiled
def halved(value: float) -> float:
    return 0.5 * value

@compiled_sums
def summed(values) -> float:
    total = 0.0
    for k in range(values.size):
        total += halved(values[k])
    return total
"""
_CALLS = """
import sys
import numpy as np
import kernels
print("ready", flush=True)
sys.stdin.readline()
assert kernels.summed(np.ones(4)) == 2.0
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in (kernels.halved, kernels.summed)))
"""
_HOLDS = """
import sys
from pathlib import Path
from fomrc_core.compute.compile_lock import one_process_at_a_time
with one_process_at_a_time(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.readline()
"""


def _python(code: str, *arguments: str, **more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(
        command, env=os.environ | more, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def test_processes_that_start_together_compile_each_kernel_once(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(_KERNELS)
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[3])])
    started = [_python(_CALLS, PYTHONPATH=path, NUMBA_CACHE_DIR=str(tmp_path / "cache")) for _ in range(3)]
    try:
        assert [_line(process) for process in started] == ["ready"] * 3
        for process in started:
            assert process.stdin is not None
            process.stdin.write("\n")
        assert sum(int(_line(process)) for process in started) == 2
    finally:
        for process in started:
            process.communicate(timeout=60.0)


def test_a_lock_is_waited_for_only_so_long_and_ends_with_who_held_it(tmp_path: Path) -> None:
    file = tmp_path / "folder" / "kernel.lock"
    with _python(_HOLDS, str(file), PYTHONPATH=str(Path(__file__).parents[3])) as holds:
        assert _line(holds) == "held"
        with one_process_at_a_time(file, longest_wait_s=0.1):
            assert not _can_be_held(file)
        holds.kill()
    with one_process_at_a_time(file):
        assert not _can_be_held(file)
    assert _can_be_held(file)


def test_where_no_lock_can_be_made_it_goes_on_without(tmp_path: Path) -> None:
    (tmp_path / "a file").write_text("")
    with one_process_at_a_time(tmp_path / "a file" / "kernel.lock"):
        assert (tmp_path / "a file").read_text() == ""


def _can_be_held(file: Path) -> bool:
    import fcntl

    with file.open("ab") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
