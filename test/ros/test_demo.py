"""The demo, run badly; run well it is ``make demo``."""

from __future__ import annotations

from pathlib import Path

from fomrc_ros.demo import demo


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path, capsys) -> None:
    file = tmp_path / "a file"
    file.write_text("")
    assert demo.run(file / "results") == 2
    said = capsys.readouterr().err
    assert said.startswith("fomrc demo: --output: folder cannot be made")
    assert said.count("\n") == 1
