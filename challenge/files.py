"""A challenge as files: a folder of records anyone may have, a key to keep, and a seal that ties them together."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from challenge.composition import CAUSES, ComposedCase
from test.hidden.second.second_case import Record

_SEAL = "seal.txt"
_COLUMNS = ("temperature_c", "cross_voltage_v", "cross_displacement_um")


class ChallengeError(Exception):
    """Bad input, in one line that names file, field, value and what is allowed."""


@dataclass(frozen=True)
class Truth:
    """What the key says of a case.

    Args:
        causes: hidden in it; () for nothing.
        details: parameters, noise, scales and the rest, for whoever wants to know after the fact.
    """

    causes: tuple[str, ...]
    details: Mapping[str, Any]


def key_path(folder: Path) -> Path:
    """Return where the key of a folder is, unless told otherwise: beside it, never in it."""
    return folder.with_name(folder.name + ".key.json")


def write_challenge(
    cases: Iterable[ComposedCase], folder: Path, key: Path, *, progress: Callable[[int], None] = lambda _: None
) -> Path:
    """Write records, the seal and a page of instructions into a new folder, and the key to its own file.

    Args:
        cases: what to write.
        folder: must not exist, or be empty.
        key: file for the key; must not be in the folder.
        progress: called with the number of cases done.

    Raises:
        ChallengeError: a folder that is in use, a key inside it, or no place to write either to.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ChallengeError(f"{folder}: is not an empty folder; allowed: a new one")
    if folder.resolve() in key.resolve().parents:
        raise ChallengeError(f"{key}: is inside {folder}; allowed: a file apart from the records")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        key.touch()
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise ChallengeError(f"{error.filename}: {error.strerror}; allowed: a place to write to") from None
    truths: dict[str, Any] = {}
    for k, composed in enumerate(cases, start=1):
        place = folder / composed.name
        place.mkdir()
        for record in composed.case.records:
            _write_record(record, place / f"{record.name}.csv")
        truths[composed.name] = {"causes": list(composed.causes), "details": _details(composed)}
        progress(k)
    # Salted: else the seal could be found again from guessed contents.
    content = json.dumps({"salt": secrets.token_hex(32), "cases": truths}, indent=1) + "\n"
    key.write_text(content, encoding="utf-8")
    (folder / _SEAL).write_text(_digest(content) + "\n", encoding="utf-8")
    (folder / "README.md").write_text(_instructions(len(truths)), encoding="utf-8")
    return key


def read_key(path: Path, folder: Path) -> dict[str, Truth]:
    """Return what the key says of each case; the seal in the folder must be that of the key.

    Raises:
        ChallengeError: no key or seal, or a key that is not the one that was sealed.
    """
    for needed in (path, folder / _SEAL):
        if not needed.is_file():
            raise ChallengeError(f"{needed}: no such file")
    content = path.read_text(encoding="utf-8")
    if (folder / _SEAL).read_text(encoding="utf-8").strip() != _digest(content):
        raise ChallengeError(f"{path}: is not the key that {folder / _SEAL} seals")
    cases = json.loads(content)["cases"]
    return {name: Truth(tuple(told["causes"]), told["details"]) for name, told in cases.items()}


def _digest(content: str) -> str:
    return hashlib.sha256(content.encode("utf-8")).hexdigest()


def _write_record(record: Record, path: Path) -> None:
    columns = {"time_s": record.time_s, "voltage_v": record.voltage_v, "displacement_um": record.measured_um}
    columns |= {name: getattr(record, name) for name in _COLUMNS if getattr(record, name) is not None}
    # Ten digits: a ten-thousandth of the least noise drawn.
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        fmt=["%.12g", *["%.10g"] * (len(columns) - 1)],
        delimiter=",",
        header=",".join(columns),
        comments="",
    )


def _details(composed: ComposedCase) -> dict[str, Any]:
    case = composed.case
    return {
        "seed": case.seed,
        "parameters": {cause: dict(values) for cause, values in case.parameters.items()},
        "visible_over_noise": {c: [v / case.noise_um for v in pair] for c, pair in case.visible_um.items()},
        "noise_kind": case.noise_kind,
        "noise_um": case.noise_um,
        "scale": asdict(case.scale),
        "hysteresis_form": case.hysteresis_form,
        "creep_order": case.creep_order,
        "form_error_over_noise": case.form_error_um / case.noise_um,
        "drive_kinds": case.drive_kinds,
        "faults": {r.name: [asdict(fault) for fault in r.faults] for r in case.records},
    }


def _instructions(n_cases: int) -> str:
    names = "\n".join(f"- `{name}`" for name in CAUSES)
    return f"""# What is wrong with these actuators?

{n_cases} cases, each a folder with three records of one piezo actuator: `train.csv` to learn from, `test.csv` to
decide on and `report.csv` to quote errors on, with other drives and mostly other rates. Columns: `time_s`,
`voltage_v` (commanded), `displacement_um` (measured, its zero arbitrary) and, where they were recorded,
`temperature_c`, `cross_voltage_v`, `cross_displacement_um` (of the second axis). Some records are faulty
(spikes, dropouts, lost samples and the like): that is no cause, and no reason for an alarm.

Hysteresis and creep alone are nothing wrong. Hidden may be nothing, or one or several of the causes below;
`unknown` is the answer where something is wrong that is none of the others.

Answer in one JSON file, a block for each case:

    {{"case_0001": {{"detected": true, "probabilities": {{"mains_hum": 0.8, "gain_drift": 0.15}}}},
     "case_0002": {{"detected": false}}}}

`detected`: whether anything is hidden. `probabilities`: over the causes, where something is detected; together at
most 1. The score is the share of hidden cases detected, the share of empty cases with an alarm, and the probability
given to what is hidden (to two causes together, where two are) on average over hidden cases, nought where nothing
was detected. `seal.txt` is the SHA-256 of the key, which was written together with these records.

{names}
"""
