"""Classical Preisach operator with a density constant in each cell of the half-plane, and its inverse.

    x(t) = sum over cells of  weight * (share of the cell's relays switched up)

I. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991; discretised as in R. Iyer and X. Tan,
Control of hysteretic systems through inverse compensation, IEEE Control Systems 29 (2009) 83-99. The share
of each cell is taken exactly, so the output is continuous and the inverse is found by bisection of a
monotone function.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines.cascade_rival import HysteresisFamily, HysteresisOperator
from fomrc_core.comparison.baselines.rival import TrainingRecord
from fomrc_core.compute.compiled import compiled

Array = NDArray[np.float64]


@compiled
def share_of(share_up: float, share_down: float, is_diagonal: bool) -> float:
    """Return the share of a cell below alpha (``share_up`` of its height) and above beta (``share_down``)."""
    if is_diagonal:
        return max(0.0, share_up + share_down - 1.0) ** 2
    return share_up * share_down


@compiled
def triangle(high: float, low: float, n_levels: int, row: Array, sign: float) -> None:
    """Add to ``row`` the share of every cell with alpha <= high and beta >= low, in cells."""
    at = 0
    for i in range(n_levels):
        share_up = min(max(high - i, 0.0), 1.0)
        for j in range(i + 1):
            if share_up > 0.0:
                share_down = min(max(j + 1.0 - low, 0.0), 1.0)
                row[at] += sign * share_of(share_up, share_down, i == j)
            at += 1


@compiled
def weighted_triangle(high: float, low: float, n_levels: int, weights: Array) -> float:
    """Return the weighted share of all cells with alpha <= high and beta >= low."""
    total = 0.0
    for i in range(int(max(low, 0.0)), min(n_levels, int(np.ceil(high)))):
        share_up = min(max(high - i, 0.0), 1.0)
        at = i * (i + 1) // 2
        for j in range(int(max(low, 0.0)), i + 1):
            share_down = min(max(j + 1.0 - low, 0.0), 1.0)
            total += weights[at + j] * share_of(share_up, share_down, i == j)
    return total


@compiled
def wiped(vertices: Array, depth: int, value: float) -> int:
    """Return where on the stack of turning points the value belongs, smaller loops wiped out.

    Vertex 0 is negative saturation; odd ones are maxima, even ones minima; the last is the present input.
    """
    top = vertices[depth]
    if value == top:
        return depth
    rising = value > top
    if (depth % 2 == 1) != rising:
        depth += 1  # a new turning point
    while depth >= 2 and ((rising and value >= vertices[depth - 2]) or (not rising and value <= vertices[depth - 2])):
        depth -= 2
    return depth


@compiled
def shares(values: Array, n_levels: int, vertices: Array, partial: Array, start: int, out: Array) -> None:
    """Fill ``out`` with the share of each cell that is up, shape (n_samples, n_cells)."""
    depth = start
    for k in range(values.size):
        depth = wiped(vertices, depth, values[k])
        vertices[depth] = values[k]
        if depth > 0:
            partial[depth] = partial[depth - 1]
            if depth % 2 == 1:
                triangle(vertices[depth], vertices[depth - 1], n_levels, partial[depth], 1.0)
            else:
                triangle(vertices[depth - 1], vertices[depth], n_levels, partial[depth], -1.0)
        out[k] = partial[depth]


@compiled
def output_at(vertices: Array, sums: Array, depth: int, value: float, n_levels: int, weights: Array) -> float:
    """Return the weighted output the value would give at this place on the stack."""
    if depth == 0:
        return 0.0
    output: float = sums[depth - 1]
    if depth % 2 == 1:
        output += weighted_triangle(value, vertices[depth - 1], n_levels, weights)
    else:
        output -= weighted_triangle(vertices[depth - 1], value, n_levels, weights)
    return output


@compiled
def follow(
    wanted: Array, is_inverse: bool, n_levels: int, weights: Array, vertices: Array, sums: Array, start: int, out: Array
) -> None:
    """Fill ``out`` with the output for each input, or with the input for each wanted output."""
    depth = start
    for k in range(wanted.size):
        value = wanted[k]
        if is_inverse:
            low, high = 0.0, float(n_levels)
            for _ in range(60):
                value = 0.5 * (low + high)
                place = wiped(vertices, depth, value)
                if output_at(vertices, sums, place, value, n_levels, weights) < wanted[k]:
                    low = value
                else:
                    high = value
        depth = wiped(vertices, depth, value)
        sums[depth] = output_at(vertices, sums, depth, value, n_levels, weights)
        vertices[depth] = value
        out[k] = value if is_inverse else sums[depth]


@dataclass(frozen=True, eq=False)
class PreisachOperator(HysteresisOperator):
    """A Preisach operator with its density known.

    Args:
        low_v: lowest voltage of the half-plane [V].
        cell_v: size of a cell [V].
        n_levels: cells along an axis.
        weights: displacement per cell [um], shape (n_levels (n_levels + 1) / 2,).
    """

    low_v: float
    cell_v: float
    n_levels: int
    weights: Array

    @property
    def n_parameters(self) -> int:
        """Number of cells with a density."""
        return int(np.count_nonzero(self.weights))

    def _relaxed(self, n_samples: int) -> tuple[Array, Array, int]:
        first = relaxed_vertices(self.n_levels, self.low_v, self.cell_v)
        vertices = np.zeros(first.size + n_samples + 2)
        vertices[: first.size] = first
        sums = np.zeros(vertices.size)
        for depth in range(1, first.size):
            sums[depth] = output_at(vertices, sums, depth, vertices[depth], self.n_levels, self.weights)
        return vertices, sums, first.size - 1

    def _follow(self, values: Array, is_inverse: bool) -> Array:
        vertices, sums, depth = self._relaxed(values.size)
        out = np.empty(values.size)
        follow(values, is_inverse, self.n_levels, self.weights, vertices, sums, depth, out)
        return out

    def forward(self, voltage_v: Array) -> Array:
        """Return the displacement [um] above negative saturation, shape (n_samples,)."""
        values = (np.asarray(voltage_v) - self.low_v) / self.cell_v
        return self._follow(np.clip(values, 0.0, self.n_levels), False)

    def inverse(self, desired_um: Array) -> Array:
        """Return the voltage [V], shape (n_samples,); at its limit where the displacement is out of reach."""
        values = np.ascontiguousarray(desired_um, dtype=np.float64)
        return self.low_v + self.cell_v * self._follow(values, True)


@dataclass(frozen=True)
class Preisach(HysteresisFamily):
    """The classical operator.

    Args:
        n_levels: cells along an axis; n (n + 1) / 2 weights.
        low_v: lowest voltage [V]; set by ``scaled_to``.
        high_v: highest voltage [V]; set by ``scaled_to``.
    """

    n_levels: int = 20
    low_v: float = -1.0
    high_v: float = 1.0
    name: str = field(default="Preisach", init=False)
    publication: str = field(default="Mayergoyz 1991; Iyer and Tan 2009", init=False)

    def scaled_to(self, records: Sequence[TrainingRecord]) -> Preisach:
        """Return the family over the voltages of the records, 0 V and a margin of 2 %."""
        low = min(0.0, *(float(r.voltage_v.min()) for r in records))
        high = max(0.0, *(float(r.voltage_v.max()) for r in records))
        margin = 0.02 * (high - low)
        return Preisach(self.n_levels, low - margin, high + margin)

    def columns(self, voltage_v: Array) -> Array:
        """Return the share of each cell that is up, shape (n_samples, n_cells)."""
        cell = (self.high_v - self.low_v) / self.n_levels
        first = relaxed_vertices(self.n_levels, self.low_v, cell)
        values = np.clip((np.asarray(voltage_v) - self.low_v) / cell, 0.0, self.n_levels)
        deepest = first.size + _deepest(values)
        vertices = np.zeros(deepest)
        n_cells = self.n_levels * (self.n_levels + 1) // 2
        partial = np.zeros((deepest, n_cells))
        shares(first[1:], self.n_levels, vertices, partial, 0, np.empty((first.size - 1, n_cells)))
        out = np.empty((values.size, n_cells))
        shares(values, self.n_levels, vertices, partial, first.size - 1, out)
        return out

    def operator(self, weights: Array) -> PreisachOperator:
        """Return the operator with these cell weights."""
        cell = (self.high_v - self.low_v) / self.n_levels
        return PreisachOperator(self.low_v, cell, self.n_levels, np.ascontiguousarray(weights))


def relaxed_vertices(n_levels: int, low_v: float, cell_v: float) -> Array:
    """Return the turning points [cells] of an alternating voltage that fades to 0 V."""
    zero = -low_v / cell_v
    reach = max(zero, n_levels - zero)
    swings = np.linspace(reach, 0.0, 4 * n_levels + 1)[:-1]
    turns = zero + swings * np.where(np.arange(swings.size) % 2 == 0, 1.0, -1.0)
    turns = np.clip(turns, 0.0, n_levels)
    vertices = np.zeros(turns.size + 2)
    depth = 0
    for value in [*turns, zero]:
        depth = wiped(vertices, depth, value)
        vertices[depth] = value
    kept: Array = vertices[: depth + 1].copy()
    return kept


def _deepest(values: Array) -> int:
    """Return a bound on the number of turning points a stack must hold."""
    moves = np.sign(np.diff(values))
    moves = moves[moves != 0.0]
    return int(np.count_nonzero(moves[1:] != moves[:-1])) + 4
