"""Every command with its inputs and options spoilt, drawn from a seed: what a user may give it by mistake.

The files are written into a folder of their own; the arguments name them without a path, to be run in that folder.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from fomrc_core.cli.application import application
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.model.axes import AxesModel, AxesModes
from fomrc_core.storage import read_model, write_model
from fomrc_core.storage.axes_files import write_axes_model

_ROOT = Path(__file__).resolve().parents[2]
_N = 400

# A run of each command that ends well, in a second or two where that can be; the slow ones are spoilt all the same.
GOOD = (
    "simulate -m model.yaml -i rec.csv -o out.csv",
    "compensate -m model.yaml -i target.csv -o out.csv",
    "compensate -m ringing.yaml -i target.csv -o out.csv --bandwidth 20 --rate 500 --max-voltage 150",
    "compensate -m model.yaml -i target.csv -o out.csv --periodic --capacitance 1e-6 --arrival-tolerance 0.01",
    "compensate -m stage.yaml -i axes.csv -o out.csv --bandwidth 15 --max-voltage 150",
    "export -m model.yaml -o result --language c",
    "export -m model.yaml -o result --language python --elements 3",
    "identify rec.csv -o out.yaml --elements 3",
    "identify rec.csv other.csv --test third.csv -o out.yaml --elements 3 --json out.json",
    "identify-fleet fleet -o result --elements 3 --workers 1",
    "identify-axes axes.npz -o out.yaml --periods 2 --modes 1 --parameters 20 --json out.json",
    "check rec.csv --max-voltage 100 --max-time 60 --elements 3 --json out.json",
    "diagnose rec.csv -o result",
    "diagnose-fleet fleet -o result --workers 1",
    "watch rec.csv -m model.yaml --json out.json --learn 1",
    "view rec.csv --no-open -o out.html",
    "view model.yaml ringing.yaml --no-open -o out.html",
    "view model.yaml rec.csv --no-open -o out.html --max-voltage 100",
    "excite relax -o out.csv",
    "excite triangle -o out.csv",
    "excite staircase -o out.csv",
    "excite steps -o out.csv --levels 1,2 --dwell 1",
    "excite multisine -o out.csv",
    "benchmark fsm --train axes -o result",
    "compare rec.csv --test other.csv -o result",
    "import rec.csv -o out.csv --plot out.png",
    "import foreign.csv -o out.csv --units time=ms,voltage=V,displacement=nm",
    "import arrays.npz -o out.csv",
    "data step2 -o result",
    "doctor",
)
# Minutes long where nothing spoils them: mutated in their options and inputs only in ways that are refused.
SLOW = ("diagnose ", "diagnose-fleet", "compare", "benchmark", "reproduce", "data")

_NUMBERS = ("0", "-1", "1e308", "-1e308", "1e-308", "nan", "inf", "-inf", "99999999999", "3.7", "1e9", "0.5", "-0.0")
_WORDS = (
    "",
    " ",
    "abc",
    "1,2",
    "=",
    "time=",
    "time=ms,time=s",
    "voltage=0",
    "\u00b5",
    "--",
    "-",
    "../x",
    "a\nb",
    "x" * 300,
)
_PATHS = (
    *(
        "missing.csv",
        "empty.csv",
        "folder",
        "binary.csv",
        "model.yaml",
        "rec.csv",
        "noise.npz",
        "none/out.csv",
        "axes.npz",
    ),
    *("/dev/null", "/proc/self/mem", "fifo", "sealed/out.csv", "broken.yaml", "words.txt", ".", "foreign.csv"),
)


@dataclass(frozen=True)
class Mutated:
    """A command to run in a folder, and how it was spoilt, in words."""

    arguments: tuple[str, ...]
    how: str


def write_inputs(folder: Path) -> None:
    """Write what the good commands read, and files that are nothing of the kind."""
    rng = np.random.default_rng(0)
    t = np.arange(_N) * 0.01
    v = 40.0 - 40.0 * np.cos(2.0 * np.pi * t) * (1.0 - 0.1 * t)
    for k, name in enumerate(("rec.csv", "other.csv", "third.csv", "fleet/a.csv", "fleet/b.csv")):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        x = 0.1 * v + 0.4 * np.sin(2.0 * np.pi * t - 0.3 * k) + 1e-3 * rng.standard_normal(_N)
        _table(path, "time_s,voltage_v,displacement_um", (t, v * (1.0 - 0.1 * k), x))
    _table(folder / "foreign.csv", "Zeit;Spannung;Weg", (1e3 * t, v, 100.0 * v + rng.standard_normal(_N)), ";")
    _table(folder / "target.csv", "time_s,desired_um", (t, 1.0 - np.cos(2.0 * np.pi * t)))
    np.savez(folder / "arrays.npz", time_s=t, voltage_V=v, position_um=0.1 * v + np.sin(t))
    moved = {f"displacement_{k}_um": np.convolve(rng.standard_normal(_N), [0.5, 0.5], "same") for k in (1, 2)}
    np.savez(folder / "axes.npz", time_s=t, voltage_1_v=v, voltage_2_v=v[::-1], **moved)
    np.savez(folder / "noise.npz", words=np.array(["a", "b"]))
    text = (_ROOT / "config" / "pi_p753_table1.yaml").read_text()
    (folder / "model.yaml").write_text(text)
    ringing = read_model(folder / "model.yaml").with_effects(MechanicalResonance(30.0, 0.05))
    write_model(ringing, folder / "ringing.yaml")
    line = read_model(folder / "model.yaml")
    modes = AxesModes(np.array([20.0]), np.array([0.05]), np.ones((1, 2)) + 0j, np.array([[1.0, 0.2]]) + 0j)
    write_axes_model(AxesModel((line, line), modes, np.eye(2), 0.004), folder / "stage.yaml")
    course = 1.0 - np.cos(2.0 * np.pi * t)
    _table(folder / "axes.csv", "time_s,desired_1_um,desired_2_um", (t, course, -0.5 * course))
    (folder / "broken.yaml").write_text("model: [1, 2\n")
    (folder / "empty.csv").write_text("")
    (folder / "words.txt").write_text("to be done\n")
    (folder / "binary.csv").write_bytes(rng.bytes(3000))
    for name in ("folder", "axes", "sealed"):
        (folder / name).mkdir(exist_ok=True)
    if not (folder / "fifo").exists():
        os.mkfifo(folder / "fifo")
    (folder / "sealed").chmod(0o500)


def mutations(seed: int, folder: Path, n: int, *, with_slow: bool = True) -> Iterator[Mutated]:
    """Yield commands spoilt in one to three ways; the inputs in the folder are written anew for each.

    Args:
        seed: source of all chance.
        folder: to run them in.
        n: how many.
        with_slow: with the commands that may run for minutes where nothing spoils them.
    """
    rng = np.random.default_rng(seed)
    commands = [line for line in GOOD if with_slow or not line.startswith(SLOW)]
    for k in range(n):
        _emptied(folder)
        write_inputs(folder)
        # all commands in turn, so that each is met as often
        arguments, how = commands[k % len(commands)].split(), []
        for _ in range(int(rng.integers(1, 4))):
            spoil = _SPOILERS[int(rng.integers(len(_SPOILERS)))]
            arguments, said = spoil(arguments, folder, rng)
            how.append(said)
        yield Mutated(tuple(arguments), "; ".join(how))


def _emptied(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            path.chmod(0o700)
            shutil.rmtree(path)
        else:
            path.unlink()


def _table(path: Path, header: str, columns: tuple[np.ndarray, ...], separator: str = ",") -> None:
    rows = (separator.join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join((header, *rows, "")))


Spoilt = tuple[list[str], str]


def _options_of(arguments: list[str]) -> list[Any]:
    command: Any = typer.main.get_command(application)
    for word in arguments:
        if word not in getattr(command, "commands", {}):
            break
        command = command.commands[word]
    return [option for option in command.params if option.opts[0].startswith("-") and option.opts[0] != "--help"]


def _pick(choices: tuple[str, ...], rng: np.random.Generator) -> str:
    return choices[int(rng.integers(len(choices)))]


def _with_option(arguments: list[str], _: Path, rng: np.random.Generator) -> Spoilt:
    options = _options_of(arguments)
    if not options:
        return [*arguments, "--nothing"], "an unknown option"
    option = options[int(rng.integers(len(options)))]
    if option.is_flag:
        return [*arguments, option.opts[0]], f"{option.opts[0]} given"
    value = _pick((*_NUMBERS, *_WORDS, *_PATHS), rng)
    return [*arguments, option.opts[0], value], f"{option.opts[0]} {value!r}"


def _with_other_value(arguments: list[str], _: Path, rng: np.random.Generator) -> Spoilt:
    at = [k for k, word in enumerate(arguments) if k > 0 and not word.startswith("-")]
    if not at:
        return arguments, "nothing"
    k = at[int(rng.integers(len(at)))]
    value = _pick((*_NUMBERS, *_WORDS, *_PATHS), rng)
    return [*arguments[:k], value, *arguments[k + 1 :]], f"{value!r} for {arguments[k]}"


def _with_one_less(arguments: list[str], _: Path, rng: np.random.Generator) -> Spoilt:
    k = int(rng.integers(len(arguments)))
    return [*arguments[:k], *arguments[k + 1 :]], f"without {arguments[k]}"


def _with_one_twice(arguments: list[str], _: Path, rng: np.random.Generator) -> Spoilt:
    k = int(rng.integers(len(arguments)))
    return [*arguments[: k + 1], *arguments[k:]], f"{arguments[k]} twice"


def _with_spoilt_file(arguments: list[str], folder: Path, rng: np.random.Generator) -> Spoilt:
    files = [name for name in arguments if len(name) < 100 and "/" not in name and (folder / name).is_file()]
    if not files:
        return _with_option(arguments, folder, rng)
    name = files[int(rng.integers(len(files)))]
    content = (folder / name).read_bytes()
    is_text = b"\0" not in content[:1000]
    change = (_TEXT_CHANGES if is_text else _BYTE_CHANGES)[
        int(rng.integers(len(_TEXT_CHANGES if is_text else _BYTE_CHANGES)))
    ]
    (folder / name).write_bytes(change(content, rng))
    return arguments, f"{name} {change.__name__.strip('_').replace('_', ' ')}"


def _cut_short(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _bytes_flipped(content: bytes, rng: np.random.Generator) -> bytes:
    flipped = bytearray(content)
    for k in rng.integers(0, max(len(content), 1), 5):
        if k < len(flipped):
            flipped[k] = int(rng.integers(256))
    return bytes(flipped)


def _one_number_replaced(content: bytes, rng: np.random.Generator) -> bytes:
    cells = content.split(b",") if content.count(b",") > 5 else content.split(b" ")
    value = _pick((*_NUMBERS, "1e999", "", "nothing", "[1]", "{a: 1}", "1_0", "0x10", "null", "true"), rng)
    cells[int(rng.integers(len(cells)))] = value.encode()
    return (b"," if content.count(b",") > 5 else b" ").join(cells)


def _lines_shuffled(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    return b"\n".join(lines[int(k)] for k in rng.permutation(len(lines)))


def _a_line_left_out(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    del lines[int(rng.integers(len(lines)))]
    return b"\n".join(lines)


def _a_line_twice(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    k = int(rng.integers(len(lines)))
    return b"\n".join([*lines[: k + 1], *lines[k:]])


def _a_column_scaled(content: bytes, rng: np.random.Generator) -> bytes:
    factor = float(_pick(("1e300", "1e-300", "0", "-1", "1e6", "1e-9"), rng))
    column, lines = int(rng.integers(3)), content.decode(errors="replace").split("\n")
    for k, line in enumerate(lines[1:], 1):
        cells = line.split(",")
        try:
            cells[column] = repr(factor * float(cells[column]))
        except (ValueError, IndexError):
            continue
        lines[k] = ",".join(cells)
    return "\n".join(lines).encode()


def _made_of_zeros(content: bytes, _: np.random.Generator) -> bytes:
    return bytes(len(content))


_TEXT_CHANGES: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _cut_short,
    _bytes_flipped,
    _one_number_replaced,
    _one_number_replaced,
    _lines_shuffled,
    _a_line_left_out,
    _a_line_twice,
    _a_column_scaled,
    _a_column_scaled,
    _made_of_zeros,
)
_BYTE_CHANGES = (_cut_short, _bytes_flipped, _made_of_zeros)
_SPOILERS = (
    _with_option,
    _with_option,
    _with_other_value,
    _with_one_less,
    _with_one_twice,
    _with_spoilt_file,
    _with_spoilt_file,
)
