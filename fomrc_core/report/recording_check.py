"""What recordings are good for before anything is built on them: which parameters and causes they settle, what to add.

How sure the parameters would be is the bootstrap of ``identification.uncertainty``; which causes would show is the
screening of a diagnosis, without its search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.diagnosis.detectable import detectable
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.memory_plan import IDENTIFYING
from fomrc_core.identification.convex import identify
from fomrc_core.identification.fit import Fit
from fomrc_core.identification.repeated_fits import creep_order_error
from fomrc_core.identification.uncertainty import Uncertainty, estimate_uncertainty
from fomrc_core.records.drive import MANY_LOOPS, begins_at_zero, n_loop_kinds
from fomrc_core.records.noise import NoiseFloor, known_noise
from fomrc_core.records.recording import Recording
from fomrc_core.records.usability import check_usable
from fomrc_core.report.drive_to_add import Addition, DriveLimits, additions

Progress = Callable[[float, str], None]

_RESTS = 1e-3  # of the largest rate; less is rest
_ORDER_SURE = 0.1  # relative half width of the creep order's 95 % interval that is good enough
_N_REPLICATES = 200
_OF_95_PERCENT = 1.96  # standard errors


@dataclass(frozen=True)
class DriveSummary:
    """What a drive is like.

    Attributes:
        duration_s: of all records [s].
        low_v: lowest voltage [V].
        high_v: highest voltage [V].
        rate_hz: samples a second of the first record [Hz].
        n_loop_kinds: kinds of loops, told apart by width and mean.
        slow_v_per_s: rate below which a twentieth of its motion is [V/s].
        fast_v_per_s: rate above which a twentieth of its motion is [V/s].
        longest_rest_s: longest stretch at one voltage [s].
        begins_at_zero: whether every record begins at zero volts.
        repeats: whether some of the drive is repeated, so that noise shows apart from what the model misses.
    """

    duration_s: float
    low_v: float
    high_v: float
    rate_hz: float
    n_loop_kinds: int
    slow_v_per_s: float
    fast_v_per_s: float
    longest_rest_s: float
    begins_at_zero: bool
    repeats: bool

    def __str__(self) -> str:
        start = "from zero volts" if self.begins_at_zero else "not from zero volts"
        again = "with repeats" if self.repeats else "without repeats"
        return (
            f"drive: {self.duration_s:.4g} s, {self.low_v:.4g} to {self.high_v:.4g} V {start}, "
            f"{self.n_loop_kinds} kinds of loops, {self.slow_v_per_s:.3g} to {self.fast_v_per_s:.3g} V/s, "
            f"longest rest {self.longest_rest_s:.3g} s, {again}"
        )


@dataclass(frozen=True, eq=False)
class RecordingCheck:
    """What recordings are good for.

    Attributes:
        drive: what they were driven with.
        noise: noise floor.
        fit: an identification from them.
        uncertainty: how sure its parameters are.
        detectable: for each cause its main parameter's size from which it would have shown; causes that no drive in the
            records brings out are missing.
        additions: drives to record next, each with the reason.
        order_standard_error: by how much the noise moves the creep order [1].
    """

    drive: DriveSummary
    noise: NoiseFloor
    fit: Fit
    uncertainty: Uncertainty
    detectable: Mapping[str, Mapping[str, float]]
    additions: tuple[Addition, ...]
    order_standard_error: float

    @property
    def is_good(self) -> bool:
        """Whether creep order and every element are determined."""
        return self.order_error <= _ORDER_SURE and self.uncertainty.n_determined == len(self.uncertainty.elements)

    @property
    def order_error(self) -> float:
        """Relative half width of the creep order's 95 % interval [1]."""
        return _OF_95_PERCENT * self.order_standard_error / max(self.uncertainty.creep_order, 1e-12)

    def __str__(self) -> str:
        sure, n = self.uncertainty, len(self.uncertainty.elements)
        lines = [
            str(self.drive),
            f"noise floor {1e3 * self.noise.floor_um:.3g} nm rms; a model leaves {1e3 * self.fit.rms_um:.3g} nm",
            f"identify: {'good enough' if self.is_good else 'not yet enough'}: creep order {sure.creep_order:.4g} "
            f"+- {100.0 * self.order_error:.2g} % (95 %), {sure.n_determined} of {n} elements determined",
        ]
        lines += [f"  {text}" for text in sure.advice]
        shown = [f"{cause} {_size(size)}" for cause, size in sorted(self.detectable.items()) if size]
        lines.append(f"diagnose: would show {len(shown)} causes, from these sizes on")
        lines += [f"  {text}" for text in shown]
        if self.additions:
            lines.append("record next")
            lines += [f"  {addition}" for addition in self.additions]
        return "\n".join(lines)


def _size(size: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in size.items())


def check_recordings(
    recordings: Sequence[Recording],
    *,
    limits: DriveLimits | None = None,
    n_elements: int = 10,
    progress: Progress | None = None,
) -> RecordingCheck:
    """Return what recordings are good for.

    Args:
        recordings: of one stage.
        limits: what drives to add must keep to; those of the recordings' own range where not given.
        n_elements: elements of the model that is to be identified.
        progress: called with the share done and what is being done.

    Raises:
        RecordingError: a record nothing can be learnt from.
        ParameterError: records too long; give a part of them.
    """
    tell = progress or (lambda _share, _text: None)
    given = tuple(recordings)
    n_samples = sum(record.n_samples for record in given)
    if n_samples > IDENTIFYING.n_whole_max:
        raise ParameterError(
            "too long to be checked", where="recordings", value=n_samples, allowed=f"{IDENTIFYING.n_whole_max} samples"
        )
    check_usable(given)
    tell(0.05, "noise and drive")
    noise = known_noise(given)
    drive = _summary(given, repeats=bool(np.isfinite(noise.repeats_um)))
    tell(0.1, "identification")
    fit = identify(given, n_elements=n_elements)
    sure = estimate_uncertainty(
        fit, given, n_replicates=_N_REPLICATES, progress=lambda share, text: tell(0.2 + 0.2 * share, text)
    )
    order_error = creep_order_error(
        fit, given, noise.floor_um, progress=lambda share, text: tell(0.4 + 0.3 * share, text)
    )
    tell(0.7, "which causes would show")
    sizes = detectable(given, noise.floor_um)
    tell(1.0, "done")
    found = RecordingCheck(drive, noise, fit, sure, sizes, (), order_error)
    wanted = limits or DriveLimits(max(abs(drive.low_v), abs(drive.high_v)))
    added = additions(
        low_v=drive.low_v,
        high_v=drive.high_v,
        rate_hz=drive.rate_hz,
        duration_s=drive.duration_s,
        slow_v_per_s=drive.slow_v_per_s,
        needs_loops=drive.n_loop_kinds < MANY_LOOPS or sure.n_determined < len(sure.elements),
        needs_rests=found.order_error > _ORDER_SURE,
        needs_rates=drive.fast_v_per_s < 10.0 * drive.slow_v_per_s,
        needs_start=not drive.begins_at_zero,
        needs_repeats=not drive.repeats,
        limits=wanted,
    )
    return replace(found, additions=added)


def _summary(recordings: Sequence[Recording], *, repeats: bool) -> DriveSummary:
    rates = np.concatenate([np.abs(np.diff(r.voltage_v)) / r.steps_s[1:] for r in recordings])
    least = _RESTS * float(np.max(rates))
    moving = rates[rates > least]
    return DriveSummary(
        float(sum(r.duration_s for r in recordings)),
        min(float(np.min(r.voltage_v)) for r in recordings),
        max(float(np.max(r.voltage_v)) for r in recordings),
        1.0 / recordings[0].sample_period_s,
        n_loop_kinds([r.voltage_v for r in recordings]),
        float(np.quantile(moving, 0.05)),
        float(np.quantile(moving, 0.95)),
        max(_longest_rest_s(r, least) for r in recordings),
        all(begins_at_zero(r.voltage_v) for r in recordings),
        repeats,
    )


def _longest_rest_s(recording: Recording, least_v_per_s: float) -> float:
    is_moving = np.abs(np.diff(recording.voltage_v)) / recording.steps_s[1:] > least_v_per_s
    edges = np.flatnonzero(np.concatenate(([True], is_moving, [True])))
    at = recording.time_s[np.minimum(edges, recording.time_s.size - 1)]
    return float(np.max(np.diff(at), initial=0.0))
