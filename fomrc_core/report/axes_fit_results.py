"""An identification of several axes, each number with its standard error, as plain numbers for programs."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from fomrc_core.storage.axes_files import axes_mapping

if TYPE_CHECKING:
    from fomrc_core.identification.axes import AxesIdentification


def axes_fit_results(found: AxesIdentification) -> dict[str, Any]:
    """Return the same as plain numbers and lists, None where there is no number: what was not fitted, or is open.

    ``standard_errors`` has the fields of ``AxesStandardErrors``; ``gain_um_per_um`` is of each mode, in its order.
    """
    sure = found.standard_errors
    errors = zip(found.names, found.errors.tolist(), strict=True)
    return {
        "records": list(found.names),
        "left_out": list(found.broken),
        "n_parameters": found.n_parameters,
        "relative_errors": {name: _plain(np.array(values)) for name, values in errors},
        "gain_um_per_um": _plain(found.gains),
        "hysteresis_weights": _plain(found.parameters.play_weights),
        "standard_errors": {field.name: _plain(np.asarray(getattr(sure, field.name))) for field in fields(sure)},
        "model": {"axes": axes_mapping(found.model)},
    }


def _plain(values: np.ndarray[Any, Any]) -> Any:
    if values.ndim == 0:
        return float(values) if np.isfinite(values) else None
    return [_plain(value) for value in values]
