"""Models as YAML: one format for the command line and for ROS parameter files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import yaml

from fomrc_core.errors import ParameterError, StorageError
from fomrc_core.storage.atomic import read_text, write_text
from fomrc_core.storage.plain_yaml import load_yaml

if TYPE_CHECKING:
    from fomrc_core.model.piezo_model import PiezoModel

_N_BYTES_MAX = 1 << 18
_NESTING = "'/**: ros__parameters: model:'"
FIT_ERROR = "fit_rms_um"


def read_model(path: str | os.PathLike[str]) -> PiezoModel:
    """Read a model from a ROS parameter file: ``/**: ros__parameters: model: ...``.

    Other parameters in the file are ignored, and so is the fit's error beside the model. A file for one node
    (``/axis1/compensator:`` in place of ``/**:``) is read as well where it is the only one with a model.

    Raises:
        StorageError: not readable, not plain YAML, or nested otherwise.
        ParameterError: a value of the model outside what is allowed.
    """
    from fomrc_core.model.piezo_model import PiezoModel  # slow to import; who reads other files needs none

    where = os.fspath(path)
    content = load_yaml(read_text(path, n_bytes_max=_N_BYTES_MAX), where)
    block = model_block(content, where)
    try:
        return PiezoModel.from_mapping({key: value for key, value in block.items() if key != FIT_ERROR}, "model")
    except ParameterError as error:
        raise ParameterError(
            error.what, where=f"{where}, {error.where}", value=error.value, allowed=error.allowed
        ) from None


def read_fit_error(path: str | os.PathLike[str]) -> float:
    """Return the error of the fit a model file's model came from [um], 0 where the file does not say.

    Raises:
        StorageError: not readable, not plain YAML, or nested otherwise.
        ParameterError: it is no number, or less than 0.
    """
    where = os.fspath(path)
    value = model_block(load_yaml(read_text(path, n_bytes_max=_N_BYTES_MAX), where), where).get(FIT_ERROR, 0.0)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < float("inf"):
        raise ParameterError("not an error", where=f"{where}, model.{FIT_ERROR}", value=value, allowed=">= 0, in um")
    return float(value)


def write_model(model: PiezoModel, path: str | os.PathLike[str], fit_rms_um: float | None = None) -> None:
    """Write a model as a ROS parameter file that reads back bit for bit.

    Args:
        model: what to write.
        path: where to.
        fit_rms_um: error of the fit it came from [um], for those who run it to see.

    Raises:
        StorageError: the file cannot be written.
    """
    content = model_to_parameters(model)
    if fit_rms_um is not None:
        content["/**"]["ros__parameters"]["model"][FIT_ERROR] = float(fit_rms_um)
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110)
    write_text(text, path)


def model_to_parameters(model: PiezoModel) -> dict[str, Any]:
    """Return a model nested as in a ROS parameter file, of dictionaries, lists, strings and floats only."""
    # ROS cannot tell the type of an empty list in a parameter file, and refuses it.
    block = {key: value for key, value in model.to_mapping().items() if value not in ([], ())}
    return {"/**": {"ros__parameters": {"model": block}}}


def model_block(content: Any, where: str) -> dict[str, Any]:
    """Return the ``model`` block of a parameter file's content; StorageError where there is none, or several."""
    if content is None:
        raise StorageError("empty file", where=where, allowed=_NESTING)
    if not isinstance(content, dict):
        raise StorageError("not a parameter file", where=where, value=content, allowed=_NESTING)
    blocks: dict[str, Any] = {}
    for node, block in content.items():
        parameters = _expanded(block.get("ros__parameters"), where) if isinstance(block, dict) else None
        if isinstance(parameters, dict) and "model" in parameters:
            blocks[str(node)] = parameters["model"]
    if "/**" in blocks:
        chosen = blocks["/**"]
    elif len(blocks) == 1:
        chosen = next(iter(blocks.values()))
    elif blocks:
        raise StorageError("several nodes have a model", where=where, value=sorted(blocks), allowed="one")
    else:
        raise StorageError("no model in the file", where=where, value=[str(key) for key in content], allowed=_NESTING)
    if not isinstance(chosen, dict):
        raise StorageError(
            "not a block of parameters",
            where=f"{where}, model",
            value=type(chosen).__name__,
            allowed="kappa_um_per_v, saturation_v, creep_order, ...",
        )
    return chosen


def _expanded(parameters: Any, where: str) -> Any:
    """Nest parameters written with dots (``model.creep_order: 0.015``), as ROS does."""
    if not isinstance(parameters, dict):
        return parameters
    nested: dict[str, Any] = {}
    for name, value in parameters.items():
        *groups, last = str(name).split(".")
        block = nested
        for group in groups:
            block = block.setdefault(group, {})
            if not isinstance(block, dict):
                raise StorageError(f"{group!r} is both a value and a group", where=where, value=name)
        value = _expanded(value, where)
        if isinstance(value, dict) and isinstance(block.get(last), dict):
            block[last].update(value)
        else:
            block[last] = value
    return nested
