"""Identified truths of several axes beside the truth: ``python -m benchmarks.axes_truths``."""

from __future__ import annotations

import argparse

import numpy as np

from fomrc_core.identification.axes import AxesOptions, identify_axes, periodic_record
from test.hidden.axes_truth import NOISE, RATE_HZ, record, stage


def main() -> None:
    """Print a row for each stage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axes", type=int, nargs="+", default=[2, 3, 6])
    parser.add_argument("--seeds", type=int, default=2)
    arguments = parser.parse_args()
    print("| axes | seed | modes | frequency, worst | damping, worst | error, in noise |")
    print("|---|---|---|---|---|---|")
    for n_axes in arguments.axes:
        for seed in range(arguments.seeds):
            truth = stage(n_axes, seed)
            found = [record(truth, 1.0, 1000 * seed + r) for r in range(n_axes + 2)]
            records = tuple(periodic_record(u, y, RATE_HZ, name=f"r{r}") for r, (u, y) in enumerate(found))
            fit = identify_axes(records, AxesOptions(n_poles=n_axes + 3, n_joints=0))
            modes = fit.model.modes
            assert modes is not None
            near = [int(np.argmin(np.abs(modes.frequency_hz - hz))) for hz in truth.frequency_hz]
            hz = np.abs(modes.frequency_hz[near] / truth.frequency_hz - 1.0).max()
            damping = np.abs(modes.damping[near] / truth.damping - 1.0).max()
            error = float(fit.errors.mean()) / NOISE
            row = f"{modes.n_modes} | {100 * hz:.4f} % | {100 * damping:.2f} % | {error:.2f}"
            print(f"| {n_axes} | {seed} | {row} |", flush=True)


if __name__ == "__main__":
    main()
