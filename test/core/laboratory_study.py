"""What a laboratory does and a made record does not: a drive held out that goes farther, a monitor with noise.

    python test/core/laboratory_study.py                    # the tables, on the seeds kept for reporting
    python test/core/laboratory_study.py --first-seed 100   # on those it was developed with

Each is diagnosed as it is, and as it would be if nothing were known of it ("before").
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from relay_stage import N, drive_v, driven, lagged, monitored, recording

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.records.quality import FaultKind, examine
from fomrc_core.records.recording import Recording

_REPORTING = 50_000
_FARTHER = (1.0, 1.5, 1.3)  # training, test and report

Draw = Callable[[int], tuple[Recording, Recording, Recording]]


def farther(cutoff_hz: float) -> Draw:
    """Return records of which those that are held out go farther."""
    return lambda seed: tuple(driven(seed + k, v, cutoff_hz) for k, v in enumerate(_FARTHER))  # type: ignore[return-value]


def noisy(seed: int) -> tuple[Recording, Recording, Recording]:
    """Return records of a monitor of 2 mV rms in 2 V."""
    return monitored(seed, 2e-3), monitored(seed + 1, 2e-3), monitored(seed + 2, 2e-3)


def answers(draw: Draw, seeds: range) -> str:
    """Return how often each status and names came."""
    told: Counter[str] = Counter()
    for seed in seeds:
        train, test, report = draw(seed)
        found = diagnose(train, test=test, report=report)
        told[" ".join((found.status.value, *(finding.cause for finding in found.findings)))] += 1
    return "; ".join(f"{count} {answer}" for answer, count in told.most_common())


def is_smoothed(record: Recording) -> bool:
    """Return whether noise of the drive is told of a record."""
    return any(fault.kind is FaultKind.NOISY_DRIVE for fault in examine(record).quality.faults)


def smoothed(seeds: range) -> str:
    """Return of how many drives that a noisy monitor read, and of how many that are as rough, noise is told."""
    told = [f"{sum(is_smoothed(monitored(s, v)) for s in seeds)} at {1e3 * v:g} mV rms" for v in (1e-3, 2e-3, 5e-3)]
    rough = {s: drive_v(s) + 4e-3 * np.random.default_rng(s).standard_normal(N) for s in seeds}
    for cutoff_hz in (np.inf, 40.0, 6.0, 2.0):
        at = {s: lagged(v, cutoff_hz) if np.isfinite(cutoff_hz) else v for s, v in rough.items()}
        n = sum(is_smoothed(recording(at[s], rough[s], s)) for s in seeds)
        told.append(f"{n} of drives as rough, followed up to {cutoff_hz:g} Hz")
    return "; ".join(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first-seed", type=int, default=_REPORTING)
    parser.add_argument("--n", type=int, default=20, help="draws of each")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + 5 * arguments.n, 5)
    nothing_beyond = mock.patch("fomrc_core.diagnosis.data_split.untaught_plays", return_value=np.zeros(0))
    nothing_noisy = mock.patch("fomrc_core.records.quality.examination.drive_noise_v", return_value=0.0)
    rows = (
        ("nothing hidden, held out goes farther", farther(0.0), nothing_beyond),
        ("an amplifier of 6 Hz, held out goes farther", farther(6.0), nothing_beyond),
        ("nothing hidden, a noisy monitor", noisy, nothing_noisy),
    )
    for name, draw, blind in rows:
        with blind:
            before = answers(draw, seeds)
        print(f"{name}\n    before: {before}\n    now: {answers(draw, seeds)}", flush=True)
    many = range(arguments.first_seed, arguments.first_seed + 10 * arguments.n)
    print(f"noise told of {len(many)} drives each: {smoothed(many)}")


if __name__ == "__main__":
    main()
