"""A chain under fit: operator weights of either sign on fixed thresholds, creep order, effects, records.

The same chain as ``PiezoModel``, before it is known whether its weights belong to Maxwell elements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Effect
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.model.piezo_model import ModelState, run_chain, settle_chain
from fomrc_core.operators.creep import CreepModes, creep_block, creep_modes
from fomrc_core.operators.hysteresis import OperatorSum, hysteresis_block
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

# Of the creep modes, at the worst order; the error is in proportion to the order, so at 0.02 it is some 1e-6.
FIT_ACCURACY = 1e-4
_LONG_REST_S = 1000.0


@dataclass(frozen=True, eq=False)
class FitRecord:
    """A recording as the fit sees it, arrays of shape (n_samples,).

    Attributes:
        recording: where it comes from.
        time_s: time since the first sample [s].
        steps_s: steps [s].
        voltage_v: drive [V].
        measured_um: displacement [um].
        is_used: samples a fit may learn from.
        cross: second axis, voltage or displacement, where recorded.
    """

    recording: Recording
    time_s: Array
    steps_s: Array
    voltage_v: Array
    measured_um: Array
    is_used: NDArray[np.bool_]
    cross: Array | None

    @classmethod
    def of(cls, recording: Recording, is_used: NDArray[np.bool_] | None = None) -> FitRecord:
        """Return the prepared recording; every sample used unless told."""
        cross = recording.cross_displacement_um
        return cls(
            recording,
            recording.time_s - recording.time_s[0],
            recording.steps_s,
            recording.voltage_v,
            recording.measured_um,
            np.ones(recording.n_samples, dtype=np.bool_) if is_used is None else is_used,
            recording.cross_voltage_v if cross is None else cross,
        )

    def using(self, is_used: NDArray[np.bool_]) -> FitRecord:
        """Return the same record with another choice of samples."""
        return replace(self, is_used=is_used)

    def at_rest(self) -> InitialState:
        """Return the start from a long rest at the first voltage."""
        first = float(self.voltage_v[0])
        return InitialState(first, first, 1.0, _LONG_REST_S)


@dataclass(frozen=True, eq=False)
class TrialModel:
    """A fitted chain.

    Attributes:
        columns: plays, threshold zero first, then plays with knees.
        weights: their weights [um/V], shape (n_columns,), of either sign.
        creep_order: alpha [1].
        effects: effects of the actuator, the same in every record.
        record_effects: effects that belong to one record, a tuple for each record.
        grid_v: thresholds the plays may be chosen from [V], zero first; those of the columns where not given.
    """

    columns: ColumnKinds
    weights: Array
    creep_order: float
    effects: tuple[Effect, ...] = ()
    record_effects: tuple[tuple[Effect, ...], ...] = ()
    grid_v: Array | None = None

    @property
    def has_knees(self) -> bool:
        """Whether plays with knees are among the columns."""
        return bool(np.any(np.isfinite(self.columns.knees_v)))

    def asymmetry(self) -> AsymmetricHysteresis:
        """Return the plays with knees, and the warp of the drive where there is one, as an effect."""
        kneed = np.isfinite(self.columns.knees_v)
        bare = next((e for e in self.effects if isinstance(e, AsymmetricHysteresis)), AsymmetricHysteresis())
        return replace(
            bare,
            thresholds_v=tuple(self.columns.thresholds_v[kneed].tolist()),
            knees_v=tuple(self.columns.knees_v[kneed].tolist()),
            weights_um_per_v=tuple(self.weights[kneed].tolist()),
        )

    def actuator_effects(self) -> tuple[Effect, ...]:
        """Return the effects of the actuator, the plays with knees among them."""
        others = tuple(e for e in self.effects if not isinstance(e, AsymmetricHysteresis))
        return (*others, self.asymmetry()) if self.has_knees else self.effects

    def effects_in(self, index: int) -> tuple[Effect, ...]:
        """Return every effect that acts in a record, in the order of the chain."""
        own = self.record_effects[index] if index < len(self.record_effects) else ()
        return tuple(sorted((*self.actuator_effects(), *own), key=lambda effect: effect.place))

    def operator(self) -> OperatorSum:
        """Return the plain plays as slope, thresholds and weights."""
        plain = ~np.isfinite(self.columns.knees_v)
        thresholds, weights = self.columns.thresholds_v[plain], self.weights[plain]
        return OperatorSum(
            float(np.sum(weights[thresholds == 0.0])), thresholds[thresholds > 0.0], weights[thresholds > 0.0]
        )

    def with_effect(self, effect: Effect, index: int | None = None) -> TrialModel:
        """Return the chain with an effect set, of the actuator or of one record, in place of one of its kind."""
        if index is None:
            kept = tuple(e for e in self.effects if e.name != effect.name)
            return replace(self, effects=(*kept, effect))
        own = list(self.record_effects)
        own[index] = (*(e for e in own[index] if e.name != effect.name), effect)
        return replace(self, record_effects=tuple(own))

    def without(self, name: str, index: int | None = None) -> TrialModel:
        """Return the chain without an effect, of the actuator and of every record or of one."""
        own = tuple(
            tuple(e for e in effects if e.name != name or index not in (None, i))
            for i, effects in enumerate(self.record_effects)
        )
        shared = tuple(e for e in self.effects if e.name != name) if index is None else self.effects
        chain = replace(self, effects=shared, record_effects=own)
        if name == AsymmetricHysteresis.name and self.has_knees:
            plain = ~np.isfinite(self.columns.knees_v)
            columns = ColumnKinds(
                self.columns.thresholds_v[plain], self.columns.knees_v[plain], self.columns.kinds[plain]
            )
            chain = replace(chain, columns=columns, weights=self.weights[plain])
        return chain


def fit_modes(order: float) -> CreepModes:
    """Return the creep modes a fit uses."""
    return creep_modes(min(max(order, 0.0), 1.0), FIT_ACCURACY)


def start_state(operator: OperatorSum, order: float, effects: tuple[Effect, ...]) -> tuple[ModelState, int]:
    """Return the state a record begins in, and where its creep block begins."""
    hysteresis = hysteresis_block(operator)
    packed = np.concatenate((hysteresis, creep_block(fit_modes(order))))
    state = ModelState(packed, {effect.name: effect.initial_state() for effect in effects})
    for effect in effects:
        if isinstance(effect, InitialState):
            settle_chain(state, hysteresis.size, effects, *effect.prehistory())
    return state, hysteresis.size


def predict(
    chain: TrialModel, record: FitRecord, index: int, extra: tuple[Effect, ...] = (), is_coarse: bool = False
) -> Array:
    """Return the displacement [um] the chain gives for a record, offset not included, shape (n_samples,).

    Args:
        chain: the chain.
        record: the record.
        index: which record it is, for the effects that belong to it.
        extra: further effects, each in place of one of its kind.
        is_coarse: divide the largest steps only.
    """
    names = {effect.name for effect in extra}
    effects = tuple(e for e in chain.effects_in(index) if e.name not in names) + extra
    effects = tuple(sorted(effects, key=lambda effect: effect.place))
    state, at_creep = start_state(chain.operator(), chain.creep_order, effects)
    return run_chain(
        state,
        at_creep,
        effects,
        record.steps_s,
        record.voltage_v,
        temperature_c=record.recording.temperature_c,
        cross=record.cross,
        is_coarse=is_coarse,
    )
