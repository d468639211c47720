"""How long a diagnosis takes: records of 90 000 samples, two threads, nothing else running."""

from __future__ import annotations

import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from test.hidden import excitation as drives
from test.hidden.bench import chance
from test.hidden.study_cases import diagnosis_plain, source_digest, write_json
from test.hidden.truth import draw_case

_N_SAMPLES = 90_000


@dataclass(frozen=True)
class Timing:
    """One timed diagnosis."""

    causes: tuple[str, ...]
    part: str = "timing"
    seed: int = 8000

    @property
    def key(self) -> str:
        """Name of the case's file."""
        return f"timing-{'+'.join(self.causes) or 'nothing'}-{self.seed}"


def plan() -> list[Timing]:
    """Return the timed cases: nothing, one effect, two."""
    return [Timing(()), Timing(("amplifier_bandwidth",)), Timing(("slow_relaxation", "mains_hum"))]


def run(timing: Timing, folder: str) -> str:
    """Time one diagnosis and write what came of it."""
    outcome: dict[str, Any] = {"spec": asdict(timing), "source": source_digest()}
    try:
        from fomrc_core.diagnosis.diagnosis import diagnose

        case = draw_case(timing.seed, timing.causes)
        setup, rng = case.setup, chance(timing.seed, "lengthened")
        drive = drives.Drive(setup.low_v, setup.high_v, setup.rate_hz)
        drive.append(np.concatenate([r.voltage_v for r in case.recordings]))
        while sum(piece.size for piece in drive.pieces) < _N_SAMPLES:
            drives.steps(drive, rng, 10.0)
        record = setup.measure(drive.values()[:_N_SAMPLES], "train", "lengthened")
        outcome["n_samples"] = record.n_samples
        with ThreadPoolExecutor(2) as executor:
            start_s = time.perf_counter()
            diagnosis = diagnose((record,), test=case.test, report=case.report, executor=executor)
            outcome["wall_s"] = time.perf_counter() - start_s
        outcome |= diagnosis_plain(diagnosis)
    except Exception as error:
        outcome |= {
            "status": "error",
            "findings": [],
            "error": repr(error),
            "traceback": traceback.format_exc(),
        }
    write_json(outcome, Path(folder) / f"{timing.key}.json")
    return timing.key
