"""The help of every command ends with an example, which the command would take; completion knows the commands."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from fomrc_core.cli.application import application, run
from fomrc_core.cli.help_examples import EXAMPLES


def _commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


_COMMANDS = dict(_commands(typer.main.get_command(application)))


def test_there_is_an_example_for_every_command_and_no_other() -> None:
    assert set(EXAMPLES) == set(_COMMANDS)


@pytest.mark.parametrize("name", sorted(_COMMANDS))
def test_help_ends_with_an_example_the_command_takes(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*name.split(), "--help"]) == 0
    shown = capsys.readouterr().out.rstrip().splitlines()
    assert shown[-2:] == ["  Example:", f"    {EXAMPLES[name]}"]
    words = shlex.split(EXAMPLES[name])
    assert words[: 1 + len(name.split())] == ["fomrc", *name.split()]
    # as the command reads them, without doing anything: options it does not know and values of a wrong kind are refused
    _COMMANDS[name].make_context(name, words[1 + len(name.split()) :])


def test_a_wrong_example_would_be_seen() -> None:
    with pytest.raises(Exception, match="No such option"):
        _COMMANDS["identify"].make_context("identify", ["record.csv", "--output", "m.yaml", "--elephants", "3"])


def test_a_shell_is_told_how_to_complete() -> None:
    asked = {**os.environ, "_FOMRC_COMPLETE": "complete_bash", "COMP_WORDS": "fomrc identify-", "COMP_CWORD": "1"}
    told = subprocess.run(
        [sys.executable, "-m", "fomrc_core.cli"], env=asked, capture_output=True, text=True, check=True, timeout=60
    )
    assert told.stdout.split() == ["identify-fleet", "identify-axes"]
