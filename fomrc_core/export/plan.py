"""What of a model is exported: its tables, brought to an even length, and what each direction remembers."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects import Stage
from fomrc_core.effects.base.step_form import StateField
from fomrc_core.export.options import ExportOptions, Precision
from fomrc_core.export.parts import EffectPart, LeftOut, PartsOfSteps, covariate_fields, effect_parts
from fomrc_core.identification.element_count import merged
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import INVERSE_GAMMA, creep_block
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

STATE_VERSION = 1
# Sums run over pairs of entries; one that stands for nothing has weight 0. Its rate is that of a mode long gone.
_LANES = 2
_IDLE_RATE_PER_S = 1e6


@dataclass(frozen=True, eq=False)
class ExportPlan:
    """A model made ready for export.

    Attributes:
        options: how it is exported.
        model: what is exported, after joining elements and leaving out effects.
        checksum: SHA-256 of the model as asked for, in hexadecimal digits.
        parts: the effects, in the order of the chain.
        left_out: causes that are not exported, or not inverted.
        steps: into how many parts a forward step is divided.
        forward_start: where the forward direction starts, by (effect, field), where it does not start relaxed.
        play_form: voltage to displacement, of even length.
        stop_form: displacement to voltage, of even length.
        rates_per_s: rates of the creep modes, of even length.
        weights: their weights.
        feedthrough: what passes creep at once.
        inverse_gamma: 1 / Gamma(order + 2).
    """

    options: ExportOptions
    model: PiezoModel
    checksum: str
    parts: tuple[EffectPart, ...]
    left_out: tuple[LeftOut, ...]
    steps: PartsOfSteps
    play_form: OperatorSum
    stop_form: OperatorSum
    rates_per_s: Array
    weights: Array
    feedthrough: float
    inverse_gamma: float
    forward_start: Mapping[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)

    @property
    def n_plays(self) -> int:
        """Number of plays, those that stand for nothing among them."""
        return int(self.play_form.thresholds.size)

    @property
    def n_modes(self) -> int:
        """Number of creep modes, those that stand for nothing among them."""
        return int(self.rates_per_s.size)

    @property
    def largest_v(self) -> float:
        """Largest threshold [V], of which the division of steps is told; infinite where there are no elements."""
        thresholds = self.model.play_form.thresholds
        return float(thresholds[-1]) if thresholds.size else math.inf

    @property
    def is_held(self) -> bool:
        """Whether the drive stands still between samples."""
        return any(part.is_holding for part in self.parts)

    @property
    def is_beside(self) -> bool:
        """Whether the inverse undoes effects beside the elements: then it searches for the voltage."""
        return any(part.stage is Stage.HYSTERESIS and part.is_inverted for part in self.parts)

    @property
    def is_searching_limits(self) -> bool:
        """Whether a limited inverse searches for the displacement: it does where there are effects to undo."""
        return any(part.is_inverted for part in self.parts)

    @property
    def jumping(self) -> tuple[str, ...]:
        """Effects whose answer jumps with what is computed before them; with what comes in they jump as in double."""
        names: list[str] = []
        if self.options.is_forward:
            # what holds its input hands on what came in
            computing = [part for part in self.parts if not part.is_holding]
            names += [part.name for part in computing[1:] if "forward" in part.form.jumps]
        if self.options.is_inverse:
            undone = [part for part in reversed(self.parts) if part.is_inverted]
            is_first = bool(undone) and undone[0].stage >= Stage.MECHANICAL
            names += [part.name for part in (undone[1:] if is_first else undone) if "inverse" in part.form.jumps]
        return tuple(names)

    @property
    def precision(self) -> Precision:
        """Precision the steps compute in: that of the answers, but double where an effect jumps."""
        return Precision.DOUBLE if self.jumping else self.options.precision

    @property
    def is_wide(self) -> bool:
        """Whether answers in single precision are computed in double."""
        return self.precision is not self.options.precision

    def parts_of(self, is_inverse: bool) -> tuple[EffectPart, ...]:
        """Return the effects of a direction."""
        return tuple(part for part in self.parts if part.is_inverted or not is_inverse)

    def state_fields(self, is_inverse: bool) -> tuple[tuple[str, StateField], ...]:
        """Return every field of a state in the order in which it is saved, with the effect it belongs to, or ""."""
        fields = [("", own) for own in self.core_fields(is_inverse)]
        fields += [(part.name, own) for part in self.parts_of(is_inverse) for own in part.form.state]
        start = {} if is_inverse else self.forward_start
        return tuple((owner, replace(own, initial=start.get((owner, own.name), own.initial))) for owner, own in fields)

    def core_fields(self, is_inverse: bool) -> tuple[StateField, ...]:
        """Return what a direction remembers between two steps, that of its effects aside."""
        modes = (0.0,) * self.n_modes
        plays_unit = "[um]" if is_inverse and not self.is_beside else "[V]"
        fields = [
            StateField("plays", (0.0,) * self.n_plays, is_array=True, comment=plays_unit),
            StateField("modes", modes, is_array=True, comment="of creep"),
        ]
        if self.precision is Precision.FLOAT:
            fields.append(StateField("lost", modes, is_array=True, comment="digits of the modes that float has not"))
        fields += [
            StateField("previous", comment="input of creep at the last step [um]"),
            StateField("voltage_v", comment="voltage at the last step [V]"),
        ]
        if is_inverse:
            if self.is_searching_limits:
                fields.append(StateField("desired_um", comment="displacement at the last step [um]"))
            if self.is_beside:
                fields.append(StateField("elements_v", comment="voltage at the elements at the last step [V]"))
        elif self.steps.substeps is Substeps.BENDS:
            fields.append(StateField("bend", comment="what jumps leave bending in the next step [V]"))
        return (*fields, *covariate_fields(self.parts_of(is_inverse)))


def make_plan(model: PiezoModel, options: ExportOptions) -> ExportPlan:
    """Return what is to be exported of a model.

    Raises:
        ParameterError: an effect that cannot be exported, unless it is to be left out.
    """
    reduced = _with_elements(model, options.n_elements)
    parts, left_out = effect_parts(reduced, options)
    kept = {part.name for part in parts}
    reduced = replace(reduced, effects=tuple(effect for effect in reduced.effects if effect.name in kept))
    modes = reduced.creep_modes
    return ExportPlan(
        options=options,
        model=reduced,
        checksum=model_checksum(model),
        parts=parts,
        left_out=left_out,
        steps=PartsOfSteps.of(reduced.effects, reduced.substeps),
        play_form=_even_form(reduced.play_form),
        stop_form=_even_form(reduced.stop_form),
        rates_per_s=_even(modes.rates_per_s, _IDLE_RATE_PER_S),
        weights=_even(modes.weights, 0.0),
        feedthrough=modes.feedthrough,
        inverse_gamma=float(creep_block(modes)[INVERSE_GAMMA]),
    )


def model_checksum(model: PiezoModel) -> str:
    """Return the SHA-256 of a model's numbers in hexadecimal digits; equal models have equal ones, on any machine."""
    text = json.dumps(model.to_mapping(), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _with_elements(model: PiezoModel, n_elements: int | None) -> PiezoModel:
    if n_elements is None or n_elements >= model.n_elements:
        return model
    kappa, saturation = elements_from_play_form(merged(model.play_form, n_elements))
    return replace(model, kappa_um_per_v=kappa, saturation_v=saturation)


def _even_form(form: OperatorSum) -> OperatorSum:
    return OperatorSum(form.slope, _even(form.thresholds, 0.0), _even(form.weights, 0.0))


def _even(values: Array, idle: float) -> Array:
    n_idle = (-values.size) % _LANES if values.size else _LANES
    return np.concatenate((values, np.full(n_idle, idle)))
