"""The effects of an export: which there are, what each remembers, and which are left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.step_form import FieldKind, StateField, StepForm
from fomrc_core.errors import ParameterError
from fomrc_core.export.options import ExportOptions
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import N_PARTS_LARGE, N_SUBSTEPS, Substeps, least_parts

_NO_STEP_FORM = "it has no step form"
# How much shorter than the sample time steps may be, one after the other, for an effect that keeps samples.
_ROOM_FOR_SHORT_STEPS = 4


@dataclass(frozen=True)
class EffectPart:
    """One effect of an export.

    Attributes:
        name: of the effect, and of all that is its own in the files.
        stage: where it acts.
        form: its step.
        covariate: name of the signal it reads, empty for none.
        is_inverted: whether the inverse undoes it.
        is_holding: whether it makes the drive stand still between samples.
    """

    name: str
    stage: Stage
    form: StepForm
    covariate: str
    is_inverted: bool
    is_holding: bool


@dataclass(frozen=True)
class LeftOut:
    """A cause that is not exported, or not inverted.

    Attributes:
        name: of the cause.
        reason: why.
        of_inverse: whether it is left out of the inverse alone.
    """

    name: str
    reason: str
    of_inverse: bool

    def __str__(self) -> str:
        return f"{self.name} ({'of the inverse; ' if self.of_inverse else ''}{self.reason})"


@dataclass(frozen=True)
class PartsOfSteps:
    """Into how many parts a forward step is divided (model/substeps.py).

    Attributes:
        substeps: how finely.
        least: how many at least.
    """

    substeps: Substeps
    least: int

    @classmethod
    def of(cls, effects: tuple[Effect, ...], substeps: Substeps) -> PartsOfSteps:
        """Return a division of steps with as many parts at least as effects ask for."""
        return cls(substeps, least_parts(effects, np.zeros(0), substeps))

    @property
    def counts(self) -> tuple[int, ...]:
        """Every number of parts there may be, ascending."""
        several = {Substeps.NONE: (), Substeps.BENDS: (N_SUBSTEPS, N_PARTS_LARGE)}.get(self.substeps, (N_PARTS_LARGE,))
        return tuple(sorted({max(n_parts, self.least) for n_parts in (1, *several)}))


def effect_parts(model: PiezoModel, options: ExportOptions) -> tuple[tuple[EffectPart, ...], tuple[LeftOut, ...]]:
    """Return the effects that are exported, in the order of the chain, and those that are left out.

    Raises:
        ParameterError: one cannot be exported or inverted, and is not to be left out.
    """
    most_parts = PartsOfSteps.of(model.effects, model.substeps).counts[-1]
    shortest_part_s = options.sample_period_s / most_parts / _ROOM_FOR_SHORT_STEPS
    parts, left_out = [], []
    for effect in model.effects:
        form = effect.step_form(shortest_part_s)
        if form is None:
            left_out.append(LeftOut(effect.name, _NO_STEP_FORM, of_inverse=False))
            continue
        is_inverted = effect.can_invert and _has_inverse(effect.stage, form)
        covariate = "" if effect.covariate is None else effect.covariate.value
        is_holding = effect.stage is Stage.SAMPLED_DRIVE and effect.holds
        is_undone = is_inverted and options.is_inverse
        parts.append(EffectPart(effect.name, effect.stage, form, covariate, is_undone, is_holding))
        if not is_inverted and options.is_inverse:
            left_out.append(LeftOut(effect.name, effect.inverse_note, of_inverse=True))
    if model.start is not None and options.is_inverse:
        left_out.append(LeftOut(model.start.name, model.start.inverse_note, of_inverse=True))
    if left_out and not options.is_dropping:
        first = left_out[0]
        what = "effect cannot be inverted" if first.of_inverse else "effect cannot be exported"
        allowed = "--drop leaves it out" + (", --direction forward needs no inverse" if first.of_inverse else "")
        raise ParameterError(what, where=f"model.{first.name}", value=first.reason, allowed=allowed)
    return tuple(parts), tuple(left_out)


def covariate_fields(parts: tuple[EffectPart, ...]) -> tuple[StateField, ...]:
    """Return what a state holds of the signals its effects read."""
    fields: list[StateField] = []
    for name in sorted({part.covariate for part in parts if part.covariate}):
        known = StateField(f"knows_{name}", kind=FieldKind.COUNT, comment="whether it is known")
        fields += [StateField(name, comment="set from outside"), known]
    return tuple(fields)


def _has_inverse(stage: Stage, form: StepForm) -> bool:
    if stage is not Stage.HYSTERESIS:
        return form.inverse is not None
    return (form.forward is None or form.beside is not None) and (form.warp is None or form.unwarp is not None)
