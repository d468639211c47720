"""A model whose sensors see mixtures of its outputs, or whose drives act as mixtures of its inputs: all linear."""

from __future__ import annotations

from dataclasses import replace

from fomrc_core.compute.arrays import Array
from fomrc_core.model.axes import AxesModel


def outputs_mixed(model: AxesModel, mix: Array) -> AxesModel:
    """Return the model with displacements mix @ displacements, mix of shape (n_outputs, n_outputs)."""
    modes = model.modes
    if modes is not None:
        modes = replace(modes, output_shape=modes.output_shape @ mix.T)
    return replace(model, modes=modes, coupling=mix @ model.static)


def inputs_mixed(model: AxesModel, mix: Array) -> AxesModel:
    """Return the model whose axes act as mix @ axes' displacements, mix of shape (n_inputs, n_inputs)."""
    modes = model.modes
    if modes is not None:
        modes = replace(modes, input_shape=modes.input_shape @ mix)
    return replace(model, modes=modes, coupling=model.static @ mix)
