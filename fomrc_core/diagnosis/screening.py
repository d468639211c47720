"""Screening: which causes leave a signature like what the model left over.

Each trial instance of an effect is simulated once beside the present model; its signature, less what the linear
part could explain of it, is compared with the residual.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, product, whitening_of
from fomrc_core.compute.pulse import beat
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.quick_view import QuickView
from fomrc_core.effects import Effect, Stage, is_foreign
from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.evidence import evidence_of, legible
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import effect_directions
from fomrc_core.fitting.linear_part import Tangent, centred, record_columns, squared_error, tangent
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.causes import cause_classes

_log = logging.getLogger(__name__)

_MOST_SKETCHED = 20_000  # samples: of some hundred signatures they are ten megabytes or so
_LEAST_POWER = 1e-6  # of that of the play that moves most


@dataclass(frozen=True, eq=False)
class Screened:
    """A trial instance and how much of the residual its signature explains.

    Attributes:
        cause: the instance; for an effect that owns columns the whole family of its plays.
        index: the record it belongs to; None for an effect of the actuator.
        explained: part of the sum of squares its signature explains [um^2].
        signature_power: sum of squares of the signature, linear part removed [um^2].
        amplitude: by which factor the instance's size explains it.
        explained_held: the same as ``explained`` on the held-out record, the linear part moved as the training
            records ask; 0 without one. What the base absorbed in training shows there.
        beside_slow: what it explains of the part that noise that wanders as the residual does would not foresee, in
            units of that part's variance, each sample counted as often as it is independent [1]. A line far from any
            drive is not to be mistaken, however little it is of what drifts beside it.
        sketch: some samples of the signature, linear part removed [um], to compare trials; None of a family of plays.
    """

    cause: Cause
    index: int | None
    explained: float
    signature_power: float
    amplitude: float
    explained_held: float = 0.0
    beside_slow: float = 0.0
    sketch: NDArray[np.float32] | None = None

    @property
    def name(self) -> str:
        """Name of the cause."""
        return self.cause.name


@dataclass(frozen=True, eq=False)
class HeldView:
    """The held-out record under the present model.

    Attributes:
        record: the record.
        index: its number among all records.
        predicted_um: predicted displacement, jumps alone divided [um], shape (n_samples,).
        columns: directions in which the model can move [um], offset removed, those of the linear part and of each
            parameter of its effects, shape (n_samples, n_directions); zero for what belongs to other records.
        residual_um: measured minus predicted, offset and what nothing taught the model removed [um], (n_samples,).
        untaught: directions of what nothing taught the model; None where there are none.
    """

    record: FitRecord
    index: int
    predicted_um: Array
    columns: Array
    residual_um: Array
    untaught: Tangent | None

    @classmethod
    def of(cls, model: TrialModel, part: HeldOut) -> HeldView:
        """Return the view of a held-out record."""
        record, index = part.record, part.index
        alone = model.alone(index)
        columns = tangent(alone, (record,)).columns[0]
        free = free_parameters(model)
        shared = [k for k, parameter in enumerate(free) if parameter.index is None]
        moved = np.zeros((record.time_s.size, len(free)))
        if shared:
            moved[:, shared] = effect_directions(alone, tuple(free[k] for k in shared), (record,))[0]
        columns = np.column_stack((columns, moved))
        residual_um = centred(record.measured_um - predict(model, record, index), record.is_used)
        untaught = part.directions(model)
        if untaught is not None:
            (residual_um,) = untaught.remove((record,), (residual_um,))
        return cls(record, index, predict(model, record, index, is_coarse=True), columns, residual_um, untaught)

    def evidence(self) -> RecordEvidence:
        """Return what a cause may look at of it."""
        record, residual_um = self.record, legible(self.residual_um, self.record)
        return RecordEvidence(
            record.time_s, record.steps_s, record.voltage_v, self.predicted_um, residual_um, record.covariates
        )

    def explained(self, model: TrialModel, cause: Cause, coefficients: Array, takes_either_sign: bool) -> float:
        """Return what the instance explains of the residual here [um^2], the linear part moved as in training."""
        try:
            shape = centred(signature(model, self.record, self.index, cause, self.predicted_um), self.record.is_used)
        except ParameterError:
            return 0.0
        shape = shape - self.columns @ coefficients
        if self.untaught is not None:
            (shape,) = self.untaught.remove((self.record,), (shape,))
        shape = shape[self.record.is_used]
        power, moment = float(np.dot(shape, shape)), float(np.dot(shape, self.residual_um[self.record.is_used]))
        if not power > 0.0 or not (takes_either_sign or moment > 0.0):
            return 0.0
        return moment**2 / power


def held_view(model: TrialModel, split: DataSplit) -> HeldView | None:
    """Return the held-out record under a model; None where blocks of the training records are held out."""
    apart = [part for part in split.held if part.index >= len(split.train)]
    return HeldView.of(model, apart[0]) if apart else None


def screen(
    present: PresentModel,
    causes: tuple[str, ...],
    held: HeldView | None = None,
    executor: Executor | None = None,
) -> tuple[Screened, ...]:
    """Return every trial instance with what it explains, best first.

    Args:
        present: the present model.
        causes: names to try.
        held: the held-out record, where there is one.
        executor: screens causes side by side where given.
    """
    evidence = evidence_of(present.model, present.records, present.residuals_um, present.noise_um)
    if held is not None:
        evidence = replace(evidence, beside=(held.evidence(),))
    _ = present.clear_um, present.predicted_um  # made here once, not by every thread
    quick = QuickView.of(present)

    def of_cause(name: str) -> list[Screened]:
        try:
            found = of_kind(cause_classes()[name])
            beat("simulations", 0)
            return found
        except Exception as error:
            if not is_foreign(name):
                raise
            # a stranger's code may raise anything: the diagnosis goes on without it, and says so
            words = " ".join(f"{type(error).__name__}: {error}".split())
            _log.warning("cause %s is left out: its own code raised %s", name, words)
            return []

    def of_kind(kind: type[Cause]) -> list[Screened]:
        found: list[Screened] = []
        for cause in kind.screening(evidence):
            if isinstance(cause, Effect) and ColumnKinds.plays_of(cause).owners:
                found.append(_screen_family(present, cause))
            elif not cause.belongs_to_record():
                found += _screen_one(present, quick, cause, None, held)
        for i, record in enumerate(evidence.records):
            others = (*evidence.records[:i], *evidence.records[i + 1 :], *evidence.beside)
            for cause in kind.screening(Evidence((record,), present.noise_um, others)):
                if cause.belongs_to_record():
                    found += _screen_one(present, quick, cause, i)
        return found

    by_cause = map(of_cause, causes) if executor is None else executor.map(of_cause, causes)
    return tuple(sorted((trial for found in by_cause for trial in found), key=lambda trial: -trial.explained))


def signature(model: TrialModel, record: FitRecord, index: int, cause: Cause, predicted_um: Array) -> Array:
    """Return by how much an instance changes the displacement [um], shape (n_samples,), jumps alone divided."""
    if isinstance(cause, Effect):
        # what comes after hysteresis and creep acts on their sum; the past moves its state, too
        is_after_past = cause.stage is Stage.MECHANICAL and model.start_of(index) is None and not cause.follows_elements
        if cause.stage is Stage.SENSED or is_after_past:
            covariate = record.covariates.of(cause.covariate)
            return cause.run(cause.initial_state(), predicted_um, record.steps_s, covariate) - predicted_um
    with_cause = model.without(cause.name).with_cause(cause, index if cause.belongs_to_record() else None)
    return predict(with_cause, record, index, is_coarse=True) - predicted_um


def _screen_one(
    present: PresentModel, quick: QuickView, cause: Cause, index: int | None, held: HeldView | None = None
) -> list[Screened]:
    records, directions = present.records, present.nuisance
    try:
        signatures = tuple(
            centred(signature(present.model, record, i, cause, predicted_um), record.is_used)
            if index in (None, i)
            else np.zeros(record.time_s.size)
            for i, (record, predicted_um) in enumerate(zip(records, present.predicted_um, strict=True))
        )
    except ParameterError:
        return []
    coefficients = directions.solve(records, signatures)
    clear = tuple(s - c @ coefficients for s, c in zip(signatures, directions.columns, strict=True))
    power = squared_error(records, clear)
    if not np.isfinite(power) or power <= 0.0:
        return []
    moment = sum(
        float(np.dot(s[r.is_used], v[r.is_used])) for r, s, v in zip(records, clear, present.clear_um, strict=True)
    )
    takes_either_sign = cause.takes_either_sign()
    explained = moment**2 / power if takes_either_sign or moment > 0.0 else 0.0
    explained_held = 0.0 if held is None else held.explained(present.model, cause, coefficients, takes_either_sign)
    beside_slow = quick.explained(present, signatures) if explained > 0.0 else 0.0
    sketch = sketch_of(s[r.is_used] for r, s in zip(records, clear, strict=True))
    return [Screened(cause, index, explained, power, moment / power, explained_held, beside_slow, sketch)]


def sketch_of(signals: Iterable[Array]) -> NDArray[np.float32]:
    """Return samples of signals one behind the other, evenly over all of them, as many as comparing them asks for."""
    joined = np.concatenate(list(signals))
    return np.asarray(joined[:: -(-joined.size // _MOST_SKETCHED)], dtype=np.float32)


def _screen_family(present: PresentModel, effect: Effect) -> Screened:
    """Return what the best weights of all plays of an effect explain together."""
    only = ColumnKinds.plays_of(effect)
    family = replace(present.model, columns=only, weights=np.zeros(only.thresholds_v.size))

    def rows(index: int, record: FitRecord) -> tuple[Array, Array, Mask]:
        plays = centred(record_columns(family, record, index, present.model), record.is_used)
        if len(present.records) == 1:
            base = present.nuisance.columns[index] @ present.nuisance.whitening
            plays = plays - base @ product(base, plays, record.is_used)
        return plays, present.clear_um[index], record.is_used

    equations = normal_equations(rows(i, record) for i, record in enumerate(present.records))
    # a knee the drive hardly reaches could do anything, with a weight beyond all measure
    power = np.diag(equations.gram)
    moved = power > _LEAST_POWER * np.max(power)
    inside = whitening_of(equations.gram[np.ix_(moved, moved)]).T @ equations.moment[moved]
    reached = effect.with_plays(only.thresholds_v[moved], only.knees_v[moved], np.zeros(np.count_nonzero(moved)))
    return Screened(reached, None, float(inside @ inside), float(np.sum(power)), 1.0)
