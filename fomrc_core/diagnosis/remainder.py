"""What is left after a model, and whether any of it follows the drive.

Noise does not follow the drive. A flexible regression of the residual on what the drive did, learned on some blocks
of a record and judged on others, predicts nothing of noise of any colour; what it does predict no cause found so far
explains. Each group of terms is tested apart, so that the answer says what the rest depends on.

The statistic is that of Clark and West (2007) for nested models, the smaller one being "nothing is left": the mean of
residual times prediction over blocks that were not learned from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, lfilter
from scipy.stats import t as student

from fomrc_core.compute.least_squares import normal_equations, whitening_of

Array = NDArray[np.float64]

_N_BLOCKS = 24  # of a record: blocks long beside the correlation of noise, many enough for a t-test
_GAP_SHARE = 0.1  # of a block at either edge, neither learned from nor judged: noise is alike on both sides of an edge
_N_HATS = 8  # over a range: what bends faster than an eighth of it is hysteresis of its own
_LEAST_TURN = 0.02  # of the drive's range; less may be noise of a voltage that was read back
_REST_SHARE = 1e-3  # of the largest rate; less is rest
_RANK_TOLERANCE = 1e-7  # of the largest eigenvalue of a correlation matrix
_LAG_SHARES = (1e-3, 4e-3, 1.6e-2, 6.4e-2, 0.25)  # time constants as shares of the record


@dataclass(frozen=True)
class Dependence:
    """How much of a residual follows from one thing.

    Attributes:
        on: what it follows from.
        share: share of the residual's power that is predicted from it on blocks not learned from [1].
        p_value: of the hypothesis that nothing is.
        is_of_drive: whether it is something of the drive.
    """

    on: str
    share: float
    p_value: float
    is_of_drive: bool = True


@dataclass(frozen=True, eq=False)
class DrivenRecord:
    """A record as the tests see it, arrays of shape (n_samples,).

    Attributes:
        time_s: sample times [s].
        voltage_v: drive [V].
        predicted_um: displacement the model gives [um].
        residual_um: measured minus predicted [um].
        is_used: samples that are looked at.
    """

    time_s: Array
    voltage_v: Array
    predicted_um: Array
    residual_um: Array
    is_used: NDArray[np.bool_]

    @property
    def left_um2(self) -> float:
        """Sum of squares of the residual about its mean, over the samples that are looked at [um^2]."""
        left_um = self.residual_um[self.is_used]
        return float(np.sum((left_um - np.mean(left_um)) ** 2)) if left_um.size else 0.0


def dependences(records: Sequence[DrivenRecord], whitening: Array | None = None) -> tuple[Dependence, ...]:
    """Return what the residual of the records follows from, group by group, and all groups together last.

    Each is what is seen in the whole and in what is quicker than a noise that wanders, whichever is less.

    Args:
        records: with the residual of one and the same model.
        whitening: coefficients of the filter that whitens the noise, shape (order + 1,), first 1; without it noise is
            taken as it is, and one that wanders follows by chance what the drive happens to do in so long a time.
    """
    ranges = _Ranges.of(records)
    groups = [_groups(record, ranges) for record in records]
    if whitening is not None:
        groups = [{n: lfilter(whitening, [1.0], c - c[0], axis=0) for n, c in own.items()} for own in groups]
        records = [replace(r, residual_um=lfilter(whitening, [1.0], r.residual_um - r.residual_um[0])) for r in records]
    quick = [replace(r, residual_um=_without_wander(r.residual_um)) for r in records]
    quick_groups = [{name: _without_wander(columns) for name, columns in own.items()} for own in groups]
    both = zip(_of_groups(records, groups), _of_groups(quick, quick_groups), strict=True)
    return tuple(Dependence(a.on, min(a.share, b.share), max(a.p_value, b.p_value)) for a, b in both)


def _of_groups(records: Sequence[DrivenRecord], groups: Sequence[dict[str, Array]]) -> list[Dependence]:
    names = tuple(groups[0])
    found = [_dependence(name, records, [g[name] for g in groups]) for name in names]
    joined = [np.column_stack([g[name] for name in names]) for g in groups]
    return [*found, _dependence("all of these together", records, joined)]


def _without_wander(values: Array) -> Array:
    """Return values without their slowest cosines, shape kept.

    Noise that wanders is alike in blocks beside each other: what is learned of it in one holds in the next, whatever
    the drive does. What follows the drive follows it within two blocks as well.
    """
    from scipy.fft import dct, idct  # a part of a second to import, which no node that only drives shall wait for

    spectrum = dct(values, axis=0, norm="ortho")
    spectrum[: _N_BLOCKS // 2] = 0.0
    return np.asarray(idct(spectrum, axis=0, norm="ortho"))


def _dependence(on: str, records: Sequence[DrivenRecord], columns: list[Array]) -> Dependence:
    products, rests, powers, explained = [], [], [], 0.0
    for parity in (0, 1):
        learned, judged = [], []
        for record in records:
            block, is_inside = blocks_of(record.time_s.size)
            is_own = record.is_used & is_inside
            learned.append(is_own & (block % 2 == parity))
            judged.append(is_own & (block % 2 != parity))
        coefficients = _learned(records, columns, learned)
        for record, c, is_learned, is_judged in zip(records, columns, learned, judged, strict=True):
            if not np.any(is_judged) or not np.any(is_learned):
                continue
            block, _ = blocks_of(record.time_s.size)
            mean = np.mean(c[is_learned], axis=0)
            residual = record.residual_um - np.mean(record.residual_um[is_learned])
            raw = (c - mean) @ coefficients
            # beyond what was learned a flexible regression says anything
            reach = float(np.max(np.abs(raw[is_learned])))
            prediction = np.clip(raw, -reach, reach)
            gain = residual * prediction
            for k in np.unique(block[is_judged]):
                here = is_judged & (block == k)
                products.append(float(np.sum(gain[here])))
                rests.append(float(np.sum((gain - prediction**2)[here])))
                powers.append(float(np.sum(residual[here] ** 2)))
                explained += powers[-1] - float(np.sum((residual[here] - prediction[here]) ** 2))
    gains = np.array(products)
    total = float(np.sum(powers))
    share = float(np.clip(explained / total, 0.0, 1.0)) if total > 0.0 else 0.0
    # the spread is that of what the prediction leaves: a cause that acts here and not there is no less sure for it
    spread = float(np.std(rests, ddof=1)) if gains.size > 2 else 0.0
    if spread == 0.0:
        return Dependence(on, share, 1.0)
    # what one half teaches of the other is what the other teaches of it: the two say one thing, not two
    error = spread * np.sqrt(2.0 / gains.size)
    p_value = float(student.sf(float(np.mean(gains)) / error, gains.size - 1))
    return Dependence(on, share, p_value)


def blocks_of(n_samples: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the block of each sample, and whether it is not at an edge of it, shapes (n_samples,)."""
    share = np.arange(n_samples) * _N_BLOCKS / n_samples
    inside = share - np.floor(share)
    return share.astype(np.int64), (inside >= _GAP_SHARE) & (inside < 1.0 - _GAP_SHARE)


def _learned(records: Sequence[DrivenRecord], columns: list[Array], learned: list[NDArray[np.bool_]]) -> Array:
    """Return coefficients by least squares, each orthogonal part shrunk by what noise of this colour makes of it."""
    n_columns = columns[0].shape[1]
    parts = []
    for record, c, mask in zip(records, columns, learned, strict=True):
        if not np.any(mask):
            continue
        x = c[mask] - np.mean(c[mask], axis=0)
        y = record.residual_um[mask] - np.mean(record.residual_um[mask])
        parts.append((x, y, blocks_of(record.time_s.size)[0][mask]))
    if not parts:
        return np.zeros(n_columns)
    equations = normal_equations((x, y, np.ones(y.size, dtype=np.bool_)) for x, y, _ in parts)
    whitening = whitening_of(equations.gram, _RANK_TOLERANCE)
    parts_along = whitening.T @ equations.moment
    # what each part would be by chance: from its own spread over blocks, which counts correlation as it is
    chance = np.zeros(parts_along.size)
    for x, y, block in parts:
        z = x @ whitening
        sums = np.array([z[block == k].T @ y[block == k] for k in np.unique(block)])
        chance += np.sum((sums - np.mean(sums, axis=0)) ** 2, axis=0)
    shrunk = parts_along * np.maximum(0.0, 1.0 - chance / np.maximum(parts_along**2, 1e-300))
    return np.asarray(whitening @ shrunk)


@dataclass(frozen=True)
class _Ranges:
    """What the terms are measured in: the same for all records, or they would not say the same thing in each."""

    lowest_v: float
    span_v: float
    lowest_um: float
    span_um: float
    rate_v_per_s: float
    step_s: float
    duration_s: float

    @classmethod
    def of(cls, records: Sequence[DrivenRecord]) -> _Ranges:
        lowest_v = min(float(np.min(r.voltage_v)) for r in records)
        lowest_um = min(float(np.min(r.predicted_um)) for r in records)
        rates = np.concatenate([np.abs(np.gradient(r.voltage_v, r.time_s)) for r in records])
        moving = rates[rates > _REST_SHARE * np.max(rates)]
        return cls(
            lowest_v,
            max(float(np.max(r.voltage_v)) for r in records) - lowest_v,
            lowest_um,
            max(float(np.max(r.predicted_um)) for r in records) - lowest_um,
            float(np.sqrt(np.mean(moving**2))) if moving.size else 1.0,
            float(np.median(np.diff(records[0].time_s))),
            max(float(r.time_s[-1] - r.time_s[0]) for r in records),
        )

    def share_v(self, voltage_v: Array) -> Array:
        return np.asarray((voltage_v - self.lowest_v) / self.span_v) if self.span_v > 0.0 else np.zeros(voltage_v.size)

    def share_um(self, moved_um: Array) -> Array:
        return np.asarray((moved_um - self.lowest_um) / self.span_um) if self.span_um > 0.0 else np.zeros(moved_um.size)


def _groups(record: DrivenRecord, ranges: _Ranges) -> dict[str, Array]:
    v = ranges.share_v(record.voltage_v)
    r = np.gradient(record.voltage_v, record.time_s) / ranges.rate_v_per_s
    way, since = _since_turn(record, v, ranges)
    rising = (way > 0.0)[:, None]
    hats = hats_over(v)
    return {
        "displacement": np.column_stack((hats_over(ranges.share_um(record.predicted_um)), hats)),
        "rate": np.column_stack((r, np.abs(r), np.sign(r) * np.sqrt(np.abs(r)), r * np.abs(r), v * r, v * np.abs(r))),
        "place in the loop": np.column_stack((hats * rising, hats * ~rising)),
        "time since turning": np.column_stack((since * way[:, None], since)),
        "past of the drive": _lags(v, ranges),
    }


def hats_over(unit: Array, n: int = _N_HATS) -> Array:
    """Return hat functions of values from 0 to 1, side by side, shape (n_samples, n)."""
    centres = np.linspace(0.0, 1.0, n)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(unit[:, None] - centres) * (n - 1)))


def _since_turn(record: DrivenRecord, v: Array, ranges: _Ranges) -> tuple[Array, Array]:
    """Return the width of the present sweep with its sign, and hats over the logarithm of the time since it began."""
    turns = np.unique(np.concatenate([find_peaks(sign * v, prominence=_LEAST_TURN)[0] for sign in (1.0, -1.0)]))
    edges = np.unique(np.concatenate(([0], turns, [v.size - 1]))).astype(np.int64)
    at = np.clip(np.searchsorted(edges, np.arange(v.size), side="right") - 1, 0, edges.size - 2)
    way = v[edges[at + 1]] - v[edges[at]]
    since = record.time_s - record.time_s[edges[at]]
    n_decades = np.log(max(ranges.duration_s / ranges.step_s, 2.0))
    return way, hats_over(np.log(np.maximum(since / ranges.step_s, 1.0)) / n_decades)


def _lags(v: Array, ranges: _Ranges) -> Array:
    columns = []
    for share in _LAG_SHARES:
        decay = float(np.exp(-ranges.step_s / max(share * ranges.duration_s, ranges.step_s)))
        columns.append(v - v[0] - lfilter([1.0 - decay], [1.0, -decay], v - v[0]))
    for samples in (1, 2, 4, 8):
        columns.append(v - np.concatenate((np.full(samples, v[0]), v[:-samples])))
    return np.column_stack(columns)
