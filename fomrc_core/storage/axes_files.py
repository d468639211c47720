"""Recordings of several axes (CSV, npz or rosbag2) and models of several axes (YAML, an ``axes:`` block)."""

from __future__ import annotations

import os
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError, StorageError
from fomrc_core.model.axes import AxesModel, AxesModes, LevelLaw, RateRelay
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage.atomic import read_text, write_text
from fomrc_core.storage.axes_bags import axes_columns_of_bag, is_axes_bag
from fomrc_core.storage.bags import is_bag
from fomrc_core.storage.model_files import model_block
from fomrc_core.storage.plain_yaml import load_yaml
from fomrc_core.storage.tables import TextTable

Array = NDArray[np.float64]

_FIT_ERROR = "fit_error"
_N_BYTES_MAX = 2**31
_N_MODEL_BYTES_MAX = 1 << 20
_N_HEADER = 1 << 14  # of a first line that names columns
_COLUMN = re.compile(r"(voltage|displacement)_(\d+)_(v|um)$")
_MODE_LISTS = ("softening", "softening_squared", "damping_change", "gain_change")


@dataclass(frozen=True, eq=False)
class AxesRecording:
    """A record of several axes, its periods one after another.

    Attributes:
        name: to tell it by.
        rate_hz: sample rate [Hz].
        voltage_v: (n_samples, n_inputs, n_periods) [V].
        displacement_um: (n_samples, n_outputs, n_periods) [um].
    """

    name: str
    rate_hz: float
    voltage_v: Array
    displacement_um: Array


def read_axes_recording(path: str | os.PathLike[str], n_periods: int | None = None) -> AxesRecording:
    """Read columns ``time_s, voltage_1_v ..., displacement_1_um ...`` [, ``period``] of a CSV, npz or rosbag2.

    Args:
        path: the file, or the folder of a rosbag2 (see ``axes_bags.axes_columns_of_bag``).
        n_periods: in the file; from its column ``period`` if left out.

    Raises:
        StorageError: whatever is wrong with the file, in one line.
    """
    where = os.fspath(path)
    if is_bag(where):
        columns = axes_columns_of_bag(where)
    else:
        columns = _npz(where) if where.endswith(".npz") else _csv(where)
    if "time_s" not in columns:
        raise StorageError("no column time_s", where=where, value=",".join(columns), allowed="time_s, voltage_1_v, ...")
    inputs, outputs = _numbered(columns, "voltage", where), _numbered(columns, "displacement", where)
    time = columns["time_s"]
    steps = np.diff(time)
    if time.size < 4 or np.any(steps <= 0.0) or np.ptp(steps) > 1e-3 * float(np.mean(steps)):
        raise StorageError("time is not one rate, ascending", where=where, allowed="equal steps of time_s")
    if n_periods is None:
        if "period" not in columns:
            raise StorageError("number of periods not known", where=where, allowed="a column period, or --periods")
        n_periods = int(np.unique(columns["period"]).size)
    if n_periods < 1 or time.size % n_periods:
        raise StorageError("rows do not divide into periods", where=where, value=time.size, allowed=f"{n_periods} k")
    shape = (n_periods, -1)

    def folded(names: list[str]) -> Array:
        return np.stack([columns[name].reshape(shape).T for name in names], axis=1)

    return AxesRecording(Path(where).name, 1.0 / float(np.mean(steps)), folded(inputs), folded(outputs))


def is_axes_recording(path: str | os.PathLike[str]) -> bool:
    """Return whether a record is one of several axes, by its columns or topics; False for what cannot be read."""
    where = os.fspath(path)
    if is_bag(where):
        return is_axes_bag(where)
    try:
        if where.endswith(".npz"):
            names = list(_npz(where))
        else:
            with open(where, encoding="utf-8", errors="replace") as file:
                names = file.readline(_N_HEADER).lower().replace(" ", "").strip().split(",")
    except (OSError, StorageError):
        return False
    return any(_COLUMN.match(name) for name in names)


def read_axes_target(path: str | os.PathLike[str], n_axes: int) -> tuple[Array, Array]:
    """Read times [s] and desired displacements [um], (n_samples, n_axes), of columns ``time_s, desired_1_um, ...``.

    Args:
        path: a CSV file.
        n_axes: how many displacements there are.

    Raises:
        StorageError: whatever is wrong with the file, in one line.
    """
    where = os.fspath(path)
    columns = _csv(where)
    names = [f"desired_{k + 1}_um" for k in range(n_axes)]
    for name in ("time_s", *names):
        if name not in columns:
            raise StorageError(
                f"no column {name}", where=where, value=",".join(columns), allowed="time_s, " + names[-1]
            )
    time_s = columns["time_s"]
    if time_s.size < 2 or np.any(np.diff(time_s) <= 0.0):
        raise StorageError(
            "time does not rise", where=where, value=time_s.size, allowed="2 or more rows, time_s rising"
        )
    return time_s, np.stack([columns[name] for name in names], axis=1)


def _numbered(columns: dict[str, Array], what: str, where: str) -> list[str]:
    found = {int(match[2]): name for name in columns if (match := _COLUMN.match(name)) and match[1] == what}
    unit = "v" if what == "voltage" else "um"
    if sorted(found) != list(range(1, len(found) + 1)) or not found:
        raise StorageError(
            f"{what} columns are not numbered from 1",
            where=where,
            value=[found[k] for k in sorted(found)],
            allowed=f"{what}_1_{unit}, {what}_2_{unit}, ...",
        )
    return [found[k] for k in sorted(found)]


def _csv(where: str) -> dict[str, Array]:
    table = TextTable.of_text(read_text(where, n_bytes_max=_N_BYTES_MAX), where)
    header = [cell.lower() for cell in table.cells(0)]
    numbers = table.without_first().numbers(list(range(len(header))), header)
    if numbers.shape[1] != len(header):
        numbers = numbers.T
    return {name: numbers[:, k] for k, name in enumerate(header)}


def _npz(where: str) -> dict[str, Array]:
    try:
        with np.load(where, allow_pickle=False) as found:
            columns = {name.lower(): np.asarray(found[name], dtype=np.float64).ravel() for name in found.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise StorageError(f"not a readable npz file ({error})", where=where) from None
    if len({values.size for values in columns.values()}) != 1:
        raise StorageError("columns of different lengths", where=where, value=sorted(columns))
    return columns


def write_axes_model(model: AxesModel, path: str | os.PathLike[str], fit_error: float | None = None) -> None:
    """Write a model of several axes as a ROS parameter file that reads back bit for bit.

    Args:
        model: what to write.
        path: where to.
        fit_error: what the fit it came from left of the displacements' rms in its worst record [1].

    Raises:
        StorageError: the file cannot be written.
    """
    block: dict[str, Any] = {"axes": axes_mapping(model)}
    if fit_error is not None:
        block[_FIT_ERROR] = float(fit_error)
    content = {"/**": {"ros__parameters": {"model": block}}}
    write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110), path)


def axes_mapping(model: AxesModel) -> dict[str, Any]:
    """Return the ``axes:`` block: numbers, flat lists (matrices row by row) and a block for each axis."""
    block: dict[str, Any] = {"n_inputs": model.n_inputs, "n_outputs": model.n_outputs}
    for i, axis in enumerate(model.axes):
        own = {key: value for key, value in axis.to_mapping().items() if value not in ([], ())}
        block[f"axis_{i + 1}"] = own
    block["delay_s"] = float(model.delay_s)
    if model.coupling is not None:
        block["coupling_um_per_um"] = model.coupling.ravel().tolist()
        block["coupling_change"] = float(model.coupling_change)
    if model.level is not None:
        block["level_reference_v"] = float(model.level.reference_v)
        block["level_exponent"] = float(model.level.exponent)
        block["level_memory_s"] = float(model.level.memory_s)
    if model.modes is not None:
        modes = model.modes
        block["mode_frequency_hz"] = modes.frequency_hz.tolist()
        block["mode_damping"] = modes.damping.tolist()
        for name, values in zip(_MODE_LISTS, modes.changes, strict=True):
            block[f"mode_{name}"] = values.tolist()
        for name in ("output_shape", "input_shape"):
            shape = getattr(modes, name)
            block[f"mode_{name}_re"], block[f"mode_{name}_im"] = (
                shape.real.ravel().tolist(),
                shape.imag.ravel().tolist(),
            )
    if model.joints is not None:
        block["joint_shapes"] = model.joints.ravel().tolist()
    if model.rate_relay is not None:
        block["rate_relay_scale_v_per_s"] = float(model.rate_relay.scale_v_per_s)
        block["rate_relay_prompt_um"] = model.rate_relay.prompt_um.tolist()
        block["rate_relay_late_um"] = model.rate_relay.late_um.tolist()
    return block


def read_axes_model(path: str | os.PathLike[str]) -> AxesModel:
    """Read a model of several axes.

    Raises:
        StorageError: not readable, not plain YAML, or without an ``axes:`` block.
        ParameterError: a value of the model outside what is allowed.
    """
    where = os.fspath(path)
    block = model_block(load_yaml(read_text(where, n_bytes_max=_N_MODEL_BYTES_MAX), where), where)
    if not isinstance(block.get("axes"), dict):
        raise StorageError("no model of several axes", where=where, value=list(block), allowed="a block axes")
    return axes_from_mapping(block["axes"], f"{where}, model.axes")


def is_axes_model(path: str | os.PathLike[str]) -> bool:
    """Return whether a model file is of several axes; False for what cannot be read as one."""
    where = os.fspath(path)
    try:
        return "axes" in model_block(load_yaml(read_text(where, n_bytes_max=_N_MODEL_BYTES_MAX), where), where)
    except StorageError:
        return False


def read_axes_fit_error(path: str | os.PathLike[str]) -> float:
    """Return what the fit of a model file's model left in its worst record [1], 0 where the file does not say.

    Raises:
        StorageError: not readable, or not plain YAML.
        ParameterError: it is no number, or less than 0.
    """
    where = os.fspath(path)
    value = model_block(load_yaml(read_text(where, n_bytes_max=_N_MODEL_BYTES_MAX), where), where).get(_FIT_ERROR, 0.0)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < float("inf"):
        raise ParameterError("not an error", where=f"{where}, model.{_FIT_ERROR}", value=value, allowed=">= 0")
    return float(value)


def axes_from_mapping(block: dict[str, Any], where: str = "model.axes") -> AxesModel:
    """Return the model of an ``axes:`` block; raises ParameterError naming key, value and what is allowed."""
    left = dict(block)

    def number(key: str, default: float | None = None) -> float:
        value = left.pop(key, default)
        if not isinstance(value, (int, float)) or isinstance(value, bool) or not np.isfinite(value):
            raise ParameterError("not a number", where=f"{where}.{key}", value=value, allowed="finite")
        return float(value)

    def matrix(key: str, n_columns: int) -> Array:
        if key not in left:
            raise ParameterError(f"{key} is missing", where=where, allowed=f"numbers, {n_columns} a row")
        value = left.pop(key)
        try:
            found = np.array(value, dtype=np.float64).reshape(-1, n_columns)
        except (TypeError, ValueError):
            raise ParameterError(
                "not a list of rows", where=f"{where}.{key}", value=value, allowed=f"numbers, {n_columns} a row"
            ) from None
        return found

    n_in, n_out = int(number("n_inputs")), int(number("n_outputs"))
    if not (1 <= n_in <= 64 and 1 <= n_out <= 64):
        raise ParameterError("number of axes out of range", where=where, value=(n_in, n_out), allowed="1 to 64")
    axes = tuple(PiezoModel.from_mapping(_own(left, i, where), f"{where}.axis_{i + 1}") for i in range(n_in))
    delay = number("delay_s", 0.0)
    coupling = matrix("coupling_um_per_um", n_in) if "coupling_um_per_um" in left else None
    change = number("coupling_change", 0.0)
    level = None
    if "level_reference_v" in left:
        level = LevelLaw(*(number(f"level_{name}") for name in ("reference_v", "exponent", "memory_s")))
    modes, joints = None, None
    if "mode_frequency_hz" in left:
        frequency = matrix("mode_frequency_hz", 1).ravel()
        damping = matrix("mode_damping", 1).ravel()
        output, inputs = (
            matrix(f"mode_{name}_re", n) + 1j * matrix(f"mode_{name}_im", n)
            for name, n in (("output_shape", n_out), ("input_shape", n_in))
        )
        changes = [matrix(f"mode_{name}", 1).ravel() for name in _MODE_LISTS if f"mode_{name}" in left]
        modes = AxesModes(frequency, damping, output, inputs, *changes)
        joints = matrix("joint_shapes", frequency.size) if "joint_shapes" in left else None
    relay = None
    if "rate_relay_scale_v_per_s" in left:
        scale = number("rate_relay_scale_v_per_s")
        relay = RateRelay(scale, *(matrix(f"rate_relay_{name}_um", 1).ravel() for name in ("prompt", "late")))
    if left:
        raise ParameterError("unknown key", where=where, value=next(iter(left)))
    return AxesModel(axes, modes, coupling, delay, level, change, joints, relay)


def _own(left: dict[str, Any], i: int, where: str) -> dict[str, Any]:
    own = left.pop(f"axis_{i + 1}", None)
    if not isinstance(own, dict):
        raise ParameterError("block of an axis is missing", where=f"{where}.axis_{i + 1}", value=own)
    return {"saturation_v": [], **own}
