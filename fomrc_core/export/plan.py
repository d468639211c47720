"""What of a model is exported: its tables, brought to an even length, and what each direction remembers."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.step_form import StateField
from fomrc_core.errors import ParameterError
from fomrc_core.export.options import ExportOptions, Precision
from fomrc_core.identification.element_count import merged
from fomrc_core.model.piezo_model import PiezoModel
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
        dropped: name of each effect left out, with the reason.
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
    dropped: tuple[tuple[str, str], ...]
    play_form: OperatorSum
    stop_form: OperatorSum
    rates_per_s: Array
    weights: Array
    feedthrough: float
    inverse_gamma: float

    @property
    def n_plays(self) -> int:
        """Number of plays, those that stand for nothing among them."""
        return int(self.play_form.thresholds.size)

    @property
    def n_modes(self) -> int:
        """Number of creep modes, those that stand for nothing among them."""
        return int(self.rates_per_s.size)

    def state_fields(self, is_inverse: bool) -> tuple[StateField, ...]:
        """Return what a direction remembers between two steps."""
        modes = (0.0,) * self.n_modes
        fields = [
            StateField("plays", (0.0,) * self.n_plays, is_array=True, comment="[um]" if is_inverse else "[V]"),
            StateField("modes", modes, is_array=True, comment="of creep"),
        ]
        if self.options.precision is Precision.FLOAT:
            fields.append(StateField("lost", modes, is_array=True, comment="digits of the modes that float has not"))
        fields += [
            StateField("previous", comment="input of creep at the last step [um]"),
            StateField("voltage_v", comment="voltage at the last step [V]"),
        ]
        return tuple(fields)


def make_plan(model: PiezoModel, options: ExportOptions) -> ExportPlan:
    """Return what is to be exported of a model.

    Raises:
        ParameterError: an effect that cannot be exported, unless it is to be left out.
    """
    reduced, dropped = _without_effects(_with_elements(model, options.n_elements), options.is_dropping)
    modes = reduced.creep_modes
    return ExportPlan(
        options=options,
        model=reduced,
        checksum=model_checksum(model),
        dropped=dropped,
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
    return PiezoModel(kappa, saturation, model.creep_order, model.effects)


def _without_effects(model: PiezoModel, is_dropping: bool) -> tuple[PiezoModel, tuple[tuple[str, str], ...]]:
    dropped = tuple((cause.name, cause.inverse_note) for cause in model.causes)
    if dropped and not is_dropping:
        name, reason = dropped[0]
        raise ParameterError(
            "effect cannot be exported", where=f"model.{name}", value=reason, allowed="--drop leaves it out"
        )
    return PiezoModel(model.kappa_um_per_v, model.saturation_v, model.creep_order), dropped


def _even_form(form: OperatorSum) -> OperatorSum:
    return OperatorSum(form.slope, _even(form.thresholds, 0.0), _even(form.weights, 0.0))


def _even(values: Array, idle: float) -> Array:
    n_idle = (-values.size) % _LANES if values.size else _LANES
    return np.concatenate((values, np.full(n_idle, idle)))
