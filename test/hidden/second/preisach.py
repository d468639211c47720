"""A Preisach plane with a discretised density: cells of relays, integrated exactly.

Densities as in the literature on magnets and piezos: a correlated Gaussian of the two switching voltages
(G. Bertotti, "Hysteresis in Magnetism", 1998) and a factorised Lorentzian (G. Friedman, 1990s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.second.everett import run_everett

N_CELLS = 64


@dataclass(frozen=True)
class PreisachPlane:
    """Relays that switch up at a and down at b <= a, of a density constant in each cell of a square grid.

    Args:
        slope_um_per_v: reversible part [um/V].
        edges_v: edges of the cells on either axis [V], evenly spaced, shape (n + 1,).
        content_um: what all relays of a cell come to [um], indexed by cell of a, then of b; shape (n, n), zero above
            the diagonal b = a, half a cell on it.
    """

    slope_um_per_v: float
    edges_v: np.ndarray
    content_um: np.ndarray

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0; shape (n_samples,)."""
        return self.slope_um_per_v * drive_v + run_everett(self.everett_um, drive_v)

    def everett_um(self, high_v: np.ndarray, low_v: np.ndarray) -> np.ndarray:
        """Return what relays with a <= high and b >= low come to [um]; exact for this density."""
        n, low_edge = self.content_um.shape[0], self.edges_v[0]
        cell = self.edges_v[1] - low_edge
        i, p = _cell_and_share(high_v, low_edge, cell, n)
        j, q = _cell_and_share(low_v, low_edge, cell, n)
        diagonal = np.diag(self.content_um)
        off = self.content_um - np.diag(diagonal)
        # Sums over cells a < i, b >= j: bilinear within a cell, as the density there is constant.
        sums = np.zeros((n + 1, n + 1))
        sums[1:, :-1] = np.cumsum(np.cumsum(off[:, ::-1], axis=1)[:, ::-1], axis=0)
        total = (1 - p) * ((1 - q) * sums[i, j] + q * sums[i, j + 1])
        total += p * ((1 - q) * sums[i + 1, j] + q * sums[i + 1, j + 1])
        # Triangles on the diagonal, whole ones between the two cells and a part of either.
        whole = np.concatenate([[0.0], np.cumsum(diagonal)])
        apart = whole[i] - whole[np.minimum(j + 1, n)] + diagonal[i] * p**2 + diagonal[j] * (1 - q) ** 2
        return total + np.where(i == j, diagonal[i] * (p - q) ** 2, apart)

    def switching(self, reach_v: float) -> PreisachPlane:
        """Return the part that creeps the more the wider the relay: content times half width over reach."""
        middles = 0.5 * (self.edges_v[1:] + self.edges_v[:-1])
        half_widths = 0.5 * np.abs(middles[:, None] - middles)
        return PreisachPlane(0.0, self.edges_v, self.content_um * half_widths / reach_v)


def _cell_and_share(values: np.ndarray, low_edge: float, cell: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    along = np.clip((values - low_edge) / cell, 0.0, n)
    index = np.minimum(along.astype(np.int64), n - 1)
    return index, along - index


def discretised(density: np.ndarray, switched_um: float, slope_um_per_v: float, edges_v: np.ndarray) -> PreisachPlane:
    """Return the plane of a density given at the cells' middles, scaled to what all relays come to [um]."""
    kept = np.tril(density)
    kept[np.diag_indices_from(kept)] *= 0.5
    return PreisachPlane(slope_um_per_v, edges_v, switched_um * kept / kept.sum())


def grid(reach_v: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return edges [V] of a grid over +- reach, and the switching voltages a and b of the cells' middles [V]."""
    edges_v = np.linspace(-reach_v, reach_v, N_CELLS + 1)
    middles = 0.5 * (edges_v[1:] + edges_v[:-1])
    up, down = np.meshgrid(middles, middles, indexing="ij")
    return edges_v, up, down


def gaussian_density(
    up: np.ndarray, down: np.ndarray, *, coercive_v: float, spread_v: float, correlation: float, bias_v: float = 0.0
) -> np.ndarray:
    """Return a bivariate normal density of the switching voltages, about (bias + coercive, bias - coercive)."""
    a, b = (up - bias_v - coercive_v) / spread_v, (down - bias_v + coercive_v) / spread_v
    form = (a**2 - 2.0 * correlation * a * b + b**2) / (1.0 - correlation**2)
    return np.exp(-0.5 * form)


def lorentzian_density(
    up: np.ndarray, down: np.ndarray, *, coercive_v: float, spread_v: float, bias_v: float = 0.0
) -> np.ndarray:
    """Return a product of two Lorentzians, of the switching voltages about +- the coercive voltage."""
    a, b = (up - bias_v - coercive_v) / spread_v, (down - bias_v + coercive_v) / spread_v
    return 1.0 / ((1.0 + a**2) * (1.0 + b**2))
