"""The paper's own route to the parameters, section 3.2, as it is written there.

    (31)  polynomial u = p(x) of degree 5 through the initial rising curve
    (29)  sum_{i >= j} 1/kappa_i = p'((j - 1/2) dx), j = 1..n, dx = x_max / n;  1/kappa_{n+1} = p'(x_max)
    (30)  u_S,i = i dx / kappa_i. Printed as p(i du) / kappa_i, which is not a voltage: the threshold of
          element i is the displacement i dx at which the piecewise linear curve bends.
    (33)  log x = alpha log t + const, t >= t_c = 0.1 s after a step
    (34)  least squares on the displacement over all 2n + 2 parameters, bounded, finite differences

Where the paper takes for granted what a record may lack, this says so in ``PaperFit.notes``. Two things are
added, since any measured record needs them: an offset per record, and positive values where (29) gives none.
The convex route of ``identification`` is the better one; this one is here to be compared with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import ParameterError, RecordingError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.paper_stage import CREEP_ORDER
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

POLYNOMIAL_DEGREE = 5
CREEP_START_S = 0.1
_LARGEST_FACTOR = 30.0  # bounds of (34): each parameter within this factor of its start


@dataclass(frozen=True, eq=False)
class PaperFit:
    """What the paper's route found.

    Attributes:
        model: after (34).
        start_model: before (34).
        offsets_um: offset of each recording [um], shape (n_recordings,).
        rms_um: root mean square of measured minus predicted displacement [um].
        start_rms_um: the same for ``start_model`` [um].
        n_simulations: simulations of all recordings that (34) took.
        notes: what the records lacked and what was done instead.
    """

    model: PiezoModel
    start_model: PiezoModel
    offsets_um: Array
    rms_um: float
    start_rms_um: float
    n_simulations: int
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        gain = (
            f"paper's route: rms {1e3 * self.rms_um:.4g} nm after {self.n_simulations} simulations, from "
            f"{1e3 * self.start_rms_um:.4g} nm"
        )
        return "\n".join([gain, str(self.model), *self.notes])


def elements_from_rising_curve(voltage_v: Array, displacement_um: Array, n_elements: int) -> tuple[Array, Array]:
    """Return (kappa_um_per_v, saturation_v) from the initial rising curve, (29)-(31) with (30) corrected.

    Args:
        voltage_v: voltage from the relaxed state upwards [V], shape (n_samples,).
        displacement_um: displacement from the relaxed state upwards [um], shape (n_samples,).
        n_elements: number n of saturating elements.

    Raises:
        ParameterError: fewer than one element.
        RecordingError: the curve does not rise.
    """
    if n_elements < 1:
        raise ParameterError("too few elements", where="n_elements", value=n_elements, allowed="1 or more")
    largest = float(displacement_um.max(initial=0.0))
    if not largest > 0.0 or voltage_v.size <= POLYNOMIAL_DEGREE:
        raise RecordingError("no initial rising curve", where="displacement_um", value=largest, allowed="> 0 um")
    polynomial = np.polynomial.Polynomial.fit(displacement_um, voltage_v, POLYNOMIAL_DEGREE)
    step = largest / n_elements
    slope = polynomial.deriv()(np.append((np.arange(1, n_elements + 1) - 0.5) * step, largest))
    mean_slope = float(np.ptp(voltage_v)) / largest
    # A polynomial need not be concave everywhere, but an element cannot be negative.
    compliance = np.maximum(slope[:-1] - slope[1:], 0.02 * mean_slope / n_elements)
    last = max(float(slope[-1]), 0.05 * mean_slope)
    kappa = np.append(1.0 / compliance, 1.0 / last)
    return kappa, np.arange(1, n_elements + 1) * step * compliance


def creep_order_from_step(time_s: Array, displacement_um: Array) -> float:
    """Return alpha by the double-logarithmic law (33), least squares over t >= 0.1 s.

    Args:
        time_s: time since the step [s], shape (n_samples,).
        displacement_um: displacement from before the step [um], shape (n_samples,).

    Raises:
        RecordingError: nothing left after 0.1 s to take a logarithm of.
    """
    sign = math.copysign(1.0, float(displacement_um[-1]))
    usable = (time_s >= CREEP_START_S) & (sign * displacement_um > 0.0)
    if np.count_nonzero(usable) < 3:
        raise RecordingError(
            "no creep to see after the step",
            where="time_s",
            value=float(time_s[-1]),
            allowed=f"well beyond {CREEP_START_S} s",
        )
    order = float(np.polyfit(np.log(time_s[usable]), np.log(sign * displacement_um[usable]), 1)[0])
    return min(max(order, 0.0), 0.5)


def identify_paper(
    recordings: Sequence[Recording],
    n_elements: int = 10,
    start: PiezoModel | None = None,
    progress: Callable[[float, str], None] | None = None,
    *,
    max_iterations: int = 60,
) -> PaperFit:
    """Fit a model by the paper's route, (29)-(34).

    Args:
        recordings: measured records; the paper takes (29) from a triangle, (33) from a step and (34) from a
            staircase, each begun relaxed. Here each is taken from the record that shows it best.
        n_elements: number n of saturating elements.
        start: where (34) starts instead of (29)-(33).
        progress: called with the share done and a word.
        max_iterations: of the minimiser.

    Raises:
        RecordingError: no recordings, or no displacement in one.
        ParameterError: n_elements out of range.
    """
    if not recordings:
        raise RecordingError("no recordings", where="recordings", allowed="1 or more")
    notes: list[str] = []
    if start is None:
        kappa, saturation = elements_from_rising_curve(*_rising_curve(recordings, notes), n_elements)
        start = PiezoModel(kappa, saturation, _order_from_holds(recordings, notes))
    n = start.n_elements
    records = [(r.steps_s, np.asarray(r.voltage_v), np.asarray(r.measured_um), r.valid_samples) for r in recordings]
    n_samples = sum(int(np.count_nonzero(valid)) for _, _, _, valid in records)
    scale = np.concatenate([start.kappa_um_per_v, start.saturation_v, [max(start.creep_order, 1e-3)]])
    n_simulations = 0

    def model_of(relative: Array) -> PiezoModel:
        values = relative * scale
        return PiezoModel(values[: n + 1], values[n + 1 : -1], float(values[-1]))

    def errors(model: PiezoModel) -> tuple[float, Array]:
        offsets = np.empty(len(records))
        total = 0.0
        for k, (steps, voltage, measured, valid) in enumerate(records):
            beat("simulations")
            residual = (measured - model.simulate(steps, voltage))[valid]
            offsets[k] = residual.mean()
            total += float(np.sum((residual - offsets[k]) ** 2))
        return total / n_samples, offsets

    first = np.append(np.ones(2 * n + 1), start.creep_order / scale[-1])
    start_square = errors(model_of(first))[0]

    def objective(relative: Array) -> float:
        nonlocal n_simulations
        n_simulations += 1
        return errors(model_of(relative))[0] / start_square

    def report(_: Array) -> None:
        if progress is not None:
            progress(min(0.99, n_simulations / (max_iterations * 1.2 * scale.size)), "minimising (34)")

    bounds = [(1.0 / _LARGEST_FACTOR, _LARGEST_FACTOR)] * (2 * n + 1) + [(0.0, 0.9 / scale[-1])]
    options: dict[str, Any] = {
        "maxiter": max_iterations,
        "maxfun": 10 * max_iterations * scale.size,
        "maxcor": 30,
    }
    minimiser: Any = minimize
    found = minimiser(objective, first, method="L-BFGS-B", bounds=bounds, callback=report, options=options)
    model = model_of(found.x if found.fun < 1.0 else first)
    square, offsets = errors(model)
    if progress is not None:
        progress(1.0, "done")
    return PaperFit(model, start, offsets, math.sqrt(square), math.sqrt(start_square), n_simulations, tuple(notes))


def _rising_curve(recordings: Sequence[Recording], notes: list[str]) -> tuple[Array, Array]:
    """Return the longest rise (in samples of changing voltage) that begins a record, from (0, 0)."""
    best: tuple[Array, Array] | None = None
    begins_relaxed = False
    for recording in recordings:
        voltage = np.asarray(recording.voltage_v)
        measured = np.asarray(recording.measured_um)
        span = float(np.ptp(voltage))
        starts_at_zero = abs(float(voltage[0])) <= 0.02 * span
        peak = _first_peak(voltage, span)
        if peak < 2 * POLYNOMIAL_DEGREE:
            continue
        rise = slice(0, peak + 1)
        moving = int(np.unique(voltage[rise]).size)
        if best is None or (starts_at_zero, moving) > (begins_relaxed, int(np.unique(best[0]).size)):
            begins_relaxed = starts_at_zero
            best = (np.append(0.0, voltage[rise] - voltage[0]), np.append(0.0, measured[rise] - measured[0]))
            best = (best[0], np.maximum(best[1], 0.0))
    if best is None:
        # None begins with a rise: take the largest. A branch of the major loop is the rising curve
        # at twice the scale (Masing).
        voltage, measured = np.asarray(recordings[0].voltage_v), np.asarray(recordings[0].measured_um)
        low = int(np.argmin(voltage))
        high = low + int(np.argmax(voltage[low:]))
        best = (
            0.5 * (voltage[low : high + 1] - voltage[low]),
            0.5 * (measured[low : high + 1] - measured[low]),
        )
        begins_relaxed = False
    if not begins_relaxed:
        notes.append("no record begins relaxed with a rise from 0 V: (29) is taken from a rise of the loop")
    return best


def _first_peak(voltage_v: Array, span_v: float) -> int:
    """Return the index where the first rise ends, before the voltage falls by 1 % of its span."""
    highest = np.maximum.accumulate(voltage_v)
    fallen = np.flatnonzero(voltage_v < highest - 0.01 * span_v)
    stop = int(fallen[0]) if fallen.size else voltage_v.size
    return int(np.argmax(voltage_v[:stop]))


def _order_from_holds(recordings: Sequence[Recording], notes: list[str]) -> float:
    """Return alpha by (33) from the longest hold at a first step."""
    best: tuple[float, Array, Array] | None = None
    for recording in recordings:
        voltage = np.asarray(recording.voltage_v)
        away = np.flatnonzero(np.abs(voltage) > 1e-3 * np.abs(voltage).max())
        if not away.size:
            continue
        first = int(away[0])
        changed = np.flatnonzero(np.abs(voltage[first:] - voltage[first]) > 1e-6 * abs(voltage[first]))
        stop = first + int(changed[0]) if changed.size else voltage.size
        if stop - first < 4:
            continue
        start_s = float(recording.time_s[max(first - 1, 0)]) if first else float(-recording.sample_period_s)
        elapsed = np.asarray(recording.time_s[first:stop]) - start_s
        rest = float(np.mean(recording.measured_um[:first])) if first else 0.0
        if elapsed[-1] > 5 * CREEP_START_S and (best is None or elapsed[-1] > best[0]):
            best = (float(elapsed[-1]), elapsed, np.asarray(recording.measured_um[first:stop]) - rest)
    if best is None:
        notes.append(f"no step held long enough for (33): alpha starts at {CREEP_ORDER}")
        return CREEP_ORDER
    return creep_order_from_step(best[1], best[2])
