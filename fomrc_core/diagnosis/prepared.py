"""Records made ready for a search: noise, split and base model, and faults that only a first fit shows, mended.

Samples that were lost or doubled go first: each changes what the base is fitted to, so they are looked for, taken out
and looked for again while a record gets better by it. A record that is not much better in the end stays as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, split_data
from fomrc_core.diagnosis.looked_over import LookedOver
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.noise import NoiseFloor, known_noise
from fomrc_core.records.quality import Lags, Slip, find_lags, find_slips, levels_of
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms

_N_TURNS = 12
_BETTER = 0.98  # of a record's error: a turn that gains less is the last
_MUCH_BETTER = 0.5  # of what a record's error was
_N_LAG_TURNS = 4
_THAN_A_LAG = (
    0.9  # of what lags of all kinds leave, the base fitted beside them: as sure as a fit to other noise would be
)


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a search begins with.

    Attributes:
        looked: records, and what was wrong with them.
        noise: floor known before any model.
        split: what is learnt from, held out and quoted on.
        base: the model without causes.
        slips: for which readings of each record were moved; empty where of none.
    """

    looked: LookedOver
    noise: NoiseFloor
    split: DataSplit
    base: TrialModel
    slips: tuple[tuple[Slip, ...], ...] = ()

    @property
    def moved(self) -> frozenset[int]:
        """Records of which readings were moved for samples that were lost or doubled, by their numbers."""
        return frozenset(i for i, own in enumerate(self.slips) if own)

    def slips_of_all(self) -> tuple[tuple[Slip, ...], ...]:
        """Return the slips of every record, in their order."""
        return self.slips or tuple(() for _ in self.looked.records)

    @classmethod
    def of(cls, looked: LookedOver) -> Prepared:
        """Return records with their base model as they are."""
        noise = known_noise(looked.train)
        split = split_data(looked.train, looked.test, looked.report, noise.floor_um)
        return cls(looked, noise, split, base_model(split))

    def residuals(self) -> list[Array]:
        """Return what the base leaves of each record, learnt from or held out [um], in their order."""
        return [best_residual(self.base, record, index) for index, record in sorted(self._records().items())]

    def looked_again(self, as_read: frozenset[int] = frozenset()) -> Prepared:
        """Return the same with what stands out of the base's residuals mended or left out.

        Args:
            as_read: records of which no reading is to be moved, by their numbers.
        """
        return self.with_slips(_slips_of(self, as_read))

    def with_slips(self, slips: Sequence[tuple[Slip, ...]]) -> Prepared:
        """Return the same with readings that slipped where they belong, and what stands out of the rest left out.

        Args:
            slips: of each record, in their order.
        """
        mended = self
        if any(slips):
            mended = replace(Prepared.of(self.looked.without_slips(slips)), slips=tuple(slips))
        again = mended.looked.again(mended.residuals())
        return mended if again is mended.looked else replace(Prepared.of(again), slips=mended.slips)

    def predicted_of(self, model: TrialModel) -> list[Array]:
        """Return what a model says of each record [um], in their order."""
        return [r.measured_um - best_residual(model, r, i) for i, r in sorted(self._records().items())]

    def errors_of(self, model: TrialModel, *, beside_levels: bool = False) -> list[float]:
        """Return what a model leaves of each record, rms [um], in their order.

        Args:
            model: the model.
            beside_levels: less what jumps at some moment and stays.
        """
        records = sorted(self._records().items())
        left_um = [(r.is_used, best_residual(model, r, i)) for i, r in records]
        return [rms((v - levels_of(v, used) if beside_levels else v)[used]) for used, v in left_um]

    def explained_moves(self, given: Prepared, model: TrialModel, other: TrialModel) -> frozenset[int]:
        """Return the records whose readings were moved for what a model explains without: a clock that drifts does.

        Readings are moved before any cause is known, and record by record; what was found in others may say more.

        Args:
            given: the records as they were.
            model: of the records as they were, with the causes found.
            other: of the records with their readings moved.
        """
        as_read_um, moved_um = given.errors_of(model), self.errors_of(other)
        return frozenset(i for i in self.moved if as_read_um[i] <= moved_um[i])

    def _records(self) -> dict[int, FitRecord]:
        """Return all records by their numbers, every sample used that may be."""
        everything = [HeldOut(record, i) for i, record in enumerate(self.split.train)]
        everything += [h for h in (*self.split.held, *self.split.report) if h.index >= len(self.split.train)]
        return {h.index: h.record.using(np.ones(h.record.time_s.size, dtype=np.bool_)) for h in everything}


def best_residual(model: TrialModel, record: FitRecord, index: int) -> Array:
    """Return what a model leaves of a record [um], begun as it was found or at rest, whichever leaves less."""
    options = [model]
    if index < len(model.record_effects) and not model.causes_in(index) and record.voltage_v[0] != 0.0:
        options.append(model.with_start(index, record.at_rest()))
    found = [centred(record.measured_um - predict(o, record, index), record.is_used) for o in options]
    return min(found, key=lambda r: rms(r[record.is_used]))


def _slips_of(given: Prepared, as_read: frozenset[int]) -> tuple[tuple[Slip, ...], ...]:
    """Return the slips of each record, in their order, without those that a lag or a delay does nearly as well."""
    left = given.residuals()
    before_um = _errors(given.looked.records, left)
    slips: list[tuple[Slip, ...]] = [() for _ in left]
    now = given
    for _ in range(_N_TURNS):
        found = _better_slips(given, now, slips)
        if found is None:
            break
        now, slips = found
    if not any(slips):
        return tuple(slips)
    after_um = _errors(now.looked.records, now.residuals())
    lagging_um = [min(pair) for pair in zip(_left_by_lags(given), _left_by_delays(given, slips), strict=True)]
    for i in range(len(slips)):
        if i in as_read or after_um[i] > min(_MUCH_BETTER * before_um[i], _THAN_A_LAG * lagging_um[i]):
            slips[i] = ()
    return tuple(slips)


def _left_by_lags(given: Prepared) -> list[float]:
    """Return what lags of all kinds leave of each record, rms [um], the base fitted to the rest as it is without slips.

    A base that was fitted to readings that lag has bent to them, and so have lags fitted to what it leaves.
    """
    now, best_um = given, _errors(given.looked.records, given.residuals())
    lags = [Lags.none(record.n_samples) for record in given.looked.records]
    for _ in range(_N_LAG_TURNS):
        pairs = zip(now.looked.records, now.residuals(), strict=True)
        more = [find_lags(r.measured_um, r.measured_um - left, r.valid_samples) for r, left in pairs]
        lags = [before.beside(found) for before, found in zip(lags, more, strict=True)]
        back_um = [
            of_record.taken_from(r.measured_um, r.valid_samples)
            for of_record, r in zip(lags, given.looked.records, strict=True)
        ]
        now = Prepared.of(given.looked.reading(back_um))
        best_um = [min(pair) for pair in zip(best_um, _errors(now.looked.records, now.residuals()), strict=True)]
    return best_um


def _left_by_delays(given: Prepared, slips: list[tuple[Slip, ...]]) -> list[float]:
    """Return what is left of each record, rms [um], moved as a whole by as much as it slipped: a delay has no place."""
    delays = [(Slip(0, sum(slip.n_lost for slip in own)),) if own else () for own in slips]
    moved = Prepared.of(given.looked.without_slips(delays))
    return _errors(moved.looked.records, moved.residuals())


def _better_slips(
    given: Prepared, now: Prepared, slips: list[tuple[Slip, ...]]
) -> tuple[Prepared, list[tuple[Slip, ...]]] | None:
    """Return records with other slips taken out, and these; None where no record gets better by it."""
    is_better = False
    for i, record in enumerate(given.looked.records):
        predicted_um = now.looked.records[i].measured_um - now.residuals()[i]
        found = find_slips(record.measured_um, predicted_um, record.valid_samples)
        if found in (slips[i], ()):
            continue
        others = [*slips[:i], found, *slips[i + 1 :]]
        trial = Prepared.of(given.looked.without_slips(others))
        error_um, trial_um = (_errors(p.looked.records, p.residuals())[i] for p in (now, trial))
        if trial_um < _BETTER * error_um:
            now, slips, is_better = trial, others, True
    return (now, slips) if is_better else None


def _errors(records: Sequence[Recording], residuals_um: Sequence[Array]) -> list[float]:
    pairs = [(r.valid_samples, v) for r, v in zip(records, residuals_um, strict=True)]
    return [rms(v[valid] - np.mean(v[valid])) for valid, v in pairs]
