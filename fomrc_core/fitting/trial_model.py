"""A model under fit: operator weights of either sign on fixed thresholds, creep order, effects, starts of records.

The same chain as ``PiezoModel``, before it is known whether its weights belong to Maxwell elements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.pulse import beat
from fomrc_core.effects import Effect, Stage, in_chain_order
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.work_of_run import operations_of_run
from fomrc_core.model.divided_drive import ElementDrive
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.simulation import (
    Before,
    Passage,
    gone_on_from,
    pass_chain,
    relaxed_state,
    settle_chain,
)
from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import N_MODES, SHORTEST_TIME_S, CreepModes, creep_modes
from fomrc_core.operators.hysteresis import OperatorSum

# Of the creep modes, at the worst order; the error is in proportion to the order, so at 0.02 it is some 1e-6.
FIT_ACCURACY = 1e-4


@dataclass(frozen=True, eq=False)
class TrialModel:
    """A model under fit.

    Attributes:
        columns: plays, threshold zero first, then the plays effects own.
        weights: their weights [um/V], shape (n_columns,), of either sign.
        creep_order: alpha [1].
        effects: effects of the actuator, the same in every record; one that owns columns is here without its plays.
        record_effects: effects that belong to one record, a tuple for each record.
        grid_v: thresholds the plays may be chosen from [V], zero first; those of the columns where not given.
        starts: what went before each record; none, and every record begins relaxed, where not given.
        shortest_time_s: shortest time its creep holds for [s].
    """

    columns: ColumnKinds
    weights: Array
    creep_order: float
    effects: tuple[Effect, ...] = ()
    record_effects: tuple[tuple[Effect, ...], ...] = ()
    grid_v: Array | None = None
    starts: tuple[Prehistory | None, ...] = ()
    shortest_time_s: float = SHORTEST_TIME_S

    @classmethod
    def of_play_form(
        cls, form: OperatorSum, order: float, effects: tuple[Effect, ...] = (), start: Prehistory | None = None
    ) -> TrialModel:
        """Return the model of one record with these elements [V, um/V], creep order [1], effects and start."""
        plays = ColumnKinds.plays(np.concatenate(([0.0], form.thresholds)))
        weights = np.concatenate(([form.slope], form.weights))
        return cls(plays, weights, order, effects, ((),), starts=(start,))

    # --- what it holds

    @property
    def n_owned(self) -> int:
        """Number of columns that are plays of an effect."""
        return int(np.count_nonzero(~self.columns.is_plain))

    @property
    def replaces_creep(self) -> bool:
        """Whether an effect stands in the place of the creep order, which is then held at zero."""
        return any(effect.replaces_creep for effect in self.effects)

    def operator(self) -> OperatorSum:
        """Return the plain plays as slope, thresholds and weights."""
        plain = self.columns.is_plain
        thresholds, weights = self.columns.thresholds_v[plain], self.weights[plain]
        return OperatorSum(
            float(np.sum(weights[thresholds == 0.0])), thresholds[thresholds > 0.0], weights[thresholds > 0.0]
        )

    def actuator_effects(self) -> tuple[Effect, ...]:
        """Return the effects of the actuator, each with the plays that are among the columns."""
        return tuple(self._with_columns(effect) for effect in self.effects)

    def _with_columns(self, effect: Effect) -> Effect:
        if effect.follows_elements:
            form = self.operator()
            effect = effect.beside_elements(form.thresholds, form.weights, self.creep_order)
        mask = self.columns.owned_by(effect.name)
        if not np.any(mask):
            return effect
        return effect.with_plays(self.columns.thresholds_v[mask], self.columns.knees_v[mask], self.weights[mask])

    def effects_in(self, index: int) -> tuple[Effect, ...]:
        """Return every effect that acts in a record, in the order of the chain."""
        bound = self.record_effects[index] if index < len(self.record_effects) else ()
        return in_chain_order((*self.actuator_effects(), *bound))

    def start_of(self, index: int) -> Prehistory | None:
        """Return what went before a record; None where it begins relaxed."""
        return self.starts[index] if index < len(self.starts) else None

    def causes_in(self, index: int | None) -> tuple[Cause, ...]:
        """Return the causes of the actuator (None), or those that belong to one record, its past among them."""
        if index is None:
            return self.effects
        bound: tuple[Cause, ...] = self.record_effects[index] if index < len(self.record_effects) else ()
        start = self.start_of(index)
        return bound if start is None else (*bound, start)

    def has(self, name: str, index: int | None = None) -> bool:
        """Return whether a cause acts, in any record or in one; a plain rest is how a record begins, and no cause."""
        return any(cause.name == name for _, cause in self.found(index))

    def found(self, index: int | None = None) -> list[tuple[int | None, Cause]]:
        """Return every cause with the record it belongs to (None: the actuator), or those of one record only.

        A plain rest is how a record begins, and no cause.
        """
        pools = [None, *range(max(len(self.record_effects), len(self.starts)))] if index is None else [index]
        return [
            (at, cause)
            for at in pools
            for cause in self.causes_in(at)
            if not (isinstance(cause, Prehistory) and cause.is_plain_rest)
        ]

    # --- the same with another part

    def with_cause(self, cause: Cause, index: int | None = None) -> TrialModel:
        """Return the model with a cause set, of the actuator or of one record, in place of one of its kind."""
        if isinstance(cause, Prehistory):
            assert index is not None
            return self.with_start(index, cause)
        assert isinstance(cause, Effect)
        if index is None:
            order = 0.0 if cause.replaces_creep else self.creep_order
            return replace(self, effects=(*(e for e in self.effects if e.name != cause.name), cause), creep_order=order)
        bound = tuple(e for e in self.record_effects[index] if e.name != cause.name)
        return self.with_record_effects(index, (*bound, cause))

    def with_record_effects(self, index: int, effects: tuple[Effect, ...]) -> TrialModel:
        """Return the model with the effects of one record replaced."""
        bound = list(self.record_effects)
        bound[index] = effects
        return replace(self, record_effects=tuple(bound))

    def with_start(self, index: int, start: Prehistory | None) -> TrialModel:
        """Return the model with what went before one record replaced."""
        n_records = max(len(self.starts), len(self.record_effects), index + 1)
        starts = [self.start_of(i) for i in range(n_records)]
        starts[index] = start
        return replace(self, starts=tuple(starts))

    def without(self, name: str, index: int | None = None) -> TrialModel:
        """Return the model without a cause, in the actuator and every record or in one record only."""
        bound = tuple(
            tuple(e for e in effects if e.name != name or index not in (None, i))
            for i, effects in enumerate(self.record_effects)
        )
        starts = tuple(
            None if start is not None and start.name == name and index in (None, i) else start
            for i, start in enumerate(self.starts)
        )
        shared = tuple(e for e in self.effects if e.name != name) if index is None else self.effects
        fewer = replace(self, effects=shared, record_effects=bound, starts=starts)
        kept = ~self.columns.owned_by(name)
        if index is not None or np.all(kept):
            return fewer
        return replace(fewer, columns=self.columns.chosen(kept), weights=self.weights[kept])

    def as_before(self, before: TrialModel, name: str) -> TrialModel:
        """Return the model without a cause, and with the creep order back that it took the place of.

        Args:
            before: a model that did not have it yet.
            name: of the cause.
        """
        fewer = self.without(name)
        if self.replaces_creep and not fewer.replaces_creep:
            return replace(fewer, creep_order=before.creep_order)
        return fewer

    def alone(self, index: int) -> TrialModel:
        """Return the model of one record only."""
        return replace(self, record_effects=(self.record_effects[index],), starts=(self.start_of(index),))

    def with_record_of(self, other: TrialModel, index: int, other_index: int = 0) -> TrialModel:
        """Return the model with all that belongs to one record taken from a record of another model."""
        changed = self.with_record_effects(index, other.record_effects[other_index])
        return changed.with_start(index, other.start_of(other_index))


def stage_of(cause: Cause) -> Stage:
    """Return the stage from which on a run is another where this cause is: the first for what is no effect."""
    return cause.stage if isinstance(cause, Effect) else Stage.SAMPLED_DRIVE


def fit_modes(trial: TrialModel) -> CreepModes:
    """Return the creep modes a fit uses."""
    return creep_modes(min(max(trial.creep_order, 0.0), 1.0), FIT_ACCURACY, trial.shortest_time_s)


def relaxed_trial(trial: TrialModel, effects: tuple[Effect, ...]) -> tuple[ModelState, int]:
    """Return the relaxed state of a model under fit, with these effects, and where the creep block begins in it."""
    return relaxed_state(trial.operator(), fit_modes(trial), effects)


def predict(trial: TrialModel, record: FitRecord, index: int, is_coarse: bool = False) -> Array:
    """Return the displacement [um] a model under fit gives for a record, offset not included, shape (n_samples,).

    Args:
        trial: the model.
        record: the record.
        index: which record it is, for what belongs to it.
        is_coarse: divide steps as for directions of a fit, where the record's bends are divided.
    """
    return predict_passing(trial, record, index, is_coarse)[0]


def predict_passing(
    trial: TrialModel,
    record: FitRecord,
    index: int,
    is_coarse: bool = False,
    before: Before | None = None,
) -> tuple[Array, Passage]:
    """Return the displacement [um] a model gives for a record, and what the stages of its chain handed on.

    Args:
        trial: the model.
        record: the record.
        index: which record it is, for what belongs to it.
        is_coarse: divide steps as for directions of a fit, where the record's bends are divided.
        before: the run of another model over the same record to go on from; None where there is none.
    """
    beat("simulations")
    effects = trial.effects_in(index)
    is_coarser = is_coarse and record.substeps is Substeps.BENDS and not needs_rate_within_steps(effects)
    substeps = Substeps.DIRECTIONS if is_coarser else _of_fit(record.substeps)
    before = gone_on_from(before, effects, record.steps_s, substeps)
    since = Stage.SAMPLED_DRIVE if before is None else before.since
    state, at_creep = relaxed_trial(trial, effects)
    start = trial.start_of(index)
    is_begun = start is not None and since <= Stage.MECHANICAL  # no effect on the sensor acts before a record
    if start is not None and is_begun:
        settle_chain(state, at_creep, effects, start.drive(), _of_fit(record.substeps))
    seen_um, passage = pass_chain(
        state,
        at_creep,
        effects,
        ElementDrive(record.steps_s, record.voltage_v, None),
        substeps=substeps,
        covariates=record.covariates,
        before=before,
        kept=record.divisions,
    )
    n_in_elements = trial.columns.thresholds_v.size + int(state.packed[at_creep + N_MODES])
    record.tally.add(
        operations_of_run(effects, since, record.time_s.size, passage.moved_um.size, n_in_elements, is_begun=is_begun)
    )
    return seen_um, passage


def needs_rate_within_steps(effects: tuple[Effect, ...]) -> bool:
    """Return whether directions of a fit must divide steps as finely as what is measured.

    Where an amplifier lags its voltage moves on for many samples after a jump, ever slower, and thresholds that widen
    with the rate are others in each part of a step: coarsely divided the displacement errs by several times the noise,
    and a fit by such directions comes to rest where nothing is least.
    """
    widens = any(effect.widens_with_rate for effect in effects)
    return widens and any(effect.stage is Stage.DRIVE and effect.needs_substeps for effect in effects)


def _of_fit(substeps: Substeps) -> Substeps:
    """Return how a fit divides steps that its model divides so."""
    return Substeps.FIT if substeps is Substeps.BENDS else substeps
