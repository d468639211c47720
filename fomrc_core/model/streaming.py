"""Simulate or invert a stream longer than memory: chunk after chunk, the state carried from one to the next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState

Array = NDArray[np.float64]

SAMPLES_PER_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False)
class Chunk:
    """Consecutive samples of a stream, arrays of shape (n_samples,).

    Attributes:
        steps_s: step that leads to each sample [s], the first one from the last sample of the chunk before.
        values: drive [V] of a model, desired displacement [um] of a compensator.
        temperature_c: temperature [degC], for effects that use it.
        cross: second axis, for effects that use it.
    """

    steps_s: Array
    values: Array
    temperature_c: Array | None = None
    cross: Array | None = None


def stream(
    runner: PiezoModel | Compensator, chunks: Iterable[Chunk], state: ModelState | None = None
) -> Iterator[Array]:
    """Yield the output of each chunk as it comes, shape of the chunk; equal to one batch to rounding.

    Args:
        runner: model: voltage [V] in, displacement [um] out; compensator: the other way.
        chunks: the stream; only one chunk is held at a time.
        state: moves on where given; else the initial state is used.

    Raises:
        ParameterError: a chunk with values that are not finite, steps not positive, or unequal lengths.
    """
    state = runner.initial_state() if state is None else state
    run = runner.simulate if isinstance(runner, PiezoModel) else runner.run
    for chunk in chunks:
        yield run(chunk.steps_s, chunk.values, state, temperature_c=chunk.temperature_c, cross=chunk.cross)


def in_chunks(steps_s: Array, values: Array, *, n_samples: int = SAMPLES_PER_CHUNK) -> Iterator[Chunk]:
    """Yield a pair of arrays, which may be memory-mapped files, as chunks of up to ``n_samples``."""
    if n_samples < 1:
        raise ParameterError("chunk is empty", where="n_samples", value=n_samples, allowed="1 or more")
    if steps_s.shape != values.shape:
        raise ParameterError(
            "steps_s and values do not fit",
            where="values",
            value=(steps_s.shape, values.shape),
            allowed="two arrays of one shape (n_samples,)",
        )
    for start in range(0, values.size, n_samples):
        part = slice(start, start + n_samples)
        yield Chunk(np.array(steps_s[part], dtype=np.float64), np.array(values[part], dtype=np.float64))
