"""Screening: which causes leave a signature like what the model left over.

Each trial instance of an effect is simulated once beside the present model; its signature, less what the linear
part could explain of it, is compared with the residual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.base_fit import Tangent, centred, squared_error, whitening_of
from fomrc_core.chain import Chain, PreparedRecord, predict
from fomrc_core.columns import ColumnKinds
from fomrc_core.effects import Effect, Stage, effect_classes
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.evidence import Evidence, RecordEvidence
from fomrc_core.effects.missing_hysteresis import MissingHysteresis
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Screened:
    """A trial instance and how much of the residual its signature explains.

    Attributes:
        effect: the instance; for asymmetric hysteresis the family of one-sided plays.
        index: the record it belongs to; None for an effect of the actuator.
        explained: part of the sum of squares its signature explains [um^2].
        signature_power: sum of squares of the signature, linear part removed [um^2].
        amplitude: by which factor the instance's size explains it.
    """

    effect: Effect
    index: int | None
    explained: float
    signature_power: float
    amplitude: float

    @property
    def cause(self) -> str:
        """Name of the cause."""
        return self.effect.name


def evidence_of(chain: Chain, records: tuple[PreparedRecord, ...], left: tuple[Array, ...], noise_um: float) -> Evidence:
    """Return what the effects may look at."""
    return Evidence(
        tuple(
            RecordEvidence(r.time_s, r.steps_s, r.voltage_v, predict(chain, r, i, is_coarse=True), residual,
                           r.recording.temperature_c is not None, r.cross is not None)  # fmt: skip
            for i, (r, residual) in enumerate(zip(records, left, strict=True))
        ),
        noise_um,
    )


def screen(chain: Chain, records: tuple[PreparedRecord, ...], space: Tangent, left: tuple[Array, ...], noise_um: float,
           causes: tuple[str, ...], progress: Callable[[float], None] = lambda _: None) -> list[Screened]:  # fmt: skip
    """Return every trial instance with what it explains, best first.

    Args:
        chain: the present model.
        records: what it was fitted to.
        space: tangent of its linear part.
        left: residual per record [um].
        noise_um: noise floor [um].
        causes: names to try.
        progress: called with the share done.
    """
    clear = space.remove(records, left)
    evidence = evidence_of(chain, records, left, noise_um)
    plain = tuple(predict(chain, r, i, is_coarse=True) for i, r in enumerate(records))
    found: list[Screened] = []
    for number, name in enumerate(causes):
        kind = effect_classes()[name]
        progress(number / len(causes))
        if kind is MissingHysteresis:
            continue
        if kind is AsymmetricHysteresis:
            found += [_screen_family(chain, records, space, clear, effect) for effect in kind.screening(evidence)]
        elif is_bound(kind, records):
            for i, own in enumerate(evidence.records):
                for effect in kind.screening(Evidence((own,), noise_um)):
                    found += _screen_one(chain, records, space, clear, plain, effect, i)
        else:
            for effect in kind.screening(evidence):
                found += _screen_one(chain, records, space, clear, plain, effect, None)
    return sorted(found, key=lambda screened: -screened.explained)


def is_bound(kind: type[Effect], records: tuple[PreparedRecord, ...]) -> bool:
    """Return whether the effect's parameters belong to one record; a drift does where no temperature is recorded."""
    if kind.name == "thermal_drift":
        return not all(r.recording.temperature_c is not None for r in records)
    return kind.is_record_bound


def signature(chain: Chain, record: PreparedRecord, index: int, effect: Effect, plain: Array) -> Array:
    """Return by how much an instance changes the displacement [um], shape (n_samples,), one step per sample."""
    if effect.stage is Stage.SENSED:
        covariate = record.cross if effect.name == "cross_axis" else record.recording.temperature_c
        return effect.run(effect.initial_state(), plain, record.steps_s, covariate) - plain
    if effect.stage is Stage.MECHANICAL and not any(e.stage is Stage.START for e in chain.effects_in(index)):
        return effect.run(effect.initial_state(), plain, record.steps_s) - plain
    return predict(chain, record, index, (effect,), is_coarse=True) - plain


def _screen_one(chain: Chain, records: tuple[PreparedRecord, ...], space: Tangent, clear: tuple[Array, ...],
                plain: tuple[Array, ...], effect: Effect, index: int | None) -> list[Screened]:  # fmt: skip
    try:
        parts = tuple(
            centred(signature(chain, r, i, effect, p), r.is_used) if index in (None, i) else np.zeros(r.time_s.size)
            for i, (r, p) in enumerate(zip(records, plain, strict=True))
        )
    except ParameterError:
        return []
    parts = space.remove(records, parts)
    power = squared_error(records, parts)
    if not np.isfinite(power) or power <= 0.0:
        return []
    product = sum(float(np.dot(s[r.is_used], c[r.is_used])) for r, s, c in zip(records, parts, clear, strict=True))
    main = next(spec for spec in effect.parameters if spec.name == effect.main_parameter)
    takes_either_sign = main.name in effect.linear_parameters and main.lower < 0.0
    explained = product**2 / power if takes_either_sign or product > 0.0 else 0.0
    return [Screened(effect, index, explained, power, product / power)]


def family_columns(chain: Chain, effect: AsymmetricHysteresis) -> ColumnKinds:
    """Return the plays with knees of the effect as columns beside those of the chain."""
    thresholds = np.array(effect.thresholds_v)
    return chain.columns.joined(ColumnKinds(thresholds, np.array(effect.knees_v), np.zeros(thresholds.size, dtype=np.int64)))


def _screen_family(chain: Chain, records: tuple[PreparedRecord, ...], space: Tangent, clear: tuple[Array, ...],
                   effect: Effect) -> Screened:  # fmt: skip
    assert isinstance(effect, AsymmetricHysteresis)
    from fomrc_core.base_fit import record_columns

    thresholds = np.array(effect.thresholds_v)
    only = ColumnKinds(thresholds, np.array(effect.knees_v), np.zeros(thresholds.size, dtype=np.int64))
    family = Chain(only, np.zeros(thresholds.size), chain.creep_order, chain.effects, chain.record_effects)
    gram = np.zeros((thresholds.size,) * 2)
    moment = np.zeros(thresholds.size)
    for i, (record, left, columns) in enumerate(zip(records, clear, space.columns, strict=True)):
        own = centred(record_columns(family, record, i), record.is_used)[record.is_used]
        base = columns[record.is_used] @ space.whitening
        own = own - base @ (base.T @ own) if len(records) == 1 else own
        gram += own.T @ own
        moment += own.T @ left[record.is_used]
    whitening = whitening_of(gram)
    inside = whitening.T @ moment
    explained = float(inside @ inside)
    return Screened(effect, None, explained, float(np.trace(gram)), 1.0)


