"""Hysteresis and creep together, forward (20)-(26) and inverse (section 4.3), by the step and by the batch.

One packed state: the hysteresis block at 0, the creep block at ``at_creep``. Without numba the batches and the
steps of a model go through ``PlainKernels``, which agrees to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled_or, compiled_sums
from fomrc_core.model.plain_kernels import PlainKernels
from fomrc_core.operators.creep import differentiate_step, integrate_step
from fomrc_core.operators.creep_batch import differentiate, integrate, integrate_parts
from fomrc_core.operators.hysteresis import (
    move_plays,
    move_plays_at_once,
    move_plays_batch,
    move_stops,
    move_stops_batch,
    move_widened_plays_batch,
)

Array = NDArray[np.float64]

BLOCK = 4096  # samples between the two operators that stay in the cache


@compiled_sums
def forward_step(packed: Array, at_creep: int, voltage_v: float, step_s: float) -> float:
    """Return the displacement [um] after one step; play form at 0. NaN, and no step, for input that is not fit."""
    if not (0.0 < step_s < np.inf and abs(voltage_v) < np.inf):
        return np.nan
    return integrate_step(packed, at_creep, move_plays(packed, 0, voltage_v), step_s)


@compiled_sums
def inverse_step(packed: Array, at_creep: int, desired_um: float, step_s: float) -> float:
    """Return the voltage [V] after one step; stop form at 0. NaN, and no step, for input that is not fit."""
    if not (0.0 < step_s < np.inf and abs(desired_um) < np.inf):
        return np.nan
    return move_stops(packed, 0, differentiate_step(packed, at_creep, desired_um, step_s))


def _forward_plain(packed: Array, at_creep: int, voltage_v: Array, steps_s: Array, out: Array) -> None:
    step = PlainKernels(packed, at_creep).forward
    out[:] = [step(v, dt) for v, dt in zip(voltage_v.tolist(), steps_s.tolist(), strict=True)]


def _forward_beside_plain(
    packed: Array, at_creep: int, voltage_v: Array, beside_um: Array, steps_s: Array, out: Array
) -> None:
    step = PlainKernels(packed, at_creep).forward
    rows = zip(voltage_v.tolist(), steps_s.tolist(), beside_um.tolist(), strict=True)
    out[:] = [step(v, dt, added) for v, dt, added in rows]


def _forward_parts_plain(
    packed: Array, at_creep: int, voltage_v: Array, widening: Array, beside_um: Array, steps_s: Array, out: Array
) -> None:
    # Many arguments: those of forward_parts, in whose place it stands without numba.
    beside_um = beside_um if beside_um.size else np.zeros(voltage_v.size)
    if not widening.size:
        _forward_beside_plain(packed, at_creep, voltage_v, beside_um, steps_s, out)
        return
    forward_widened(packed, at_creep, voltage_v, widening, beside_um, steps_s, out)


def _inverse_plain(packed: Array, at_creep: int, desired_um: Array, steps_s: Array, out: Array) -> None:
    step = PlainKernels(packed, at_creep).inverse
    out[:] = [step(x, dt) for x, dt in zip(desired_um.tolist(), steps_s.tolist(), strict=True)]


@compiled_or(_forward_plain)
def forward(packed: Array, at_creep: int, voltage_v: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with the displacement [um] of each sample, shape (n_samples,); play form at 0."""
    for start in range(0, voltage_v.size, BLOCK):
        stop = min(start + BLOCK, voltage_v.size)
        moved = out[start:stop]
        move_plays_batch(packed, 0, voltage_v[start:stop], moved)
        integrate(packed, at_creep, moved, steps_s[start:stop], moved)


@compiled_or(_forward_beside_plain)
def forward_beside(
    packed: Array, at_creep: int, voltage_v: Array, beside_um: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the displacement [um] where something acts beside the elements, (n_samples,)."""
    for start in range(0, voltage_v.size, BLOCK):
        stop = min(start + BLOCK, voltage_v.size)
        moved = out[start:stop]
        move_plays_batch(packed, 0, voltage_v[start:stop], moved)
        moved += beside_um[start:stop]
        integrate(packed, at_creep, moved, steps_s[start:stop], moved)


@compiled_sums
def forward_widened(
    packed: Array, at_creep: int, voltage_v: Array, widening: Array, beside_um: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the displacement [um] where thresholds widen by a factor of each sample, (n_samples,)."""
    move_widened_plays_batch(packed, 0, voltage_v, widening, out)
    out += beside_um
    integrate(packed, at_creep, out, steps_s, out)


@compiled_or(_forward_parts_plain)
def forward_parts(
    packed: Array, at_creep: int, voltage_v: Array, widening: Array, beside_um: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the displacement [um] of each part of divided steps, to rounding, shape (n_parts,).

    Factors of the thresholds and what acts beside the elements [um] are of no size where there are none.
    """
    for start in range(0, voltage_v.size, BLOCK):
        stop = min(start + BLOCK, voltage_v.size)
        moved = out[start:stop]
        move_plays_at_once(packed, 0, voltage_v[start:stop], widening[start:stop], moved)
        if beside_um.size:
            moved += beside_um[start:stop]
        integrate_parts(packed, at_creep, moved, steps_s[start:stop], moved)


@compiled_or(_inverse_plain)
def inverse(packed: Array, at_creep: int, desired_um: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with the voltage [V] for each sample, shape (n_samples,); stop form at 0."""
    for start in range(0, desired_um.size, BLOCK):
        stop = min(start + BLOCK, desired_um.size)
        moved = out[start:stop]
        differentiate(packed, at_creep, desired_um[start:stop], steps_s[start:stop], moved)
        move_stops_batch(packed, 0, moved, moved)
