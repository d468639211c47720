"""Screening: which causes leave a signature like what the model left over.

Each trial instance of an effect is simulated once beside the present model; its signature, less what the linear
part could explain of it, is compared with the residual.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import whitening_of
from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import Tangent, centred, record_columns, squared_error, tangent
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.causes import cause_classes

Array = NDArray[np.float64]

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
    """

    cause: Cause
    index: int | None
    explained: float
    signature_power: float
    amplitude: float
    explained_held: float = 0.0

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
        plain: predicted displacement [um], shape (n_samples,).
        columns: directions of the linear part [um], offset removed, shape (n_samples, n_columns + 1).
        left: residual, offset removed [um], shape (n_samples,).
    """

    record: FitRecord
    index: int
    plain: Array
    columns: Array
    left: Array

    @classmethod
    def of(cls, chain: TrialModel, record: FitRecord, index: int) -> HeldView:
        """Return the view of a record."""
        columns = tangent(chain.alone(index), (record,)).columns[0]
        plain = predict(chain, record, index, is_coarse=True)
        return cls(
            record, index, plain, columns, centred(record.measured_um - predict(chain, record, index), record.is_used)
        )

    def explained(self, chain: TrialModel, cause: Cause, coefficients: Array, takes_either_sign: bool) -> float:
        """Return what the instance explains of the residual here [um^2], the linear part moved as in training."""
        try:
            shape = centred(signature(chain, self.record, self.index, cause, self.plain), self.record.is_used)
        except ParameterError:
            return 0.0
        shape = (shape - self.columns @ coefficients)[self.record.is_used]
        power, product = float(np.dot(shape, shape)), float(np.dot(shape, self.left[self.record.is_used]))
        if not power > 0.0 or not (takes_either_sign or product > 0.0):
            return 0.0
        return product**2 / power


def evidence_of(
    chain: TrialModel, records: tuple[FitRecord, ...], left: tuple[Array, ...], noise_um: float
) -> Evidence:
    """Return what the effects may look at."""
    return Evidence(
        tuple(
            RecordEvidence(
                r.time_s,
                r.steps_s,
                r.voltage_v,
                predict(chain, r, i, is_coarse=True),
                residual,
                r.covariates,
            )
            for i, (r, residual) in enumerate(zip(records, left, strict=True))
        ),
        noise_um,
    )


def screen(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent,
    left: tuple[Array, ...],
    noise_um: float,
    causes: tuple[str, ...],
    held: HeldView | None = None,
    executor: Executor | None = None,
) -> list[Screened]:
    """Return every trial instance with what it explains, best first.

    Args:
        chain: the present model.
        records: what it was fitted to.
        space: tangent of its linear part.
        left: residual per record [um].
        noise_um: noise floor [um].
        causes: names to try.
        held: the held-out record, where there is one.
        executor: screens causes side by side where given.
    """
    clear = space.remove(records, left)
    evidence = evidence_of(chain, records, left, noise_um)
    plain = tuple(predict(chain, r, i, is_coarse=True) for i, r in enumerate(records))

    def of_cause(name: str) -> list[Screened]:
        found: list[Screened] = []
        kind = cause_classes()[name]
        for cause in kind.screening(evidence):
            if isinstance(cause, Effect) and ColumnKinds.plays_of(cause).owners:
                found.append(_screen_family(chain, records, space, clear, cause))
            elif not cause.belongs_to_record():
                found += _screen_one(chain, records, space, clear, plain, cause, None, held)
        for i, record in enumerate(evidence.records):
            for cause in kind.screening(Evidence((record,), noise_um)):
                if cause.belongs_to_record():
                    found += _screen_one(chain, records, space, clear, plain, cause, i)
        return found

    by_cause = map(of_cause, causes) if executor is None else executor.map(of_cause, causes)
    return sorted((screened for found in by_cause for screened in found), key=lambda screened: -screened.explained)


def signature(chain: TrialModel, record: FitRecord, index: int, cause: Cause, plain: Array) -> Array:
    """Return by how much an instance changes the displacement [um], shape (n_samples,), one step per sample."""
    if isinstance(cause, Effect):
        # what comes after hysteresis and creep acts on their sum; the past moves its state, too
        is_after_past = cause.stage is Stage.MECHANICAL and chain.start_of(index) is None
        if cause.stage is Stage.SENSED or is_after_past:
            covariate = record.covariates.of(cause.covariate)
            return cause.run(cause.initial_state(), plain, record.steps_s, covariate) - plain
    with_cause = chain.without(cause.name).with_cause(cause, index if cause.belongs_to_record() else None)
    return predict(with_cause, record, index, is_coarse=True) - plain


def _screen_one(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent,
    clear: tuple[Array, ...],
    plain: tuple[Array, ...],
    cause: Cause,
    index: int | None,
    held: HeldView | None = None,
) -> list[Screened]:
    try:
        parts = tuple(
            centred(signature(chain, r, i, cause, p), r.is_used) if index in (None, i) else np.zeros(r.time_s.size)
            for i, (r, p) in enumerate(zip(records, plain, strict=True))
        )
    except ParameterError:
        return []
    coefficients = space.solve(records, parts)
    parts = tuple(p - c @ coefficients for p, c in zip(parts, space.columns, strict=True))
    power = squared_error(records, parts)
    if not np.isfinite(power) or power <= 0.0:
        return []
    product = sum(float(np.dot(s[r.is_used], c[r.is_used])) for r, s, c in zip(records, parts, clear, strict=True))
    main = cause.parameter(cause.main_parameter)
    takes_either_sign = main.name in cause.linear_parameters and main.lower < 0.0
    explained = product**2 / power if takes_either_sign or product > 0.0 else 0.0
    explained_held = 0.0 if held is None else held.explained(chain, cause, coefficients, takes_either_sign)
    return [Screened(cause, index, explained, power, product / power, explained_held)]


def _screen_family(
    chain: TrialModel, records: tuple[FitRecord, ...], space: Tangent, clear: tuple[Array, ...], effect: Effect
) -> Screened:
    only = ColumnKinds.plays_of(effect)
    n_plays = only.thresholds_v.size
    family = replace(chain, columns=only, weights=np.zeros(n_plays))
    gram = np.zeros((n_plays,) * 2)
    moment = np.zeros(n_plays)
    for i, (record, left, columns) in enumerate(zip(records, clear, space.columns, strict=True)):
        own = centred(record_columns(family, record, i, chain), record.is_used)[record.is_used]
        base = columns[record.is_used] @ space.whitening
        own = own - base @ (base.T @ own) if len(records) == 1 else own
        gram += own.T @ own
        moment += own.T @ left[record.is_used]
    # a knee the drive hardly reaches could do anything, with a weight beyond all measure
    power = np.diag(gram)
    moved = power > _LEAST_POWER * np.max(power)
    whitening = whitening_of(gram[np.ix_(moved, moved)])
    inside = whitening.T @ moment[moved]
    explained = float(inside @ inside)
    reached = effect.with_plays(only.thresholds_v[moved], only.knees_v[moved], np.zeros(np.count_nonzero(moved)))
    return Screened(reached, None, explained, float(np.trace(gram)), 1.0)
