"""Every command of the README in a room like a fresh container, as printed: what ends otherwise is told.

    python test/clean/readme_commands.py [--share DIR ...] [--without "make test"] [--only WORD] [--keep]

The room (clean_room.py) has the distribution's own programs and a clone of what is committed. Where pip takes packages
from a folder, name that with ``--share``; its address comes from the environment (PIP_FIND_LINKS and the like), as for
any pip. In the order of the README: ``make demo``, ``make test``, ``pip install .``, the Python of the page with what
its comments say it prints, each ``fomrc`` line as it stands, with what is in brackets and without, in a folder that
has files of the names it uses, ``make docs``, and the benchmark of ROS. A command the README has and this page does not
know is an error. ``--without`` leaves one out, which is told.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from clean_room import HOME, REPOSITORY, CleanRoom, Done

ROOT = Path(__file__).resolve().parents[2]
_PROGRAMS = ("make", "pip", "python", "fomrc", "ros2", "colcon")
_OWN = f"{HOME}/own"  # an environment as `pip install .` wants one
_FILES = f"{HOME}/files"
_NUMBERS = {"V": "3"}  # what stands for a number in an option

# Files of the names that the README's lines use.
_MAKE_FILES = """
import numpy as np
from pathlib import Path
from fomrc_core import Recording, read_model, write_model
from fomrc_core.records.excitation import staircase, triangle
from fomrc_core.storage import write_columns, write_recording

stage, noise = read_model("REPOSITORY/config/pi_p753_table1.yaml"), np.random.default_rng(0)
write_model(stage, "M.yaml", 1e-3)
for name, drive in (
    ("REC", staircase(dwell_s=0.5, rate_hz=200.0)),
    ("REC2", triangle(rate_hz=200.0)),
    ("T", triangle(2.0, rate_hz=200.0)),
):
    drive = drive.to_recording()
    moved_um = stage.simulate(drive.steps_s, drive.voltage_v) + noise.normal(0.0, 1e-3, drive.n_samples)
    write_recording(Recording(drive.time_s, drive.voltage_v, moved_um), f"{name}.csv")
time_s = np.arange(1000) * 1e-3
write_columns({"time_s": time_s, "desired_um": 2.0 * np.sin(2.0 * np.pi * time_s)}, "TARGET.csv")
# an oscilloscope's: a preamble, milliseconds, millivolts of a monitor, nanometres
rows = np.column_stack((1e3 * drive.time_s, 1e3 * drive.voltage_v, 1e3 * moved_um))
text = "Model,SCOPE\\nDate,today\\nTime (ms),V_out [mV],pos/nm\\n"
Path("FILE").write_text(text + "".join(f"{t:.3f},{v:.4f},{d:.3f}\\n" for t, v, d in rows))
# two axes on one body, two periods of a multisine each
rate_hz, n = 2000.0, 2000
for k in range(4):
    phases = np.random.default_rng(k).uniform(0.0, 2.0 * np.pi, (2, 200))
    t = np.arange(n) / rate_hz
    turns = 2.0 * np.pi * np.arange(1, 201)[:, None] * t
    v = np.stack([np.sum(0.05 * np.cos(turns + p[:, None]), axis=0) for p in phases])
    hz = np.fft.rfftfreq(n, 1.0 / rate_hz)
    answer = 1.0 / (1.0 - (hz / 150.0) ** 2 + 0.04j * hz / 150.0) * np.exp(-2j * np.pi * hz * 2e-4)
    coupling = np.array([[1.0, 0.1], [0.05, 0.8]])
    d = np.fft.irfft(np.einsum("oi,ik,k->ok", coupling, np.fft.rfft(v), answer), n)
    v, d = np.tile(v, 2), np.tile(d, 2) + 1e-4 * noise.normal(size=(2, 2 * n))
    held = {"time_s": np.arange(2 * n) / rate_hz, "period": np.repeat([0, 1], n)}
    held |= {f"voltage_{i + 1}_v": v[i] for i in range(2)} | {f"displacement_{i + 1}_um": d[i] for i in range(2)}
    np.savez("REC.npz" if k == 0 else f"REC{k + 1}.npz", **held)
"""


@dataclass(frozen=True)
class Command:
    """A command to run, and how it came out of the README.

    Attributes:
        printed: as the README has it.
        line: as it is run.
        says: patterns that its output must have.
    """

    printed: str
    line: str
    says: tuple[str, ...] = ()


def printed_commands(text: str) -> list[str]:
    """Return the commands of a page: of blocks, without what is said of them, and those within sentences."""
    found = []
    for line in text.splitlines():
        block = re.match(r"    (\S.*)", line)
        if block:
            # what is said of a command stands apart from it; so do the columns of a table of commands
            pieces = [re.split(r"\s{3,}", re.sub(r"^(fomrc \S+) +", r"\1 ", block[1]))[0]]
        else:
            # within a sentence others are names of commands, not lines to type
            pieces = [
                piece for piece in re.findall(r"`([^`]+)`", line) if piece.startswith(("make ", "pip ", "python "))
            ]
        found += [" ".join(piece.split()) for piece in pieces if piece.split()[0] in _PROGRAMS and " " in piece]
    # the picture's caption and a sentence may name a command again
    return list(dict.fromkeys(found))


def variants(printed: str) -> list[str]:
    """Return a ``fomrc`` line as it can be typed: without what is in brackets, and with it; each of alternatives."""
    lines = [re.sub(r"\s*\[[^]]*\]", "", printed), printed.replace("[", "").replace("]", "")]
    found = []
    for line in lines:
        words = line.split()
        several = next((k for k, word in enumerate(words) if "|" in word), None)
        if several is None:
            found.append(words)
        else:
            found += [[*words[:several], one, *words[several + 1 :]] for one in words[several].split("|")]
    return list(dict.fromkeys(" ".join(_typed(words)) for words in found))


def _typed(words: list[str]) -> Iterator[str]:
    for before, word in zip(["", *words], words, strict=False):
        if word == "...":
            # and more of the same
            if before.startswith("REC.npz"):
                yield "REC2.npz REC3.npz REC4.npz"
        elif word == "REC_OR_MODEL...":
            yield "M.yaml REC.csv"
        else:
            yield _NUMBERS.get(word, word)


def commands_of(text: str) -> list[Command]:
    """Return what is to be run of the README, in its order.

    Raises:
        ValueError: a command that is not known here.
    """
    found: list[Command] = []
    for printed in printed_commands(text):
        program = printed.split()[0]
        if program == "make":
            found.append(Command(printed, printed, (r" passed",) if printed == "make test" else ()))
        elif printed == "pip install .":
            found.append(Command(printed, f"python3 -m venv {_OWN} && {_OWN}/bin/pip install -q ."))
            found.append(_python_of(text))
        elif program == "fomrc":
            found += [Command(printed, line) for line in variants(printed)]
        elif program == "python":
            found.append(Command(printed, printed, (r"Hz",)))
        elif program == "ros2":
            found.append(Command(printed, printed))
        else:
            raise ValueError(f"README.md: {printed}: not known in {Path(__file__).name}")
    return found


def _python_of(text: str) -> Command:
    """Return the Python of the page with what its comments say it prints."""
    code = re.search(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert code is not None
    said = re.findall(r"^print\(.*\)  # (.*?) ?\.\.\.$", code[1], re.MULTILINE)
    assert said
    quoted = code[1].replace("'", "'\\''")
    return Command("the Python of the page", f"{_OWN}/bin/python -c '{quoted}'", tuple(map(re.escape, said)))


def run(room: CleanRoom, command: Command) -> Done | str:
    """Run a command in the room; return why it was not run where it was not."""
    program = command.line.split()[0]
    if program == "fomrc":
        room.run(f"rm -rf {_FILES} && cp -r {_FILES}.made {_FILES}", cwd=HOME)
        return room.run(command.line, cwd=_FILES, first_on_path=f"{_OWN}/bin")
    if program == "python":
        return room.run(command.line, first_on_path=f"{REPOSITORY}/.venv/bin")
    if program == "ros2":
        if room.run("command -v ros2 || ls /opt/ros").status != 0:
            return "no ROS 2 installation here, whose `ros2` it is"
        sourced = "for f in /opt/ros/*/setup.bash; do . $f; done; colcon build >/dev/null && . install/setup.bash && "
        line = command.line.replace("/path/to/model.yaml", f"{REPOSITORY}/config/pi_p753_table1.yaml")
        return room.run(f"{sourced} timeout --signal=INT 20 {line}; test $? -eq 124")
    return room.run(command.line)


def _make_files(room: CleanRoom) -> None:
    code = _MAKE_FILES.replace("REPOSITORY", str(room.path(REPOSITORY)) if not room.is_closed else REPOSITORY)
    folder = room.path(f"{_FILES}.made")
    folder.mkdir(parents=True)
    (folder.parent / "make_files.py").write_text(code)
    done = room.run(f"{_OWN}/bin/python ../make_files.py", cwd=f"{_FILES}.made")
    if done.status != 0:
        raise SystemExit(done.output)


def main() -> int:
    """Run all and print a table; exit status 1 where something was not as printed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--share", type=Path, action="append", default=[], metavar="DIR", help="seen within, for pip")
    parser.add_argument("--without", action="append", default=[], metavar="COMMAND", help="leave this one out")
    parser.add_argument("--only", default="", help="commands with this word, and what they need")
    parser.add_argument("--keep", action="store_true", help="leave the room for looking at it")
    asked = parser.parse_args()
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    room = CleanRoom(Path(tempfile.mkdtemp(prefix="clean_")), ROOT, tuple(asked.share))
    how = "closed: a mount namespace" if room.is_closed else "open: a clean environment only, namespaces are refused"
    print(f"the room is {how}\n\n| command | exit | s | |\n|---|---:|---:|---|", flush=True)
    n_wrong = 0
    try:
        for command in commands_of(text):
            is_needed = command.printed == "pip install ."
            if command.printed in asked.without or (asked.only not in command.line and not is_needed):
                print(f"| {command.line.splitlines()[0]} | | | not run, as asked |", flush=True)
                continue
            if command.line.startswith("fomrc") and not room.path(f"{_FILES}.made").exists():
                _make_files(room)
            begun_s = time.monotonic()
            done = run(room, command)
            if isinstance(done, str):
                print(f"| {command.line} | | | not run: {done} |", flush=True)
                continue
            missing = [pattern for pattern in command.says if not re.search(pattern, done.output)]
            is_wrong = done.status != 0 or bool(missing)
            n_wrong += is_wrong
            word = f"does not say {missing}" if missing else "failed" if is_wrong else "as printed"
            shown = command.printed if "\n" in command.line else command.line
            print(f"| {shown} | {done.status} | {time.monotonic() - begun_s:.0f} | {word} |", flush=True)
            if is_wrong:
                print("\n".join(f"    {line}" for line in done.output.splitlines()[-25:]), flush=True)
    finally:
        if not asked.keep:
            room.close()
        else:
            print(f"kept: {room.path('/')}")
    print(f"\nnot as printed: {n_wrong}")
    return 1 if n_wrong else 0


if __name__ == "__main__":
    shutil.which("git") or sys.exit("git is needed")
    raise SystemExit(main())
