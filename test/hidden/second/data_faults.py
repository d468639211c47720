"""What goes wrong between the sensor and the file: spikes, dropouts, and samples that come when they should not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.second.scale import log_uniform

FAULT_KINDS = ("spikes", "dropouts", "stuck", "lost_samples", "doubled_samples", "clock_jitter", "clipping")


@dataclass(frozen=True)
class DataFault:
    """One fault of one record.

    Args:
        kind: one of FAULT_KINDS.
        samples: samples concerned, rising (of jitter and clipping: none listed where all are).
        size: of a spike the largest [um]; of a dropout the reading [um]; of jitter its rms in sample periods; of
            clipping the reading above which nothing is seen [um]; else 0.
    """

    kind: str
    samples: tuple[int, ...]
    size: float


def draw_fault(kind: str, n: int, measured_um: np.ndarray, rng: np.random.Generator) -> DataFault:
    """Draw a fault of a kind for a record of n samples."""
    swing = float(np.ptp(measured_um))
    if kind == "spikes":
        many = int(rng.integers(3, 12))
        return DataFault(kind, _places(n, many, rng), swing * log_uniform(rng, 0.05, 2.0))
    if kind == "dropouts":
        many = max(3, round(rng.uniform(0.002, 0.02) * n))
        low = float(measured_um.min()) - rng.uniform(0.2, 2.0) * swing
        return DataFault(kind, _places(n, many, rng), 0.0 if rng.random() < 0.5 else low)
    if kind == "stuck":
        many = max(5, round(rng.uniform(0.01, 0.04) * n))
        begin = int(rng.integers(n // 10, n - many - 1))
        return DataFault(kind, tuple(range(begin, begin + many)), 0.0)
    if kind in ("lost_samples", "doubled_samples"):
        return DataFault(kind, _places(n, int(rng.integers(1, 6)), rng), 0.0)
    if kind == "clock_jitter":
        return DataFault(kind, (), rng.uniform(0.05, 0.4))
    if kind == "clipping":
        return DataFault(kind, (), float(np.quantile(measured_um, rng.uniform(0.93, 0.98))))
    raise ValueError(f"fault {kind!r}, one of {FAULT_KINDS}")


def apply_fault(fault: DataFault, measured_um: np.ndarray, true_um: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the readings as the file holds them [um], shape (n_samples,).

    Args:
        fault: what happened.
        measured_um: readings before the fault [um].
        true_um: the same without noise, for readings at other moments [um].
        rng: source of chance.
    """
    out, at = measured_um.copy(), np.array(fault.samples, dtype=np.int64)
    n = out.size
    if fault.kind == "spikes":
        out[at] += fault.size * rng.uniform(0.3, 1.0, at.size) * rng.choice([-1.0, 1.0], at.size)
    elif fault.kind == "dropouts":
        out[at] = fault.size
    elif fault.kind == "stuck":
        out[at] = out[at[0] - 1]
    elif fault.kind == "lost_samples":
        # The reader does not notice: later readings move up, and the last is repeated.
        out = np.pad(np.delete(out, at), (0, at.size), mode="edge")
    elif fault.kind == "doubled_samples":
        out = np.insert(out, at, out[at])[:n]
    elif fault.kind == "clock_jitter":
        moved = np.arange(n) + fault.size * rng.standard_normal(n)
        out += np.interp(moved, np.arange(n), true_um) - true_um
    elif fault.kind == "clipping":
        out = np.minimum(out, fault.size)
    return out


def _places(n: int, many: int, rng: np.random.Generator) -> tuple[int, ...]:
    return tuple(sorted(rng.choice(np.arange(n // 20, n - n // 20), many, replace=False).tolist()))
