"""``fomrc export``: what it writes, and bad input told in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from fomrc_core.cli.application import run

MODEL = str(Path(__file__).parents[3] / "config" / "pi_p753_table1.yaml")


def told(capsys) -> str:
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if not line.startswith("loading: ")]  # on a busy machine
    assert len(lines) == 1, captured.err
    return lines[0]


def test_it_writes_a_model_that_passes_its_self_test(tmp_path, capsys) -> None:
    folder = tmp_path / "out"
    command = ["export", "--model", MODEL, "--output", str(folder), "--rate", "20000", "--self-test"]
    assert run([*command, "--limits", "-2,2,100,0,5"]) == 0
    out = capsys.readouterr().out
    assert "self-test passed" in out
    assert "inverse state of 352 bytes" in out
    names = {
        "pi_p753_table1.h",
        "pi_p753_table1.c",
        "pi_p753_table1_golden.h",
        "self_test.c",
        "CMakeLists.txt",
        "README.md",
    }
    assert {path.name for path in folder.iterdir()} == names
    assert "SAMPLE_TIME_S 5e-05" in (folder / "pi_p753_table1.h").read_text()
    assert "-2 to 2 V, 100 V/s" in (folder / "README.md").read_text()
    # once more into the same folder: its own files are replaced
    assert run(["export", "--model", MODEL, "--output", str(folder), "--precision", "float"]) == 0
    assert "typedef float" in (folder / "pi_p753_table1.h").read_text()


def test_a_folder_with_other_files_is_refused(tmp_path, capsys) -> None:
    (tmp_path / "thesis.tex").write_text("")
    assert run(["export", "--model", MODEL, "--output", str(tmp_path)]) == 2
    line = told(capsys)
    assert "holds other files" in line
    assert "thesis.tex" in line
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_missing_compiler_is_told(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    assert run(["export", "--model", MODEL, "--output", str(tmp_path / "a"), "--self-test"]) == 2
    line = told(capsys)
    assert "no C compiler" in line
    assert "no-such-compiler" in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--language", "ada"], "--language"),
        (["--precision", "half"], "--precision"),
        (["--direction", "up"], "--direction"),
        (["--elements", "0"], "number of elements"),
        (["--elements", "61"], "number of elements"),
        (["--rate", "0"], "--rate"),
        (["--rate", "nan"], "--rate"),
        (["--rate", "1e12"], "sample period"),
        (["--name", "3d stage"], "not a name"),
        (["--name", "class"], "not a name"),
        (["--limits", "1,2"], "--limits"),
        (["--limits", "2,-2,1,0,1"], "minimum_voltage_v"),
        (["--model", "nothing.yaml"], "nothing.yaml"),
    ],
)
def test_bad_options_are_told_in_one_line(arguments, words, tmp_path, capsys) -> None:
    assert run(["export", "--model", MODEL, "--output", str(tmp_path / "a"), *arguments]) == 2
    assert words in told(capsys)
    assert not (tmp_path / "a").exists()
