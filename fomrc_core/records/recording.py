"""A measured or simulated record: what was applied and what came of it, checked once and read-only."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import RecordingError

if TYPE_CHECKING:
    from pandas import DataFrame

_ARRAY_FIELDS = (
    "time_s",
    "voltage_v",
    "displacement_um",
    "desired_um",
    "temperature_c",
    "cross_voltage_v",
    "cross_displacement_um",
)
# In any unit; squares of what is larger overflow in a fit.
_LARGEST = 1e100


@dataclass(frozen=True, eq=False)
class Recording:
    """A record of an actuator, all arrays of shape (n_samples,), float64, read-only; copied unless they already are.

    Columns may be anything that numpy makes an array of: arrays, lists, a pandas Series, an xarray DataArray.

    Args:
        time_s: sample times [s], strictly increasing, any step length.
        voltage_v: applied voltage [V]; between samples the drive is taken as linear.
        displacement_um: measured displacement [um], arbitrary offset; None where it was not measured.
        desired_um: desired displacement [um], where there was one.
        temperature_c: temperature [degC], where recorded.
        cross_voltage_v: voltage on the second axis [V], where recorded.
        cross_displacement_um: displacement of the second axis [um], where recorded.
        is_valid: samples whose displacement counts, shape (n_samples,), bool; None for all. See ``records.quality``.
        name: what to call the record in messages.

    Raises:
        RecordingError: unequal lengths, fewer than two samples, values not finite or beyond 1e100, time not increasing.
    """

    time_s: NDArray[np.float64]
    voltage_v: NDArray[np.float64]
    displacement_um: NDArray[np.float64] | None = None
    desired_um: NDArray[np.float64] | None = None
    temperature_c: NDArray[np.float64] | None = None
    cross_voltage_v: NDArray[np.float64] | None = None
    cross_displacement_um: NDArray[np.float64] | None = None
    is_valid: NDArray[np.bool_] | None = None
    name: str = "recording"

    def __post_init__(self) -> None:
        for field_name in _ARRAY_FIELDS:
            values = getattr(self, field_name)
            if values is not None:
                object.__setattr__(self, field_name, _checked_column(values, field_name, self.name))
        n_samples = self.time_s.size
        if n_samples < 2:
            raise RecordingError("too few samples", where=self.name, value=n_samples, allowed="2 or more")
        for field_name in _ARRAY_FIELDS[1:]:
            values = getattr(self, field_name)
            if values is not None and values.size != n_samples:
                raise RecordingError(
                    f"{field_name} has another length than time_s",
                    where=self.name,
                    value=values.size,
                    allowed=f"{n_samples} samples",
                )
        if self.is_valid is not None:
            object.__setattr__(self, "is_valid", _checked_mask(self.is_valid, n_samples, self.name))
        steps = np.diff(self.time_s)
        if np.any(steps <= 0.0):
            k = int(np.argmax(steps <= 0.0)) + 1
            raise RecordingError(
                f"time_s does not increase at sample {k}",
                where=self.name,
                value=float(self.time_s[k]),
                allowed=f"more than {float(self.time_s[k - 1])!r}",
            )

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.n_samples} samples in {self.duration_s:g} s, every {self.sample_period_s:g} s"]
        for field_name in _ARRAY_FIELDS[1:]:
            values = getattr(self, field_name)
            if values is not None:
                lines.append(f"{field_name} {values.min():.5g} to {values.max():.5g}")
        return "\n".join(lines)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.time_s.size)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def sample_period_s(self) -> float:
        """Median step [s]."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def steps_s(self) -> NDArray[np.float64]:
        """Step that leads to each sample [s], shape (n_samples,); the first is the median step.

        The convention of the whole package: before the first sample the drive rose linearly, over one
        step, from the state the actuator was in.
        """
        steps = np.empty(self.n_samples)
        steps[1:] = np.diff(self.time_s)
        # Times written with few decimals jitter in their last digit; a record that is uniform but for
        # that is treated as uniform, so that step-dependent coefficients are computed once.
        median = float(np.median(steps[1:]))
        if np.all(np.abs(steps[1:] - median) <= 1e-6 * median + 4e-16 * abs(float(self.time_s[-1]))):
            steps[1:] = self.duration_s / (self.n_samples - 1)
        steps[0] = median
        return steps

    @property
    def valid_samples(self) -> NDArray[np.bool_]:
        """Samples whose displacement counts, a new array of shape (n_samples,)."""
        return np.ones(self.n_samples, dtype=np.bool_) if self.is_valid is None else self.is_valid.copy()

    @property
    def measured_um(self) -> NDArray[np.float64]:
        """Measured displacement [um]; raises RecordingError where it was not recorded."""
        if self.displacement_um is None:
            raise RecordingError("no displacement recorded", where=self.name, allowed="a column displacement_um")
        return self.displacement_um

    @classmethod
    def from_table(cls, table: Any, name: str = "recording") -> Recording:
        """Return the recording in a pandas DataFrame, an xarray Dataset or any mapping of columns.

        Args:
            table: columns by the names of the fields, ``time_s``, ``voltage_v`` and so on, shape (n_samples,) each; the
                index of a DataFrame or Dataset may be ``time_s``.
            name: what to call the record in messages.

        Raises:
            RecordingError: no column time_s or voltage_v, or columns that are no recording.
        """
        columns = {str(key): table[key] for key in table}
        # neither a DataFrame nor a Dataset lists its index among its columns
        for index in (getattr(table, "index", None), getattr(table, "coords", {}).get("time_s")):
            if getattr(index, "name", None) == "time_s":
                columns.setdefault("time_s", index)
        missing = [field for field in _ARRAY_FIELDS[:2] if field not in columns]
        if missing:
            raise RecordingError(
                f"no column {missing[0]}",
                where=name,
                value=", ".join(columns),
                allowed="time_s, voltage_v and, where measured, displacement_um",
            )
        return cls(**{field: columns[field] for field in _ARRAY_FIELDS if field in columns}, name=name)

    def to_dataframe(self) -> DataFrame:
        """Return what was recorded as a pandas DataFrame, a column for each field; pandas has to be there."""
        from pandas import DataFrame

        held = {field: getattr(self, field) for field in _ARRAY_FIELDS}
        return DataFrame({field: values for field, values in held.items() if values is not None})

    def window(self, start_s: float, stop_s: float) -> Recording:
        """Return the part with ``start_s <= time_s < stop_s``."""
        inside = (self.time_s >= start_s) & (self.time_s < stop_s)
        if np.count_nonzero(inside) < 2:
            raise RecordingError(
                "window holds fewer than 2 samples",
                where=self.name,
                value=(start_s, stop_s),
                allowed=f"within {self.time_s[0]:g}..{self.time_s[-1]:g} s",
            )
        cut = {
            field.name: getattr(self, field.name)[inside]
            for field in fields(self)
            if field.name in _ARRAY_FIELDS and getattr(self, field.name) is not None
        }
        if self.is_valid is not None:
            return replace(self, is_valid=self.is_valid[inside], **cut)
        return replace(self, **cut)


def _checked_mask(values: object, n_samples: int, where: str) -> NDArray[np.bool_]:
    mask = np.array(values)
    if mask.dtype != np.bool_ or mask.shape != (n_samples,):
        raise RecordingError(
            "is_valid does not say of each sample whether it counts",
            where=where,
            value=(str(mask.dtype), mask.shape),
            allowed=f"bool, shape ({n_samples},)",
        )
    mask.flags.writeable = False
    return mask


def _is_frozen(values: object) -> bool:
    """Return whether an array is of our type and nobody can change it: it need not be copied."""
    is_array = isinstance(values, np.ndarray) and values.dtype == np.float64
    return is_array and isinstance(values, np.ndarray) and not values.flags.writeable and values.flags.owndata


def _checked_column(values: object, field_name: str, where: str) -> NDArray[np.float64]:
    try:
        column = values if _is_frozen(values) else np.array(values, dtype=np.float64)
        assert isinstance(column, np.ndarray)
    except (TypeError, ValueError):
        raise RecordingError(f"{field_name} is not numeric", where=where, allowed="finite numbers") from None
    if column.ndim != 1:
        raise RecordingError(
            f"{field_name} is not one-dimensional", where=where, value=column.shape, allowed="shape (n_samples,)"
        )
    if not np.all(np.isfinite(column)):
        k = int(np.argmin(np.isfinite(column)))
        raise RecordingError(
            f"{field_name} is not finite at sample {k}", where=where, value=float(column[k]), allowed="finite numbers"
        )
    if column.size and float(np.max(np.abs(column))) > _LARGEST:
        k = int(np.argmax(np.abs(column)))
        raise RecordingError(
            f"{field_name} is too large at sample {k}",
            where=where,
            value=float(column[k]),
            allowed=f"up to {_LARGEST:g} of either sign",
        )
    column.flags.writeable = False
    return column
