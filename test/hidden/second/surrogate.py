"""How much of a truth a base of plays and power-law creep could take up: what is left is the fair size of a thing.

The base that is asked is as rich as any of its kind: many plays, the truth's own creep order, an offset for each
record. What it leaves of a truth with nothing hidden is the form error; what it leaves of an effect is visible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from test.hidden.second.creep import PowerLaw, creep
from test.hidden.second.plays import play_outputs

_ORDER_STEP = 1e-4


@dataclass(frozen=True)
class Trace:
    """A drive [V] at its samples, and the time between them [s]."""

    command_v: np.ndarray
    step_s: float


class Surrogate:
    """Plays and power-law creep, fitted to noiseless displacement.

    Args:
        traces: drives of the records: the first is what is fitted, the others are held out.
        reach_v: largest voltage of either sign [V].
        order: of the creep.
        n_plays: thresholds, evenly spaced.
        extra_v: further thresholds [V], such as the truth's own.
    """

    def __init__(
        self, traces: list[Trace], reach_v: float, order: float, n_plays: int, extra_v: np.ndarray | None = None
    ) -> None:
        even = reach_v * np.arange(n_plays) / n_plays
        self.thresholds_v = np.sort(np.concatenate([even, np.zeros(0) if extra_v is None else extra_v]))
        self.traces = traces
        self.reference_s = traces[0].command_v.size * traces[0].step_s
        self.plays = [play_outputs(trace.command_v, self.thresholds_v) for trace in traces]
        self.order = order

    def columns(self, which: int, order: float) -> np.ndarray:
        """Return the creeping plays of a record, shape (n_samples, n_plays)."""
        return creep(self.plays[which], PowerLaw(order, self.reference_s), self.traces[which].step_s)

    def left_of(self, displacements_um: list[np.ndarray]) -> list[np.ndarray]:
        """Fit weights that are not negative to the first record; return what is left of each [um], offsets out."""
        columns, wanted = _centred(self.columns(0, self.order)), _centred(displacements_um[0])
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        triangle = np.linalg.qr(np.column_stack([columns / size, wanted]), mode="r")
        weights = nnls(triangle[:, :-1], triangle[:, -1], maxiter=50 * columns.shape[1])[0] / size
        return [_centred(x - self.columns(which, self.order) @ weights) for which, x in enumerate(displacements_um)]

    def absorbing_basis(self) -> np.ndarray:
        """Return an orthonormal basis, over all records, of what weights, order and offsets can take up."""
        rows = []
        for which in range(len(self.traces)):
            columns = _centred(self.columns(which, self.order))
            more = self.columns(which, self.order + _ORDER_STEP) @ np.ones(self.thresholds_v.size)
            less = columns @ np.ones(self.thresholds_v.size)
            rows.append(np.column_stack([columns, _centred((more - less) / _ORDER_STEP)]))
        basis = np.concatenate(rows)
        basis /= np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
        q, r = np.linalg.qr(basis)
        return q[:, np.abs(np.diag(r)) > 1e-9]


def visible_um(differences_um: list[np.ndarray], basis: np.ndarray) -> list[np.ndarray]:
    """Return what a basis over all records leaves of an effect [um], record by record."""
    centred = np.concatenate([_centred(d) for d in differences_um])
    left = centred - basis @ (basis.T @ centred)
    return np.split(left, np.cumsum([d.size for d in differences_um])[:-1])


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _centred(values: np.ndarray) -> np.ndarray:
    return values - np.mean(values, axis=0)
