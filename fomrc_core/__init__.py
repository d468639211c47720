"""Hysteresis and creep of piezo actuators: simulate, invert, fit, and ask where the model is wrong.

    from fomrc_core import Compensator, diagnose, identify, read_recording

    record = read_recording("record.csv")
    fit = identify(record)
    voltage_v = Compensator(fit.model).run(steps_s, desired_um)
    print(diagnose(record))

Each name is imported when it is first used, so that importing the package itself takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fomrc_core.diagnosis.diagnosis import Diagnosis, diagnose
    from fomrc_core.effects import Effect
    from fomrc_core.errors import FomrcError
    from fomrc_core.identification.convex import identify
    from fomrc_core.identification.fit import Fit
    from fomrc_core.model.compensator import Compensator
    from fomrc_core.model.piezo_model import PiezoModel
    from fomrc_core.records.recording import Recording
    from fomrc_core.storage import read_model, read_recording, write_model, write_recording

    __version__: str

__all__ = [
    "Compensator",
    "Diagnosis",
    "Effect",
    "Fit",
    "FomrcError",
    "PiezoModel",
    "Recording",
    "__version__",
    "diagnose",
    "identify",
    "read_model",
    "read_recording",
    "write_model",
    "write_recording",
]

_MODULE_OF_NAME = {
    "Compensator": "fomrc_core.model.compensator",
    "Diagnosis": "fomrc_core.diagnosis.diagnosis",
    "Effect": "fomrc_core.effects",
    "Fit": "fomrc_core.identification.fit",
    "FomrcError": "fomrc_core.errors",
    "PiezoModel": "fomrc_core.model.piezo_model",
    "Recording": "fomrc_core.records.recording",
    "diagnose": "fomrc_core.diagnosis.diagnosis",
    "identify": "fomrc_core.identification.convex",
    "read_model": "fomrc_core.storage",
    "read_recording": "fomrc_core.storage",
    "write_model": "fomrc_core.storage",
    "write_recording": "fomrc_core.storage",
}


def __getattr__(name: str) -> Any:
    """Import a public name at its first use (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            value: Any = version("fomrc_ros")
        except PackageNotFoundError:  # a bare copy of the source: there is no metadata to read
            value = "unknown"
    elif name in _MODULE_OF_NAME:
        value = getattr(importlib.import_module(_MODULE_OF_NAME[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
