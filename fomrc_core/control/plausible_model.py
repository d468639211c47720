"""Which models can be those of a piezo actuator: what lies beyond is a typing error or a failed fit."""

from __future__ import annotations

from fomrc_core.errors import ParameterError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.usability import GAIN_UM_PER_V

# An element of a larger kappa moves less than a picometre per volt: it is no element.
LARGEST_KAPPA_UM_PER_V = 1e12
# Driven by more than any piezo amplifier gives, it never saturates.
LARGEST_SATURATION_V = 1e4
# Creep grows by 10^order in each decade of time: by a few per cent for piezo ceramics (orders of 0.01 to 0.1).
# At one half it would be diffusion, threefold in a decade.
LARGEST_CREEP_ORDER = 0.5


def check_plausible(model: PiezoModel, where: str = "model") -> None:
    """Raise where no piezo actuator is like this model.

    Args:
        model: the model.
        where: what it is called in the message.

    Raises:
        ParameterError: a gain, an element or a creep order that no piezo actuator has.
    """
    gain_um_per_v = 1.0 / float((1.0 / model.kappa_um_per_v).sum())
    low, high = GAIN_UM_PER_V
    largest_gain = float(model.kappa_um_per_v[-1])
    for gain in (gain_um_per_v, largest_gain):
        if not low <= gain <= high:
            raise ParameterError(
                "implausible gain",
                where=f"{where}.kappa_um_per_v",
                value=gain,
                allowed=f"{low:g} to {high:g} um/V, all elements together and the last one alone",
            )
    if float(model.kappa_um_per_v.max()) > LARGEST_KAPPA_UM_PER_V:
        raise ParameterError(
            "implausible element",
            where=f"{where}.kappa_um_per_v",
            value=float(model.kappa_um_per_v.max()),
            allowed=f"at most {LARGEST_KAPPA_UM_PER_V:g} um/V",
        )
    if model.saturation_v.size and float(model.saturation_v.max()) > LARGEST_SATURATION_V:
        raise ParameterError(
            "implausible element",
            where=f"{where}.saturation_v",
            value=float(model.saturation_v.max()),
            allowed=f"at most {LARGEST_SATURATION_V:g} V",
        )
    if not model.creep_order < LARGEST_CREEP_ORDER:
        raise ParameterError(
            "implausible creep order",
            where=f"{where}.creep_order",
            value=model.creep_order,
            allowed=f"0 to less than {LARGEST_CREEP_ORDER:g}; piezo ceramics have 0.01 to 0.1",
        )
