"""The edge: the only file of the truth that knows the product's types, and only to hand data over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fomrc_core.records.recording import Recording

if TYPE_CHECKING:
    from fomrc_core.model.piezo_model import PiezoModel

__all__ = ["Recording", "to_model", "to_recording"]


def to_recording(
    command_v: np.ndarray,
    measured_um: np.ndarray,
    rate_hz: float,
    name: str,
    *,
    temperature_c: np.ndarray | None = None,
    cross: np.ndarray | None = None,
    cross_kind: str = "none",
) -> Recording:
    """Wrap what was measured as a recording."""
    return Recording(
        np.arange(command_v.size) / rate_hz,
        command_v,
        displacement_um=measured_um,
        temperature_c=temperature_c,
        cross_voltage_v=cross if cross_kind == "voltage" else None,
        cross_displacement_um=cross if cross_kind == "displacement" else None,
        name=name,
    )


def to_model(mapping: dict[str, object]) -> PiezoModel:
    """Read a model as from a model file."""
    from fomrc_core.model.piezo_model import PiezoModel

    return PiezoModel.from_mapping(mapping, where="coarse model")
