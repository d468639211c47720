"""Whether ``fomrc check`` foresees how far parameters would be off: 20 poor records, 50 draws of noise of each.

    python test/hidden/study_check.py [--records 20] [--draws 50]

The plant is a stack of plays with creep of this file's own making, the records lack what records lack: loops of one
width, no rests, one rate, a short time. Foreseen is the standard error of the creep order that the check tells of
single draws (the median of three), found the spread of the creep orders identified from all of them.
"""

from __future__ import annotations

import argparse

import numpy as np

from fomrc_core.identification.convex import identify
from fomrc_core.identification.fit import Fit
from fomrc_core.identification.repeated_fits import creep_order_error
from fomrc_core.records.noise import noise_floor
from fomrc_core.records.recording import Recording

_RATE_HZ = 200.0


def clean_record(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return time, drive, displacement without noise, and the rms of its noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, float(rng.uniform(6.0, 25.0)), 1.0 / _RATE_HZ)
    kind = seed % 4
    phase = 2.0 * np.pi * t
    if kind == 0:
        drive = rng.uniform(0.5, 2.0) * np.sin(phase * rng.uniform(0.3, 1.0))
    elif kind == 1:
        drive = rng.uniform(0.5, 2.0) * (0.5 - 0.5 * np.cos(phase * 0.5)) * (1.0 - 0.6 * t / t[-1])
    elif kind == 2:
        drive = np.repeat(rng.uniform(-1.5, 1.5, 6), -(-t.size // 6))[: t.size]
        drive[:20] = 0.0
    else:
        drive = rng.uniform(0.3, 0.8) * (np.sin(phase * 0.4) + np.sin(phase * 0.97))
    thresholds = np.linspace(0.02, 1.2, 14) ** 1.3
    weights = rng.uniform(0.3, 1.0, thresholds.size) * np.exp(-thresholds)
    moved = 0.8 * drive
    for threshold, weight in zip(thresholds, weights, strict=True):
        play = 0.0
        for k, v in enumerate(drive):
            play = min(max(play, v - threshold), v + threshold)
            moved[k] += 0.3 * weight * play
    # creep: t^order of every change, by convolution with the kernel's increments
    order = float(rng.uniform(0.01, 0.05))
    kernel = np.concatenate(([1.0], np.diff((1.0 + _RATE_HZ * t) ** order)))
    moved = np.convolve(moved, kernel)[: t.size]
    return t, drive, moved, 1e-3 * float(np.ptp(moved))


def foreseen_error(fit: Fit, record: Recording) -> float:
    """Return the standard error of the creep order that the check would tell."""
    return creep_order_error(fit, (record,), noise_floor((record,)).floor_um)


def main() -> int:
    """Print foreseen over found for each record, and how many are within a factor of two."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--seed", type=int, default=500)
    asked = parser.parse_args()
    ratios = []
    for seed in range(asked.seed, asked.seed + asked.records):
        t, drive, moved, noise = clean_record(seed)
        rng = np.random.default_rng(10_000 + seed)
        found, foreseen = [], []
        for _ in range(asked.draws):
            record = Recording(t, drive, moved + noise * rng.normal(size=t.size), name=str(seed))
            fit = identify(record, n_elements=6)
            found.append(fit.model.creep_order)
            if len(foreseen) < 3:
                foreseen.append(foreseen_error(fit, record))
        spread = float(np.std(found))
        ratios.append(float(np.median(foreseen)) / max(spread, 1e-12))
        print(f"record {seed}: creep order {np.mean(found):.4g}, foreseen/found {ratios[-1]:.2f}", flush=True)
    within = sum(0.5 <= ratio <= 2.0 for ratio in ratios)
    print(f"creep order: foreseen error within a factor of 2 of the one found in {within} of {len(ratios)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
