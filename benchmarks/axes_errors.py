"""Are the standard errors of several axes true? ``python -m benchmarks.axes_errors``.

Each draw has drives and noise of its own, of one stage of another form than the model (masses, springs, Bouc-Wen
springs at the drives, a delay; with ``--levels`` springs that soften with the level). An error is what was found less
the truth where it has such a number, and what was found less the mean of all draws. Errors over their standard errors
should spread by 1. Of what pruning leaves out in some draws nothing is told: what stays by chance is large by chance.
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from fomrc_core.identification.axes import AxesIdentification, AxesOptions, identify_axes, periodic_record
from test.hidden.axes_truth import RATE_HZ, Stage, at_level, record, stage

Array = NDArray[np.float64]
Found = dict[str, list[tuple[float, float, float]]]

DELAY_S = 0.4 / RATE_HZ
LEVELS_V = (0.5, 1.0, 2.0)
SOFTENING, EXPONENT = -0.01, 0.5


def main() -> None:
    """Print a row for each kind of number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axes", type=int, default=2)
    parser.add_argument("--stage", type=int, default=0, help="seed of the stage")
    parser.add_argument("--draws", type=int, default=30)
    parser.add_argument("--levels", action="store_true", help="three levels, two records of each")
    arguments = parser.parse_args()
    truth = stage(arguments.axes, arguments.stage)
    found: Found = defaultdict(list)
    for draw in range(arguments.draws):
        _take(found, identified(truth, draw, arguments.levels), truth)
    print("| number | rms from the truth | rms from the mean | beyond 2 of the mean | median standard error | values |")
    print("|---|---|---|---|---|---|")
    for kind in dict.fromkeys(name.split(" ")[0] for name in found):
        of_kind = {name: np.array(values) for name, values in found.items() if name.split(" ")[0] == kind}
        print(_row(kind, list(of_kind.values()), arguments.draws), flush=True)


def identified(truth: Stage, draw: int, has_levels: bool) -> AxesIdentification:
    """Return what is found from one draw of drives and noise."""
    n_axes = truth.b.shape[1]
    levels = np.repeat(LEVELS_V, 3) if has_levels else np.ones(n_axes + 2)
    records = []
    for r, level in enumerate(levels):
        own = at_level(truth, SOFTENING * (level**EXPONENT - 1.0)) if has_levels else truth
        u, y = record(own, float(level), 100_000 + 100 * draw + r, delay_s=DELAY_S)
        records.append(periodic_record(u, y, RATE_HZ, name=f"r{r}"))
    return identify_axes(tuple(records), AxesOptions(n_poles=n_axes + 3, n_joints=0))


def _take(found: Found, fit: AxesIdentification, truth: Stage) -> None:
    """Add value, standard error and truth (nan where it has none) of each number."""
    modes, sure = fit.model.modes, fit.standard_errors
    assert modes is not None
    soft, squared, _, gain_change = modes.changes
    for k, (hz, damping) in enumerate(zip(truth.frequency_hz, truth.damping, strict=True)):
        m = int(np.argmin(np.abs(modes.frequency_hz - hz)))
        found[f"frequency {k}"].append((modes.frequency_hz[m], sure.frequency_hz[m], hz))
        found[f"damping {k}"].append((modes.damping[m], sure.damping[m], damping))
        found[f"gain {k}"].append((fit.gains[m], sure.gain[m], np.nan))
        found[f"softening {k}"].append((soft[m], sure.softening[m], SOFTENING if squared[m] == 0.0 else np.nan))
        found[f"gain_change {k}"].append((gain_change[m], sure.gain_change[m], np.nan))
    found["delay"].append((fit.model.delay_s, sure.delay_s, DELAY_S))
    exponent = np.nan if fit.model.level is None else fit.model.level.exponent
    found["exponent"].append((exponent, sure.exponent, np.nan))
    for name, values, errors in (
        ("coupling", fit.model.static, sure.static),
        ("weight", fit.parameters.play_weights, sure.play_weights),
    ):
        for at in np.ndindex(values.shape):
            found[f"{name} {at}"].append((values[at], errors[at], np.nan))


def _row(kind: str, numbers: list[Array], n_draws: int) -> str:
    """Return the row of numbers of one kind, each (n_draws, 3): those that were fitted in every draw."""
    always = [values for values in numbers if len(values) == n_draws and np.all(np.isfinite(values[:, 1]))]
    if not always:
        return f"| {kind} | - | - | - | not in every draw | 0 |"
    from_truth = np.concatenate([(values[:, 0] - values[:, 2]) / values[:, 1] for values in always])
    from_mean = np.concatenate([_from_mean(values[:, 0], values[:, 1]) for values in always])
    truth = "-" if np.any(np.isnan(from_truth)) else f"{np.sqrt(np.mean(from_truth**2)):.2f}"
    beyond = 100.0 * float(np.mean(np.abs(from_mean) > 2.0))
    error = float(np.median(np.concatenate([values[:, 1] for values in always])))
    spread = float(np.sqrt(np.mean(from_mean**2)))
    return f"| {kind} | {truth} | {spread:.2f} | {beyond:.0f} % | {error:.2g} | {from_mean.size} |"


def _from_mean(values: Array, errors: Array) -> Array:
    """Return departures from the mean of all, each weighed by its error, over what they should spread by."""
    weights = errors**-2.0
    mean = float(weights @ values) / float(weights.sum())
    return np.asarray((values - mean) / np.sqrt(errors**2 - 1.0 / float(weights.sum())))


if __name__ == "__main__":
    main()
