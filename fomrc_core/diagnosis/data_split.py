"""The records of a diagnosis: what is learnt from, what is held out, and how a model is scored on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.untaught import BeyondLearned, untaught_directions, untaught_plays
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import Tangent, centred
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.drive import (
    MANY_LOOPS,
    begins_at_zero,
    held_out_blocks,
    is_settled,
    learned_blocks,
    n_loop_kinds,
)
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms

Array = NDArray[np.float64]

_IDLE = 0.5  # of the noise floor: a cause that moves held-out data less does nothing there
# Times the noise's power, slow noise that no repeat shows among it: where more is left other causes are still hidden.
MUCH_LEFT = 4.0
SUBSTEPS = Substeps.BENDS  # of every record and model of a diagnosis: what is told apart is no more than some nm


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A held-out stretch: a record, and the samples of it that are scored.

    Attributes:
        record: the record.
        index: its number among all records.
        untaught_v: thresholds of plays that its drive moves and no training record does [V], shape (n_plays,).
    """

    record: FitRecord
    index: int
    untaught_v: Array = field(default_factory=lambda: np.zeros(0))

    def judged(self, trial: TrialModel, left_um: Array) -> Array:
        """Return what a model leaves that it may be judged by [um], shape (n_samples,).

        Args:
            trial: the model.
            left_um: measured minus predicted, offset removed [um], shape (n_samples,).
        """
        directions = self.directions(trial)
        return left_um if directions is None else directions.remove((self.record,), (left_um,))[0]

    def directions(self, trial: TrialModel) -> Tangent | None:
        """Return what nobody taught a model; None where it was taught all."""
        if not self.untaught_v.size:
            return None
        return untaught_directions(trial, self.record, self.index, self.untaught_v)


@dataclass(frozen=True, eq=False)
class DataSplit:
    """What a diagnosis works with.

    Attributes:
        train: records, their used samples those a fit learns from.
        held: what candidates are accepted on.
        report: what before and after are quoted on; where it was given no cause was chosen by it.
        noise_um: noise floor [um].
    """

    train: tuple[FitRecord, ...]
    held: tuple[HeldOut, ...]
    report: tuple[HeldOut, ...]
    noise_um: float

    @property
    def n_records(self) -> int:
        """Number of all records, learnt from or not."""
        return 1 + max([len(self.train) - 1] + [h.index for h in (*self.held, *self.report)])

    @property
    def beyond_learned(self) -> tuple[BeyondLearned, ...]:
        """Held-out records whose drive goes beyond that of the training records."""
        apart = {part.index: part for part in (*self.held, *self.report) if part.untaught_v.size}
        return tuple(BeyondLearned.of(self.train, part.record) for part in apart.values())

    @property
    def is_apart(self) -> bool:
        """Whether what is held out is another record, not blocks of those that are learned from."""
        return any(part.index >= len(self.train) for part in self.held)

    @property
    def is_telling(self) -> bool:
        """Whether causes that fit alike can be told apart: by another record, or by loops of many kinds.

        Blocks of a loop that only repeats, held out, say again what the others have said.
        """
        return self.is_apart or n_loop_kinds([record.voltage_v for record in self.train]) >= MANY_LOOPS

    @property
    def noise_um2(self) -> float:
        """Sum of squares that the known noise leaves of the training records [um^2]."""
        return self.noise_um**2 * self.n_used

    @property
    def n_used(self) -> int:
        """Number of samples a fit learns from."""
        return int(sum(np.count_nonzero(r.is_used) for r in self.train))


def split_data(
    recordings: tuple[Recording, ...], test: Recording | None, report: Recording | None, noise_um: float
) -> DataSplit:
    """Return the split; without a test record blocks of the training records are held out, with gaps."""
    train = tuple(FitRecord.of(r, substeps=SUBSTEPS) for r in recordings)
    held: tuple[HeldOut, ...]
    if test is None:
        held = tuple(HeldOut(r.using(held_out_blocks(r.time_s.size)), i) for i, r in enumerate(train))
        train = tuple(r.using(learned_blocks(r.time_s.size)) for r in train)
    else:
        held = (_apart(test, len(train), train),)
    quoted = held if report is None else (_apart(report, len(train) + 1, train),)
    return DataSplit(train, held, quoted, noise_um)


def _apart(recording: Recording, index: int, train: tuple[FitRecord, ...]) -> HeldOut:
    record = FitRecord.of(recording, substeps=SUBSTEPS)
    record = record.using(is_settled(record.time_s, record.voltage_v))
    return HeldOut(record, index, untaught_plays(train, record))


def begun_either_way(model: TrialModel, part: HeldOut) -> list[TrialModel]:
    """Return the model begun relaxed and at rest in a held-out stretch, or as it is where that is known."""
    start = model.start_of(part.index)
    is_known = begins_at_zero(part.record.voltage_v) or part.index >= len(model.record_effects)
    if is_known or not (start is None or start.is_plain_rest):
        return [model]
    return [model.with_start(part.index, each) for each in (None, part.record.at_rest())]


def held_squared_error(model: TrialModel, held: tuple[HeldOut, ...]) -> float:
    """Return the sum of squares of what a model may be judged by on held-out stretches [um^2]."""
    return sum(float(v @ v) for v in held_residuals(model, held))


def held_residuals(model: TrialModel, held: tuple[HeldOut, ...]) -> list[Array]:
    """Return what a model may be judged by on the scored samples of each held-out stretch [um].

    That is measured minus predicted, the offset removed, and what nothing taught it.

    Where the start is not sure, a rest at the first voltage and the relaxed state are both tried and the better
    one is taken: the start is no merit of a model.
    """
    found = []
    for part in held:
        residuals = []
        for option in begun_either_way(model, part):
            raw = part.record.measured_um - predict(option, part.record, part.index)
            left_um = part.judged(option, centred(raw, part.record.is_used))
            residuals.append(left_um[part.record.is_used])
        found.append(min(residuals, key=rms))
    return found


def quoted_residuals(model: TrialModel, parts: tuple[HeldOut, ...]) -> list[Array]:
    """Return measured minus simulated, offset removed, on the scored samples of each stretch [um].

    What a user of the model gets there, untaught or not.
    """
    return held_residuals(model, tuple(replace(part, untaught_v=np.zeros(0)) for part in parts))


def is_idle_held(model: TrialModel, cause: str, split: DataSplit) -> bool:
    """Return whether a cause of the model does nothing in held-out data, which then speak neither for nor against it.

    A limit of the drive that held-out data never reach is such a cause.
    """
    pairs = zip(held_residuals(model, split.held), held_residuals(model.without(cause), split.held), strict=True)
    return rms(np.concatenate([beside - alone for beside, alone in pairs])) < _IDLE * split.noise_um
