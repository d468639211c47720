"""What is written is run: every example, the Python of every page as it stands, the commands of the tutorials."""

from __future__ import annotations

import importlib
import itertools
import re
import runpy
import shlex
from pathlib import Path
from typing import Any

import matplotlib.pyplot
import pytest
from sybil import Document, Example, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser, SkipParser

from fomrc_core.cli.application import run

_ROOT = Path(__file__).resolve().parents[1]
_EXAMPLES = sorted((_ROOT / "examples").glob("*.py"))
_NOTEBOOKS = sorted((_ROOT / "docs" / "notebooks").glob("*.py"))
_PAGES = [_ROOT / "README.md", _ROOT / "CONTRIBUTING.md", *sorted((_ROOT / "docs").rglob("*.md"))]

# What each example has to come to, beside ending without an error or a warning.
_SAID = {
    "simulate": r"an amplifier of 50 Hz changes that by up to [\d.]+ nm",
    "compensate": r"compensated: largest error [\d.]+e-\d+ % of the stroke",
    "identify": r"(?s)^good: error .*creep order 0\.015.*piezo model: 8 elements",
    "diagnose": r"(?s)status: explained.*\namplifier_bandwidth \(cutoff_hz (39|40)\.",
    "own_effect": r"effect interferometer_error \(amplitude_um 0\.005",
    "fleet": r"(?s)actuator_1\.csv: creep order .*actuator_3\.csv: creep order .*broken\.csv failed: ",
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to write into from which the repository's own files are found where a page names them."""
    monkeypatch.chdir(tmp_path)
    for name in ("config", "examples"):
        (tmp_path / name).symlink_to(_ROOT / name)
    return tmp_path


@pytest.mark.parametrize("path", _NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
def test_the_cells_of_a_notebook_run(here: Path, monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
    # as a script; `make docs` executes the same file as a notebook
    monkeypatch.setenv("MPLBACKEND", "agg")
    held = runpy.run_path(str(path), run_name="__main__")
    assert held["figure"].axes
    matplotlib.pyplot.close("all")


def test_there_are_four_notebooks_each_leading_to_the_next() -> None:
    assert len(_NOTEBOOKS) == 4
    for path, after in itertools.pairwise(_NOTEBOOKS):
        assert f"]({after.name})" in path.read_text(encoding="utf-8")


def test_there_are_six_examples() -> None:
    assert {path.stem for path in _EXAMPLES} == set(_SAID)
    assert len(_SAID) == 6


@pytest.mark.parametrize("path", _EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(here: Path, capsys: pytest.CaptureFixture[str], path: Path) -> None:
    before = set(here.iterdir())
    runpy.run_path(str(path), run_name="__main__")
    assert re.search(_SAID[path.stem], capsys.readouterr().out, re.MULTILINE)
    assert set(here.iterdir()) == before


def _command(example: Example) -> None:
    """Run the ``fomrc`` commands of a block, each on a line of its own or carried on by a backslash."""
    for line in example.parsed.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words and words[0] == "fomrc":
            assert run(words[1:]) == 0, line


def _document(path: Path) -> Document:
    parsers: list[Any] = [PythonCodeBlockParser(), SkipParser()]
    if "tutorials" in path.parts:
        parsers.append(CodeBlockParser("sh", _command))
    return Sybil(parsers).parse(path)


def _name(path: Path) -> str:
    return str(path.relative_to(_ROOT))


@pytest.mark.parametrize("path", [p for p in _PAGES if "```" in p.read_text(encoding="utf-8")], ids=_name)
def test_the_code_of_a_page_runs_as_it_stands(here: Path, path: Path) -> None:
    document = _document(path)
    document.namespace["__name__"] = "__main__"
    for example in document.examples():
        example.evaluate()


def test_pages_with_python_are_seen() -> None:
    # A block that is not recognised would be a block that is not run.
    for path in _PAGES:
        text = path.read_text(encoding="utf-8")
        n_examples = sum(1 for example in _document(path).examples() if isinstance(example.parsed, str))
        assert n_examples >= len(re.findall(r"^```python", text, re.MULTILINE)), _name(path)
    assert "```python" in (_ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", _PAGES, ids=_name)
def test_links_lead_somewhere(path: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
    missing = [target for target in targets if "://" not in target and not (path.parent / target).exists()]
    assert missing == []


def test_every_page_is_in_the_index() -> None:
    index = (_ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    pages = [path for path in (_ROOT / "docs").rglob("*.md") if path.name != "README.md"]
    assert [_name(p) for p in pages if f"]({p.relative_to(_ROOT / 'docs')})" not in index] == []
    for part in ("Tutorials", "How-to", "Reference", "Explanation"):
        assert f"\n## {part}" in index


def test_pages_on_the_layout_name_every_room() -> None:
    rooms = {path.parent.name for path in (_ROOT / "fomrc_core").glob("*/__init__.py")}
    readme = (_ROOT / "README.md").read_text(encoding="utf-8")
    assert [room for room in sorted(rooms) if f"{room}/`" not in readme] == []
    for page in ("CONTRIBUTING.md", "docs/explanation/model.md", "docs/decisions/storage-above-model.md"):
        text = (_ROOT / page).read_text(encoding="utf-8")
        layers = re.search(r"    errors, compute < .*\n.*", text)
        assert layers is not None, page
        assert [room for room in sorted(rooms) if not re.search(rf"\b{room}\b", layers[0])] == [], page


def test_the_pages_name_modules_that_exist() -> None:
    missing = []
    for path in _PAGES:
        named = r"`(?:python -m )?((?:fomrc_core|fomrc_ros|test|benchmarks|docs)/[\w/.-]*)"
        for found in re.findall(named, path.read_text(encoding="utf-8")):
            if not (_ROOT / found.rstrip("/.")).exists():
                missing.append(f"{_name(path)}: {found}")
    assert missing == []


def test_every_command_of_the_readme_is_run_in_the_clean_room(monkeypatch: pytest.MonkeyPatch) -> None:
    # `make readme` runs them; a command that it would pass over is seen here
    monkeypatch.syspath_prepend(str(_ROOT / "test" / "clean"))
    readme_commands = importlib.import_module("readme_commands")
    text = (_ROOT / "README.md").read_text(encoding="utf-8")
    lines = [command.line for command in readme_commands.commands_of(text)]
    blocks = re.findall(r"^    (\w+ \S+)", text, re.MULTILINE)
    typed = [block for block in blocks if block.split()[0] in ("make", "fomrc", "ros2", "pip", "python")]
    assert len(typed) >= 14
    assert [block for block in typed if not any(" ".join(block.split()) in line for line in lines)] == []
    assert {"make demo", "make test", "make docs", "fomrc excite multisine --output CSV"} <= set(lines)
    assert "fomrc identify REC.csv REC2.csv --test T.csv --output M.yaml" in lines
    with pytest.raises(ValueError, match="colcon build: not known"):
        readme_commands.commands_of("    colcon build\n")
