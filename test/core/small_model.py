"""A model of three elements: small enough to be quick, with hysteresis and creep that are seen."""

from __future__ import annotations

from typing import Any

from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

MODEL: dict[str, Any] = {
    "kappa_um_per_v": [20.0, 12.0, 9.0, 1.4],
    "saturation_v": [0.02, 0.07, 0.2],
    "creep_order": 0.015,
}


def compensator_of(model: dict[str, Any] | None = None) -> Compensator:
    return Compensator(PiezoModel.from_mapping(MODEL if model is None else model))
