"""The records of a diagnosis: what is learnt from, what is held out, and how a model is scored on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred
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
SUBSTEPS = Substeps.BENDS  # of every record and model of a diagnosis: what is told apart is no more than some nm


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A held-out stretch: a record, its number among all records, and the samples that are scored."""

    record: FitRecord
    index: int


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
        held = (HeldOut(_scored(FitRecord.of(test, substeps=SUBSTEPS)), len(train)),)
    quoted = held if report is None else (HeldOut(_scored(FitRecord.of(report, substeps=SUBSTEPS)), len(train) + 1),)
    return DataSplit(train, held, quoted, noise_um)


def _scored(record: FitRecord) -> FitRecord:
    return record.using(is_settled(record.time_s, record.voltage_v))


def held_residuals(model: TrialModel, held: tuple[HeldOut, ...]) -> list[Array]:
    """Return measured minus predicted, offset removed, on the scored samples of each held-out stretch [um].

    Where the start is not sure, a rest at the first voltage and the relaxed state are both tried and the better
    one is taken: the start is no merit of a model.
    """
    found = []
    for part in held:
        options = [model]
        if not begins_at_zero(part.record.voltage_v) and part.index < len(model.record_effects):
            start = model.start_of(part.index)
            if start is None or start.is_plain_rest:
                options = [model.with_start(part.index, start) for start in (None, part.record.at_rest())]
        residuals = []
        for option in options:
            raw = part.record.measured_um - predict(option, part.record, part.index)
            residuals.append(centred(raw, part.record.is_used)[part.record.is_used])
        found.append(min(residuals, key=rms))
    return found


def is_idle_held(model: TrialModel, cause: str, split: DataSplit) -> bool:
    """Return whether a cause of the model does nothing in held-out data, which then speak neither for nor against it.

    A limit of the drive that held-out data never reach is such a cause.
    """
    pairs = zip(held_residuals(model, split.held), held_residuals(model.without(cause), split.held), strict=True)
    return rms(np.concatenate([beside - alone for beside, alone in pairs])) < _IDLE * split.noise_um
