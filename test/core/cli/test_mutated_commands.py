"""Every command with spoilt inputs and options ends as it should; ``test/core/mutation_study.py`` runs 300 of them."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from mutated_commands import GOOD, mutations

from fomrc_core.cli.application import run

_N = 40


@pytest.mark.filterwarnings("ignore")  # what libraries warn of is no matter of how a command ends
def test_spoilt_commands_are_done_or_refused_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BROWSER", "true")
    for mutated in mutations(11, tmp_path, _N, with_slow=False):
        status = run(mutated.arguments)  # an exception that nobody caught fails here
        said = capfd.readouterr()
        assert status in (0, 2), mutated
        if status == 2:
            told = [*said.err.splitlines(), *said.out.splitlines()]
            assert sum(line.startswith(("fomrc: ", "Usage: ")) for line in told) == 1, (mutated, told)
        half_written = [path.name for path in tmp_path.rglob("*") if path.name.startswith(".")]
        assert half_written == [], mutated
    plt.close("all")


def test_every_command_is_among_them() -> None:
    from fomrc_core.cli.application import application

    named = {command.name or command.callback.__name__ for command in application.registered_commands}
    named |= {group.name for group in application.registered_groups}
    # the demonstration and the reproduction take no input, and their only option names a folder
    assert named - {line.split()[0] for line in GOOD} == {"demo", "reproduce"}
