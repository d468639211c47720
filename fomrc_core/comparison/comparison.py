"""Every rival beside the FOMRC: fitted on the same training data, scored on the same held-out data.

All are treated alike: the voltage before a record is taken as held at its first value, the offset of each
record is removed, and the first samples, which depend on what nobody recorded, are not scored.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines import all_rivals
from fomrc_core.comparison.baselines.amplified import Amplified, FittedAmplified
from fomrc_core.comparison.baselines.fomrc import FittedFomrc, Fomrc
from fomrc_core.comparison.baselines.rival import (
    FittedRival,
    Rival,
    TrainingRecord,
    training_error_um,
    training_record,
)
from fomrc_core.comparison.kept_rows import ROWS_NAME, KeptRows
from fomrc_core.comparison.result import Comparison, InverseQuality, Row
from fomrc_core.compute.pulse import beat
from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import normalised_percent
from fomrc_core.storage import make_directory

Array = NDArray[np.float64]

NOISE_UM = 1e-3
FILE_NAMES = (ROWS_NAME, "comparison.md", "comparison.json", "comparison.png", "comparison.svg")
_LARGEST_NOISE_GAIN = 100.0
_LARGEST_ROUND_TRIP_PERCENT = 1.0


def compare(
    train: Recording | Sequence[Recording],
    test: Recording,
    output_directory: str | Path | None = None,
    progress: Callable[[float, str], None] | None = None,
    *,
    rivals: Sequence[Rival] | None = None,
    with_amplifier: bool = True,
    extended_model: PiezoModel | None = None,
    settle_s: float = 10.0,
    skip_s: float = 0.5,
) -> Comparison:
    """Fit every rival on the training data, score it on the held-out data; write table, figure and JSON.

    Each row is kept in the output folder as soon as it is done (comparison_rows.json): begun anew on the same data, a
    comparison goes on where it stopped.

    Args:
        train: one or more training records.
        test: held-out record.
        output_directory: for comparison.md, comparison.json, comparison.png and .svg; None writes nothing.
        progress: called with the share done and what is being done.
        rivals: those to compare; all where not given. The FOMRC always takes part.
        with_amplifier: also compare each with the same amplifier_bandwidth effect.
        extended_model: a model found by a diagnosis of the training data, to be scored beside the others.
        settle_s: how long the voltage is taken to have been held before a record [s].
        skip_s: start of each record that is not scored [s].

    Raises:
        RecordingError: a record without displacement.
    """
    # Many arguments: the choices of one comparison, each with its usual value and given by name.
    records = [examine(r).recording for r in ([train] if isinstance(train, Recording) else train)]
    test = examine(test).recording
    learned = [training_record(r, settle_s=settle_s, skip_s=skip_s) for r in records]
    held = training_record(test, settle_s=settle_s, skip_s=skip_s)
    entrants: list[Rival] = [*(all_rivals() if rivals is None else rivals), Fomrc()]
    if with_amplifier:
        entrants += [Amplified(rival) for rival in entrants]
    rows = []
    kept = KeptRows(None if output_directory is None else Path(output_directory), [*learned, held])
    for number, rival in enumerate(entrants):
        entrant = f"{rival.name}, with an amplifier" if isinstance(rival, Amplified) else rival.name
        row = kept.get(entrant)
        if progress is not None:
            progress(number / len(entrants), entrant if row is None else f"{entrant}: kept")
        if row is None:
            row = _row(rival, learned, held)
            kept.keep(entrant, row)
        rows.append(row)
    if extended_model is not None:
        fitted = FittedFomrc(extended_model)
        rows.append(_scored("FOMRC, diagnosed", "this project", fitted, learned, held, math.nan))
    # Failures last.
    rows.sort(key=lambda row: row.test_rms_um if math.isfinite(row.test_rms_um) else math.inf)
    comparison = Comparison(tuple(rows), tuple(r.name for r in records), test.name, float(np.ptp(test.measured_um)))
    if output_directory is not None:
        write_comparison(comparison, Path(output_directory))
    if progress is not None:
        progress(1.0, "done")
    return comparison


def rivals_named(parts: Sequence[str]) -> tuple[Rival, ...]:
    """Return the rivals in whose names one of the parts stands, whatever its case.

    Raises:
        ParameterError: a part that is empty or stands in none.
    """
    known = all_rivals()
    for part in parts:
        if not part or not any(part.lower() in rival.name.lower() for rival in known):
            raise ParameterError(
                "no such model", where="--models", value=part, allowed="parts of: " + "; ".join(r.name for r in known)
            )
    return tuple(rival for rival in known if any(part.lower() in rival.name.lower() for part in parts))


def write_comparison(comparison: Comparison, directory: Path) -> None:
    """Write comparison.md, comparison.json, comparison.png and comparison.svg."""
    from fomrc_core.comparison.figure import comparison_figure

    make_directory(directory)
    (directory / "comparison.md").write_text(comparison.table() + "\n", encoding="utf-8")
    text = json.dumps(comparison.to_mapping(), indent=2, allow_nan=False)
    (directory / "comparison.json").write_text(text + "\n", encoding="utf-8")
    figure = comparison_figure(comparison)
    for kind in ("png", "svg"):
        figure.savefig(directory / f"comparison.{kind}", dpi=150)


def _row(rival: Rival, learned: Sequence[TrainingRecord], held: TrainingRecord) -> Row:
    start = time.perf_counter()
    try:
        fitted = rival.fit(learned)
        fit_s = time.perf_counter() - start
        return _scored(rival.name, rival.publication, fitted, learned, held, fit_s)
    except FomrcError as error:  # a rival may not fit this data; the others still do
        nan = math.nan
        return Row(rival.name, rival.publication, nan, 0, nan, nan, nan, nan, nan, None, str(error))


def _scored(
    name: str,
    publication: str,
    fitted: FittedRival,
    learned: Sequence[TrainingRecord],
    held: TrainingRecord,
    fit_s: float,
) -> Row:
    test_error = training_error_um(fitted, [held])
    start = time.perf_counter()
    fitted.simulate(held.steps_s, held.voltage_v)
    per_sample = (time.perf_counter() - start) / held.voltage_v.size
    beat("simulations")
    return Row(
        name,
        publication,
        fitted.cutoff_hz if isinstance(fitted, FittedAmplified) else math.nan,
        fitted.n_parameters,
        training_error_um(fitted, learned),
        test_error,
        normalised_percent(test_error, [held.displacement_um[held.n_before :]]),
        1e6 * per_sample,
        fit_s,
        inverse_quality(fitted, held) if fitted.has_inverse else None,
    )


def inverse_quality(fitted: FittedRival, held: TrainingRecord) -> InverseQuality:
    """Return how the inverse of a fitted rival behaves on the drive of a record."""
    scored = held.is_scored
    reached = fitted.simulate(held.steps_s, held.voltage_v)
    noise = np.random.default_rng(7).normal(0.0, NOISE_UM, reached.size)
    with np.errstate(all="ignore"):
        voltage = fitted.invert(held.steps_s, reached)
        beat("inversions")
        noisy = fitted.invert(held.steps_s, reached + noise)
    span_v, span_um = float(np.ptp(held.voltage_v[scored])), float(np.ptp(reached[scored]))
    round_trip = 100.0 * float(np.sqrt(np.mean((voltage - held.voltage_v)[scored] ** 2))) / span_v
    gain = float(np.sqrt(np.mean((noisy - voltage)[scored] ** 2))) / (NOISE_UM * span_v / span_um)
    is_stable = math.isfinite(round_trip) and round_trip <= _LARGEST_ROUND_TRIP_PERCENT and gain <= _LARGEST_NOISE_GAIN
    return InverseQuality(round_trip, gain, is_stable)
