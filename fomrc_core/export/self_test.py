"""Build the self-test of an exported model with the compiler of this machine, and run it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.export.options import Language

C_FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
_LONGEST_S = 300.0
_ANY_COMPILERS = ("cc", "gcc", "clang")


class SelfTestError(FomrcError):
    """An exported model does not build, or does not answer as the Python model does."""


@dataclass(frozen=True)
class SelfTest:
    """What a self-test said.

    Attributes:
        with_what: the compiler or interpreter.
        lines: what the program printed.
    """

    with_what: str
    lines: tuple[str, ...]


def run_self_test(
    folder: Path, name: str, language: Language, compiler: str | None = None, flags: tuple[str, ...] = C_FLAGS
) -> SelfTest:
    """Build and run the self-test in a folder an export has written; the folder itself is left as it is.

    Args:
        folder: where the files are.
        name: name of the export.
        language: of the files.
        compiler: a C compiler, by default that of the environment variable CC, else cc, gcc or clang.
        flags: what it is told.

    Raises:
        ParameterError: there is no such compiler.
        SelfTestError: the files do not compile, or the test fails; in one line.
    """
    if language is Language.PYTHON:
        # -I -S: nothing but the standard library, nothing of the environment.
        return _run([sys.executable, "-I", "-S", str(folder / f"{name}.py")], f"python {sys.version.split()[0]}")
    command = _compiler(compiler)
    with tempfile.TemporaryDirectory() as build:
        program = Path(build) / "self_test"
        sources = [str(folder / f"{name}.c"), str(folder / "self_test.c")]
        try:
            done = subprocess.run(
                [command, *flags, *sources, "-o", str(program), "-lm"],
                capture_output=True,
                text=True,
                timeout=_LONGEST_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise SelfTestError(f"{command} cannot be run ({error})") from None
        if done.returncode != 0:
            raise SelfTestError(f"{command} does not compile the export: {_first_line(done.stderr)}")
        return _run([str(program)], command)


def _compiler(named: str | None) -> str:
    wanted = named or os.environ.get("CC") or ""
    candidates = (wanted,) if wanted else _ANY_COMPILERS
    for candidate in candidates:
        if shutil.which(candidate):
            return candidate
    raise ParameterError(
        "no C compiler found for the self-test",
        where="--self-test",
        value=", ".join(candidates),
        allowed="an installed one, also by the environment variable CC",
    )


def _run(command: list[str], with_what: str) -> SelfTest:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SelfTestError(f"self-test with {with_what} did not end ({error})") from None
    lines = tuple(done.stdout.splitlines())
    failed = [line for line in lines if "FAILED" in line]
    if done.returncode != 0 or failed:
        raise SelfTestError(f"self-test with {with_what} failed: {'; '.join(failed) or _first_line(done.stderr)}")
    return SelfTest(with_what, lines)


def _first_line(text: str) -> str:
    lines = [line for line in text.splitlines() if "error" in line] or text.splitlines()
    return lines[0] if lines else "no message"
