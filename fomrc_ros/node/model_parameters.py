"""The model's parameters, under ``model.`` as in a model file: a model file is a parameter file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fomrc_core.control.plausible_model import check_plausible
from fomrc_core.errors import ParameterError
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import BY_EFFECTS, MODEL_SUBSTEPS
from fomrc_core.operators.creep import SHORTEST_TIME_S
from fomrc_ros.node.parameters import Kind, ParameterSpec

PREFIX = "model."
_PLAIN = ("kappa_um_per_v", "saturation_v", "creep_order", "substeps", "shortest_time_s")

MODEL_SPECS = (
    ParameterSpec(
        "model.kappa_um_per_v",
        None,
        "Maxwell gains kappa, one more than saturation_v",
        kind=Kind.DOUBLE_ARRAY,
        unit="um s^-alpha / V",
    ),
    ParameterSpec(
        "model.saturation_v",
        None,
        "saturation voltages of the Maxwell elements",
        kind=Kind.DOUBLE_ARRAY,
        unit="V",
    ),
    ParameterSpec("model.creep_order", 0.0, "creep order alpha", minimum=0.0, maximum=1.0, unit="1"),
    ParameterSpec("model.effects", [], "names of the effects beside hysteresis and creep", kind=Kind.STRING_ARRAY),
    ParameterSpec(
        "model.substeps",
        BY_EFFECTS,
        "how finely steps are divided; by_effects: as the effects need it",
        choices=(BY_EFFECTS, *(kind.value for kind in MODEL_SUBSTEPS)),
    ),
    ParameterSpec(
        "model.shortest_time_s",
        SHORTEST_TIME_S,
        "shortest time creep holds for: about half the step of the fastest record the model is for",
        minimum=1e-12,
        maximum=SHORTEST_TIME_S,
        unit="s",
    ),
    ParameterSpec(
        "model.fit_rms_um",
        0.0,
        "error of the fit the model came from, shown in /diagnostics; 0 where not known",
        unit="um",
        minimum=0.0,
    ),
)


def effect_spec(name: str) -> ParameterSpec | None:
    """Return the specification of ``model.<effect>.<parameter>``, None where there is no such parameter."""
    if not name.startswith(PREFIX):
        return None
    effect_name, _, parameter_name = name[len(PREFIX) :].partition(".")
    kind = cause_classes().get(effect_name)
    if kind is None:
        return None
    for parameter in kind.parameters:
        if parameter.name != parameter_name:
            continue
        if parameter.is_list:
            return ParameterSpec(
                name, None, parameter.description or kind.meaning, kind=Kind.DOUBLE_ARRAY, unit=parameter.unit
            )
        return ParameterSpec(
            name,
            None,
            parameter.description or kind.meaning,
            kind=Kind.DOUBLE,
            unit=parameter.unit,
            minimum=parameter.lower,
            maximum=parameter.upper,
        )
    return None


def parameters_of_effects(values: Mapping[str, Any]) -> list[str]:
    """Return the full names of all parameters of the effects the values name; unknown effects are left out."""
    kinds = cause_classes()
    return [
        f"{PREFIX}{effect_name}.{parameter.name}"
        for effect_name in values.get("model.effects") or ()
        if effect_name in kinds
        for parameter in kinds[effect_name].parameters
    ]


def model_from_values(values: Mapping[str, Any]) -> PiezoModel | None:
    """Return the model these parameter values describe, None where no model has been given.

    Raises:
        ParameterError: values that make no model.
    """
    kappa, saturation = values.get("model.kappa_um_per_v"), values.get("model.saturation_v")
    if not kappa and not saturation:
        return None
    mapping: dict[str, Any] = {name: values[PREFIX + name] for name in _PLAIN if PREFIX + name in values}
    effects = list(values.get("model.effects") or [])
    if len(set(effects)) != len(effects):
        raise ParameterError(
            "an effect is named twice", where="model.effects", value=effects, allowed="each effect once"
        )
    if effects:
        mapping["effects"] = effects
    for effect_name in effects:
        start = f"{PREFIX}{effect_name}."
        mapping[effect_name] = {name[len(start) :]: value for name, value in values.items() if name.startswith(start)}
    model = PiezoModel.from_mapping(mapping, where="model")
    check_plausible(model)
    return model


def as_replacement(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a file with what a whole model in it leaves out: its effects are none, not the old ones."""
    if not {"model.kappa_um_per_v", "model.saturation_v"} <= set(values):
        return dict(values)
    left_out = {spec.name: spec.default for spec in MODEL_SPECS if spec.default is not None}
    return left_out | dict(values)


def values_from_model(model: PiezoModel) -> dict[str, Any]:
    """Return the parameter values that describe a model, the inverse of ``model_from_values``."""
    values: dict[str, Any] = {"model.effects": [], "model.substeps": BY_EFFECTS}
    for name, value in model.to_mapping().items():
        if isinstance(value, Mapping):
            values.update({f"{PREFIX}{name}.{key}": entry for key, entry in value.items()})
        else:
            values[PREFIX + name] = value
    return values
