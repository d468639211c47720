"""The one simulator: a drive through effects, elements, creep and effects again.

A model, a model under fit and the columns of a fit's linear part go through the functions here, and so does what went
before a record. Without effects and without division of steps this is equations (20)-(26) sample by sample.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Covariates, Effect, Stage
from fomrc_core.effects.base.covariates import NO_COVARIATES
from fomrc_core.model.divided_drive import ElementDrive, KeptDivisions, divided_drive, largest_threshold
from fomrc_core.model.kernels import forward, forward_beside, forward_parts, forward_widened
from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import Substeps, least_parts
from fomrc_core.model.swing_parts import least_of_steps, swinging
from fomrc_core.operators.creep import CreepModes, creep_block
from fomrc_core.operators.hysteresis import OperatorSum, hysteresis_block

Array = NDArray[np.float64]

_NONE = np.empty(0)  # factors of thresholds, or what acts beside the elements, where there are none


def relaxed_state(play_form: OperatorSum, modes: CreepModes, effects: Iterable[Effect]) -> tuple[ModelState, int]:
    """Return the relaxed state of a chain, and where the creep block begins in it."""
    hysteresis = hysteresis_block(play_form)
    packed = np.concatenate((hysteresis, creep_block(modes)))
    return ModelState(packed, {effect.name: effect.initial_state() for effect in effects}), int(hysteresis.size)


def of_stage(effects: Iterable[Effect], stage: Stage) -> tuple[Effect, ...]:
    """Return the effects of one stage, in the order they are given."""
    return tuple(effect for effect in effects if effect.stage is stage)


def before_record(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return the effects that act on what went before a record, too."""
    return tuple(effect for effect in effects if effect.acts_before_record())


@dataclass(frozen=True, eq=False)
class Passage:
    """What a chain handed on from stage to stage in one run, for a chain that differs in a later stage only.

    Attributes:
        n_least: into how many parts the effects asked each step to be divided at least.
        swings: those that say where fewer will do.
        divided: the drive after the effects at its samples, on the parts of the steps.
        driven: the drive after the effects between its samples.
        elements: what the elements saw.
        moved_um: displacement before the mechanics at the end of each part [um], shape (n_parts,).
        sensed_um: displacement before the sensor at the samples [um], shape (n_samples,).
    """

    n_least: int
    swings: tuple[Effect, ...]
    divided: ElementDrive
    driven: ElementDrive
    elements: ElementDrive
    moved_um: Array
    sensed_um: Array


@dataclass(frozen=True, eq=False)
class Before:
    """A run over the same drive that a chain goes on from.

    Attributes:
        passage: what the stages of that chain handed on.
        since: the first stage in which this chain differs from that one.
    """

    passage: Passage
    since: Stage


def gone_on_from(
    before: Before | None, effects: tuple[Effect, ...], steps_s: Array, substeps: Substeps
) -> Before | None:
    """Return the run before where a chain divides the steps alike, None where it must run from the beginning."""
    if before is None or substeps is Substeps.DIRECTIONS:
        return before  # a difference is of what is divided alike
    is_alike = before.passage.n_least == least_parts(effects, steps_s, substeps)
    return before if is_alike and before.passage.swings == swinging(effects) else None


def drive_at_elements(
    state: ModelState,
    effects: tuple[Effect, ...],
    steps_s: Array,
    drive_v: Array,
    substeps: Substeps,
    largest_v: float | None = None,
) -> ElementDrive:
    """Return what the elements see of a drive; the state's part before the elements moves on.

    Args:
        state: of the chain.
        effects: in the order of the chain.
        steps_s: step that leads to each sample [s], shape (n_samples,).
        drive_v: commanded voltage [V], shape (n_samples,).
        substeps: how steps are divided.
        largest_v: largest threshold [V], where it is not that of the state's plays.
    """
    n_least = least_parts(effects, steps_s, substeps)
    divided = _divided(state, effects, ElementDrive(steps_s, drive_v, None), substeps, n_least, largest_v=largest_v)
    return _warped(state, effects, _driven(state, effects, divided))


def _divided(
    state: ModelState,
    effects: tuple[Effect, ...],
    sampled: ElementDrive,
    substeps: Substeps,
    n_least: int,
    *,
    largest_v: float | None = None,
    kept: KeptDivisions | None = None,
) -> ElementDrive:
    """Return the drive after the effects at its samples, on the parts of the steps."""
    # Many arguments: those of drive_at_elements, into how many parts at least, and what was divided before.
    at_samples = of_stage(effects, Stage.SAMPLED_DRIVE)
    drive_v = sampled.voltage_v
    for effect in at_samples:
        drive_v = effect.run(state.effects[effect.name], drive_v, sampled.steps_s)
    scale_v = largest_threshold(state, largest_v)
    least = least_of_steps(effects, sampled.steps_s, drive_v, scale_v, substeps, n_least)
    if not at_samples and kept is not None:
        return kept.of(state, sampled, substeps, least, largest_v)
    is_held = any(effect.holds for effect in at_samples)
    return divided_drive(state, replace(sampled, voltage_v=drive_v), substeps, least, largest_v, is_held=is_held)


def _driven(state: ModelState, effects: tuple[Effect, ...], divided: ElementDrive) -> ElementDrive:
    """Return the drive after the effects between its samples."""
    drive_v = divided.voltage_v
    for effect in of_stage(effects, Stage.DRIVE):
        drive_v = effect.run(state.effects[effect.name], drive_v, divided.steps_s)
    return replace(divided, voltage_v=drive_v)


def _warped(state: ModelState, effects: tuple[Effect, ...], driven: ElementDrive) -> ElementDrive:
    """Return what the elements see of the drive: warped, and with their thresholds widened."""
    drive_v, steps_s = driven.voltage_v, driven.steps_s
    for effect in of_stage(effects, Stage.HYSTERESIS):
        drive_v = effect.warp(drive_v)
    widening = None
    for effect in of_stage(effects, Stage.HYSTERESIS):
        factor = effect.widening(state.effects[effect.name], drive_v, steps_s)
        if factor is not None:
            widening = factor if widening is None else widening * factor
    return replace(driven, voltage_v=drive_v, widening=widening)


def displacement_of_parts(state: ModelState, at_creep: int, effects: tuple[Effect, ...], drive: ElementDrive) -> Array:
    """Return the displacement of the mechanics [um] at the end of each part, shape (n_parts,); the state moves on."""
    return _of_mechanics(state, effects, _of_elements(state, at_creep, effects, drive), drive)


def _of_elements(state: ModelState, at_creep: int, effects: tuple[Effect, ...], drive: ElementDrive) -> Array:
    """Return the displacement of elements, what acts beside them, and creep [um], shape (n_parts,)."""
    moved_um, added_um, widening = np.empty(drive.voltage_v.size), _NONE, drive.widening
    beside = of_stage(effects, Stage.HYSTERESIS)
    if beside:
        added_um = np.zeros(drive.voltage_v.size)
        for effect in beside:
            added_um += effect.run(state.effects[effect.name], drive.voltage_v, drive.steps_s)
    elements = (state.packed, at_creep, drive.voltage_v)
    if drive.ends is not None:
        forward_parts(*elements, _NONE if widening is None else widening, added_um, drive.steps_s, moved_um)
    # sample by sample a batch is its steps bit for bit
    elif not beside:
        forward(*elements, drive.steps_s, moved_um)
    elif widening is None:
        forward_beside(*elements, added_um, drive.steps_s, moved_um)
    else:
        forward_widened(*elements, widening, added_um, drive.steps_s, moved_um)
    return moved_um


def _of_mechanics(state: ModelState, effects: tuple[Effect, ...], moved_um: Array, drive: ElementDrive) -> Array:
    for effect in of_stage(effects, Stage.MECHANICAL):
        heard_v = drive.voltage_v if effect.follows_elements else None
        moved_um = effect.run(state.effects[effect.name], moved_um, drive.steps_s, heard_v)
    return moved_um


def run_chain(
    state: ModelState,
    at_creep: int,
    effects: tuple[Effect, ...],
    steps_s: Array,
    drive_v: Array,
    *,
    substeps: Substeps,
    covariates: Covariates = NO_COVARIATES,
) -> Array:
    """Return the displacement [um] a chain gives, shape (n_samples,); the state moves on.

    Args:
        state: packed hysteresis (play form) and creep blocks, and the effects' states.
        at_creep: where the creep block begins.
        effects: in the order of the chain.
        steps_s: step that leads to each sample [s], shape (n_samples,).
        drive_v: commanded voltage [V], shape (n_samples,).
        substeps: how steps are divided.
        covariates: what is known beside the drive.
    """
    # Many arguments: a model and a model under fit both run through here; it takes the parts they share.
    sampled = ElementDrive(steps_s, drive_v, None)
    if not effects and substeps is Substeps.NONE:
        state.last_input = float(drive_v[-1])
        return _of_elements(state, at_creep, effects, sampled)
    return pass_chain(state, at_creep, effects, sampled, substeps=substeps, covariates=covariates)[0]


def pass_chain(
    state: ModelState,
    at_creep: int,
    effects: tuple[Effect, ...],
    sampled: ElementDrive,
    *,
    substeps: Substeps,
    covariates: Covariates = NO_COVARIATES,
    before: Before | None = None,
    kept: KeptDivisions | None = None,
) -> tuple[Array, Passage]:
    """Return the displacement [um] a chain gives, shape (n_samples,), and what its stages handed on.

    Args:
        state: as of ``run_chain``; of the stages that are not run again it does not move.
        at_creep: where the creep block begins.
        effects: in the order of the chain.
        sampled: the drive at the samples.
        substeps: how steps are divided.
        covariates: what is known beside the drive.
        before: the run to go on from, see ``gone_on_from``; None where there is none.
        kept: divisions of this drive before; None where nobody keeps them.
    """
    # Many arguments: those of run_chain, the run before and the divisions kept.
    known, since = (None, Stage.SAMPLED_DRIVE) if before is None else (before.passage, before.since)
    n_least = least_parts(effects, sampled.steps_s, substeps) if known is None else known.n_least
    if known is not None and since > Stage.SAMPLED_DRIVE:
        divided = known.divided
    else:
        divided = _divided(state, effects, sampled, substeps, n_least, kept=kept)
    driven = known.driven if known is not None and since > Stage.DRIVE else _driven(state, effects, divided)
    if known is not None and since > Stage.HYSTERESIS:
        elements, moved_um = known.elements, known.moved_um
    else:
        elements = _warped(state, effects, driven)
        moved_um = _of_elements(state, at_creep, effects, elements)
    if known is not None and since > Stage.MECHANICAL:
        sensed_um = known.sensed_um
    else:
        sensed_um = elements.at_samples(_of_mechanics(state, effects, moved_um, elements))
    seen_um = sensed_um
    for effect in of_stage(effects, Stage.SENSED):
        seen_um = effect.run(state.effects[effect.name], seen_um, sampled.steps_s, covariates.of(effect.covariate))
    return seen_um, Passage(n_least, swinging(effects), divided, driven, elements, moved_um, sensed_um)


def settle_chain(
    state: ModelState,
    at_creep: int,
    effects: tuple[Effect, ...],
    past: tuple[Array, Array],
    substeps: Substeps,
) -> None:
    """Move the state through what went before a record: steps [s] and voltages [V].

    Clocks that start with the record do not run.
    """
    run_chain(state, at_creep, before_record(effects), *past, substeps=substeps)
