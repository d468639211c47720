"""What to measure next: for causes that cannot be told apart, the drive under which they differ most."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import SUBSTEPS, DataSplit
from fomrc_core.diagnosis.step import Step
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import tangent
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import Excitation, multisine, steps, triangle
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms

Array = NDArray[np.float64]

_FEWEST_PER_UNIT, _MOST_PER_UNIT = 200.0, 20_000.0  # samples in what stands for a second
_LONG_DRIVE_S = (60.0, 300.0)  # what drifts shows in a minute; longer than five nobody waits
_N_LONG_CYCLES = 12  # motion throughout, at many amplitudes


@dataclass(frozen=True, eq=False)
class Proposal:
    """A drive that would tell causes apart.

    Attributes:
        excitation: the drive.
        command: how to make it.
        difference_um: by how much the two causes differ under it once the base is refitted, rms [um].
    """

    excitation: Excitation
    command: str
    difference_um: float


def candidate_drives(split: DataSplit) -> list[tuple[Excitation, str]]:
    """Return drives over the range of the records, each with the command that makes it."""
    low = min(float(np.min(r.voltage_v)) for r in split.train)
    high = max(float(np.max(r.voltage_v)) for r in split.train)
    middle, swing = 0.5 * (low + high), 0.5 * (high - low)
    rate = 1.0 / split.train[0].recording.sample_period_s
    unit_s = _time_unit(rate)
    period_s = round(2.0 * unit_s * rate) / rate
    levels = [middle + swing * s for s in (0.2, -0.2, 0.6, -0.6, 1.0, -1.0, 0.1, -0.1)]
    top = min(0.4 * rate, 300.0 / unit_s)
    # What drifts shows in time: longer than what has been measured, by rests at both ends and by motion throughout.
    shortest_s, longest_s = unit_s * _LONG_DRIVE_S[0], unit_s * _LONG_DRIVE_S[1]
    long_s = min(max(2.0 * max(float(r.time_s[-1] - r.time_s[0]) for r in split.train), shortest_s), longest_s)
    ends = [low, high] * 3
    slow = 2.0 * swing * (_N_LONG_CYCLES + 1) / long_s  # amplitudes fall from cycle to cycle
    makers: list[tuple[Callable[[], Excitation], str]] = [
        (
            lambda: steps(levels, dwell_s=1.5 * unit_s, lead_in_s=0.5 * unit_s, rate_hz=rate),
            f"excite steps --levels {','.join(f'{v:.3g}' for v in levels)} --dwell {1.5 * unit_s:.3g}",
        ),
        (
            lambda: multisine(
                0.3 * swing,
                lowest_hz=0.5 / unit_s,
                highest_hz=top,
                period_s=period_s,
                n_periods=4,
                offset_v=middle,
                rate_hz=rate,
            ),
            f"excite multisine --amplitude {0.3 * swing:.3g} --offset {middle:.3g} --highest {top:.3g} "
            f"--period {period_s:.3g}",
        ),
        (
            lambda: triangle(swing, slope_v_per_s=60.0 * swing / unit_s, n_cycles=5, offset_v=middle, rate_hz=rate),
            f"excite triangle --amplitude {swing:.3g} --offset {middle:.3g} --slope {60.0 * swing / unit_s:.3g}",
        ),
        (
            lambda: triangle(swing, slope_v_per_s=swing / unit_s, n_cycles=4, offset_v=middle, rate_hz=rate),
            f"excite triangle --amplitude {swing:.3g} --offset {middle:.3g} --slope {swing / unit_s:.3g} --cycles 4",
        ),
        (
            lambda: steps(ends, dwell_s=long_s / len(ends), lead_in_s=0.5 * unit_s, rate_hz=rate),
            f"excite steps --levels {','.join(f'{v:.3g}' for v in ends)} --dwell {long_s / len(ends):.3g}",
        ),
        (
            lambda: triangle(swing, slope_v_per_s=slow, n_cycles=_N_LONG_CYCLES, offset_v=middle, rate_hz=rate),
            f"excite triangle --amplitude {swing:.3g} --offset {middle:.3g} --slope {slow:.3g} "
            f"--cycles {_N_LONG_CYCLES}",
        ),
    ]
    return [(drive, command) for make, command in makers if (drive := _made(make)) is not None]


def _time_unit(rate_hz: float) -> float:
    """Return what stands for a second in the drives [s]: a second, unless samples are too few or too many for it."""
    return 1.0 if _FEWEST_PER_UNIT <= rate_hz <= _MOST_PER_UNIT else 1000.0 / rate_hz


def _made(make: Callable[[], Excitation]) -> Excitation | None:
    """Return the drive, None where it cannot be made at this rate and over this range: then it is not proposed."""
    try:
        return make()
    except ParameterError:
        return None


def best_drive(models: list[TrialModel], split: DataSplit) -> Proposal:
    """Return the drive under which the models differ most, what a refit of the base could absorb left out."""
    best: Proposal | None = None
    for drive, command in candidate_drives(split):
        record = FitRecord.of(
            Recording(drive.time_s, drive.voltage_v, np.zeros(drive.voltage_v.size), name=drive.name), substeps=SUBSTEPS
        )
        bare = [replace(m, record_effects=((),), grid_v=None, starts=()) for m in models]
        directions = tangent(bare[0], (record,))
        first = predict(bare[0], record, 0)
        least = min(
            rms(directions.remove((record,), (centre(predict(other, record, 0) - first),))[0]) for other in bare[1:]
        )
        if best is None or least > best.difference_um:
            best = Proposal(drive, command, least)
    assert best is not None
    return best


def centre(values: Array) -> Array:
    """Return the values less their mean."""
    return np.asarray(values - np.mean(values))


def propose(
    status: str,
    accepted: tuple[Step, ...],
    runner_up: Candidate | None,
    extended: PiezoModel,
    split: DataSplit,
    floor_um: float,
) -> str:
    """Return what to measure next, and why, in a sentence or two."""
    tied = next((step for step in reversed(accepted) if step.tied), None)
    if tied is not None:
        models = [tied.accepted.fitted.model, *tied.tied_models]
        best = best_drive(models, split)
        names = ", ".join((tied.accepted.cause, *tied.tied))
        return (
            f"to tell {names} apart run `fomrc {best.command}`: there they differ by "
            f"{1e3 * best.difference_um:.3g} nm rms at a noise of {1e3 * floor_um:.3g} nm"
        )
    if status == "nothing_found":
        return (
            "nothing to separate; what this data could not have shown is listed under smallest_detectable: "
            "drive faster and further to lower it"
        )
    if status == "explained":
        present = extended.causes
        experiment = present[-1].experiment if present else "the same drive again on another day"
        return f"to confirm: {experiment}"
    if runner_up is not None:
        kind = cause_classes()[runner_up.cause]
        return f"what is left looks most like {runner_up.cause}, which this data does not settle: {kind.experiment}"
    return "what is left resembles no cause known here: repeat the record, and record temperature and the second axis"
