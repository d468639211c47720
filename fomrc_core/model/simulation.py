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
from fomrc_core.model.kernels import forward, forward_beside, forward_widened
from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import Substeps, held_parts, least_parts, means_of_parts, parts_of_steps, subdivide
from fomrc_core.operators.creep import CreepModes, creep_block
from fomrc_core.operators.hysteresis import HEADER as PLAYS_HEADER
from fomrc_core.operators.hysteresis import N_PLAYS, OperatorSum, hysteresis_block

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ElementDrive:
    """What the Maxwell elements see of a drive.

    Attributes:
        steps_s: step that leads to each part [s], shape (n_parts,).
        voltage_v: voltage at the elements at the end of each part [V], shape (n_parts,).
        ends: part that ends at each sample, shape (n_samples,); None where no step is divided.
        widening: factor of the elements' thresholds at the end of each part, shape (n_parts,); None where it is one.
        is_averaged: whether a sample reads the mean over its parts and not their end.
    """

    steps_s: Array
    voltage_v: Array
    ends: NDArray[np.int64] | None
    widening: Array | None = None
    is_averaged: bool = False

    def at_samples(self, values: Array) -> Array:
        """Return values of all parts, along the first axis, as they are read at the samples."""
        if self.ends is None:
            return values
        if not self.is_averaged:
            return values[self.ends]
        return means_of_parts(values, self.ends)


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
        divided: the drive after the effects at its samples, on the parts of the steps.
        driven: the drive after the effects between its samples.
        elements: what the elements saw.
        moved_um: displacement before the mechanics at the end of each part [um], shape (n_parts,).
        sensed_um: displacement before the sensor at the samples [um], shape (n_samples,).
    """

    n_least: int
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
    divided = _divided(state, effects, ElementDrive(steps_s, drive_v, None), substeps, n_least, largest_v)
    return _warped(state, effects, _driven(state, effects, divided))


def _divided(
    state: ModelState,
    effects: tuple[Effect, ...],
    sampled: ElementDrive,
    substeps: Substeps,
    n_least: int,
    largest_v: float | None = None,
) -> ElementDrive:
    """Return the drive after the effects at its samples, on the parts of the steps."""
    # Many arguments: those of drive_at_elements, and into how many parts at least.
    steps_s, drive_v = sampled.steps_s, sampled.voltage_v
    is_held = False
    for effect in of_stage(effects, Stage.SAMPLED_DRIVE):
        drive_v = effect.run(state.effects[effect.name], drive_v, steps_s)
        is_held = is_held or effect.holds
    last_v, state.last_input = state.last_input, float(drive_v[-1])
    ends = None
    before_v = np.concatenate(([last_v], drive_v[:-1]))
    if substeps is not Substeps.NONE:
        if largest_v is None:
            n_plays = int(state.packed[N_PLAYS])
            largest_v = float(state.packed[PLAYS_HEADER + n_plays - 1]) if n_plays else float("inf")
        if is_held and substeps is Substeps.FIT:
            substeps = Substeps.BENDS  # every step is a jump, spread over one of its parts
        parts, state.bend = parts_of_steps(drive_v - before_v, largest_v, n_least, substeps, state.bend)
        if np.any(parts > 1):
            steps_s, fine_v, ends = subdivide(steps_s, drive_v, last_v, parts)
            drive_v = held_parts(before_v, drive_v, parts) if is_held else fine_v
    if is_held and ends is None:
        drive_v = 0.5 * (before_v + drive_v)
    return ElementDrive(steps_s, drive_v, ends, is_averaged=is_held)


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
    moved_um = np.empty(drive.voltage_v.size)
    beside = of_stage(effects, Stage.HYSTERESIS)
    if not beside:
        forward(state.packed, at_creep, drive.voltage_v, drive.steps_s, moved_um)
        return moved_um
    added_um = np.zeros(drive.voltage_v.size)
    for effect in beside:
        added_um += effect.run(state.effects[effect.name], drive.voltage_v, drive.steps_s)
    if drive.widening is None:
        forward_beside(state.packed, at_creep, drive.voltage_v, added_um, drive.steps_s, moved_um)
    else:
        forward_widened(state.packed, at_creep, drive.voltage_v, drive.widening, added_um, drive.steps_s, moved_um)
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
) -> tuple[Array, Passage]:
    """Return the displacement [um] a chain gives, shape (n_samples,), and what its stages handed on.

    Args:
        state: as of ``run_chain``; of the stages that are not run again it does not move.
        at_creep: where the creep block begins.
        effects: in the order of the chain.
        sampled: the drive at the samples.
        substeps: how steps are divided.
        covariates: what is known beside the drive.
        before: the run to go on from; None where there is none.
    """
    # Many arguments: those of run_chain, and the run before.
    n_least = least_parts(effects, sampled.steps_s, substeps)
    known, since = (None, Stage.SAMPLED_DRIVE) if before is None else (before.passage, before.since)
    if known is not None and substeps is Substeps.DIRECTIONS:
        n_least = known.n_least  # a difference is of what is divided alike
    if known is not None and known.n_least != n_least:
        known = None
    if known is not None and since > Stage.SAMPLED_DRIVE:
        divided = known.divided
    else:
        divided = _divided(state, effects, sampled, substeps, n_least)
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
    return seen_um, Passage(n_least, divided, driven, elements, moved_um, sensed_um)


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
