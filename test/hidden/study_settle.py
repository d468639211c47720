"""Does the experiment a diagnosis proposes settle what it could not tell?"""

from __future__ import annotations

import csv
import re
import shlex
import subprocess
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from test.hidden import excitation as drives
from test.hidden.bench import Setup, chance
from test.hidden.study_cases import diagnosis_outcome, source_digest, truth_of, write_json
from test.hidden.truth import HiddenCase, draw_case

_ROOT = Path(__file__).resolve().parents[2]
# What the poor record shows of the effect, rms [um]: enough to be seen, too little to be recognised.
_LEAST_UM, _MOST_UM = 2e-3, 20e-3


@dataclass(frozen=True)
class Settlement:
    """A pair of causes that a poor drive can hardly tell apart, and the one of them that is true."""

    pair: tuple[str, str]
    cause: str
    excitation: str
    seed: int

    @property
    def key(self) -> str:
        """Name of the case's file."""
        return f"settle-{self.cause}-not-{self.pair[self.pair[0] == self.cause]}-{self.excitation}-{self.seed}"


_PAIRS = (
    (("amplifier_bandwidth", "transport_delay"), "slow_sines"),
    (("gain_drift", "thermal_drift"), "level_hold"),
    (("sensor_nonlinearity", "asymmetric_hysteresis"), "slow_triangle"),
)


def plan() -> list[Settlement]:
    """Return both truths of each of the three pairs."""
    return [Settlement(p, c, e, 7000 + 100 * i) for i, (p, e) in enumerate(_PAIRS) for c in p]


def proposed_drive(proposal: str, setup: Setup, part: str) -> np.ndarray:
    """Return the drive [V] that is proposed, led in from 0 V: by a command where it holds one, else by its words."""
    command = re.search(r"`fomrc (excite [^`]+)`", proposal)
    if command is None:
        return _drive_in_words(proposal, setup, part)
    drive = drives.Drive(setup.low_v, setup.high_v, setup.rate_hz)
    drive.hold(0.5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.csv"
        words = [*shlex.split(command[1]), "--rate", f"{setup.rate_hz:g}", "--output", str(path)]
        subprocess.run([sys.executable, "-m", "fomrc_core.cli", *words], check=True, cwd=_ROOT, capture_output=True)
        with path.open(encoding="utf-8") as file:
            drive.append(np.array([float(row["voltage_v"]) for row in csv.DictReader(file)]))
    return drive.values()


def _drive_in_words(proposal: str, setup: Setup, part: str) -> np.ndarray:
    """Return a drive [V] with every kind of excitation in it that a sentence names.

    Raises:
        ValueError: the proposal names no drive at all.
    """
    words = proposal.lower()
    rng = chance(setup.seed, f"proposed {part}")
    drive = drives.Drive(setup.low_v, setup.high_v, setup.rate_hz)
    drive.hold(0.5)
    n_before = len(drive.pieces)
    if "slow triangle" in words or ("triangle" in words and "fast" not in words):
        drives.slow_triangle(drive, rng, 4.0, 5)
        if "several mean" in words or "small" in words:
            _small_loops(drive, rng)
    if "fast triangle" in words:
        drives.fast_triangle(drive, rng, 300.0, 3.0)
    if "step" in words:
        drives.steps(drive, rng, 20.0)
    if "staircase" in words:
        drives.staircase(drive, rng, 8, 0.5)
    if "multisine" in words:
        drives.multisine(drive, rng, 2.0, 5, 300.0, 0.02)
    if "hold" in words or "rest" in words:
        drive.line(0.0, 20.0)
        drive.hold(30.0)
    if "again" in words or "end of a long record" in words:
        drive.hold(20.0)
        drives.slow_triangle(drive, rng, 4.0, 3)
        drives.fast_triangle(drive, rng, 300.0, 2.0)
    if np.ptp(drive.values()) == 0.0 and len(drive.pieces) > n_before:
        # Rest alone is no record of an actuator; the hysteresis must be met in it too.
        drives.slow_triangle(drive, rng, 4.0, 3)
    if len(drive.pieces) == n_before:
        raise ValueError(f"no drive named in {proposal!r}")
    return drive.values()


def _case(settlement: Settlement) -> HiddenCase:
    for seed in range(settlement.seed, settlement.seed + 100):
        case = draw_case(seed, (settlement.cause,), excitation=settlement.excitation)
        # A drift with its thermometer is no riddle, nor is an effect that the poor record shows clearly.
        is_measured = "um_per_degc" in case.parameters[settlement.cause]
        if not is_measured and _LEAST_UM <= case.visible_rms_um[settlement.cause] <= _MOST_UM:
            return case
    raise RuntimeError(f"no case for {settlement.key}")


def run(settlement: Settlement, folder: str) -> str:
    """Diagnose the poor record, run what was proposed, diagnose both together, and write what came of it."""
    outcome: dict[str, Any] = {
        "spec": {
            "part": "settle",
            "causes": [settlement.cause],
            "pair": list(settlement.pair),
            "excitation": settlement.excitation,
            "seed": settlement.seed,
        },
        "source": source_digest(),
    }
    try:
        from fomrc_core.diagnosis.diagnosis import diagnose

        case = _case(settlement)
        outcome["truth"] = truth_of(case)
        start_s = time.perf_counter()
        first = diagnose(case.recordings, test=case.test, report=case.report)
        outcome["poor"] = diagnosis_outcome(first, case)
        proposal = outcome["poor"]["next_experiment"]
        more = [
            case.setup.measure(proposed_drive(proposal, case.setup, part), part, f"proposed {part}")
            for part in ("train", "test", "report")
        ]
        second = diagnose((*case.recordings, more[0]), test=more[1], report=more[2])
        outcome["settled"] = diagnosis_outcome(second, case)
        outcome["wall_s"] = time.perf_counter() - start_s
        outcome["status"] = outcome["settled"]["status"]
        outcome["findings"] = outcome["settled"]["findings"]
    except Exception as error:
        outcome |= {
            "status": "error",
            "findings": [],
            "error": repr(error),
            "traceback": traceback.format_exc(),
        }
    write_json(outcome, Path(folder) / f"{settlement.key}.json")
    return settlement.key


def _small_loops(drive: drives.Drive, rng: np.random.Generator) -> None:
    """Add three small loops about each of several mean voltages."""
    for fraction in rng.permutation(np.linspace(0.1, 0.9, 6)):
        for _ in range(3):
            drive.line(drive.level(min(1.0, fraction + 0.1)), 2.0)
            drive.line(drive.level(max(0.0, fraction - 0.1)), 2.0)
