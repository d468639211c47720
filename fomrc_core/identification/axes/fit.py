"""Gauss-Newton on the periodic steady state: by Parseval that is least squares on the time signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.gauss_newton import Linearized, descend
from fomrc_core.compute.least_squares import NormalEquations, normal_equations
from fomrc_core.identification.axes.kept_descents import KeptDescents, digest_of
from fomrc_core.identification.axes.parameters import AxesParameters, Mask
from fomrc_core.identification.axes.response import ResponseFit

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Progress = Callable[[float, str], None]

_LEAST_DAMPING = 5e-4  # a mode that rings longer than 2000 periods is the fit's, not the structure's
LEAST_PLAY_WEIGHT = 1e-3  # of the slope beside it: Maxwell elements need one greater than zero


@dataclass(frozen=True, eq=False)
class AxesProblem:
    """The sum of squares at some parameters, and its normal equations over the whole vector."""

    cost: float
    equations: NormalEquations


@dataclass(frozen=True, eq=False)
class _Point:
    parameters: AxesParameters
    squared_error: float


class AxesFit:
    """The sum of relative squared errors of a model of several axes over records.

    Every record and output counts alike: error over the displacement without its mean, as scores are told.

    Args:
        response: spectra of the model for the records to learn from.
        kept: descents as far as they have come before; none if left out.
    """

    def __init__(self, response: ResponseFit, kept: KeptDescents | None = None):
        self.response = response
        self._kept = kept or KeptDescents()
        rms = np.array([record.rms_um for record in response.records])
        self.weights = 1.0 / rms / np.sqrt(rms.size)

    @cached_property
    def _digest(self) -> bytes:
        """What tells this fit from all others, whatever it begins with."""
        records, response = self.response.records, self.response
        fixed = np.array([response.step_s, response.reference_v, response.n_plays])
        spectra = (*(r.displacement for r in records), *(r.voltage for r in records), *response.play_spectra)
        return digest_of((fixed, self.weights, response.z1, *spectra))

    def errors(self, parameters: AxesParameters) -> Array:
        """Return the relative error of each record and output [1], (n_records, O)."""
        found = []
        for r, record in enumerate(self.response.records):
            left = record.displacement - self.response.spectrum(parameters, r)
            found.append(np.sqrt((np.abs(left) ** 2).sum(axis=1)) / record.rms_um)
        return np.array(found)

    def cost(self, parameters: AxesParameters) -> float:
        """Return the mean of the squared relative errors."""
        return float(np.mean(self.errors(parameters) ** 2))

    def linearised(self, parameters: AxesParameters) -> AxesProblem:
        """Return the linearised problem at these parameters."""
        n = parameters.vector().size
        matrix, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0
        for r, record in enumerate(self.response.records):
            left = record.displacement - self.response.spectrum(parameters, r)
            for o, columns, at in self.response.derivatives(parameters, r):
                w = self.weights[r, o]
                rest = real_rows(left[o]) * w
                own = normal_equations([(real_rows(columns) * w, rest, np.ones(rest.size, dtype=np.bool_))])
                matrix[np.ix_(at, at)] += own.gram
                gradient[at] += own.moment
                cost += float(rest @ rest)
        return AxesProblem(cost, NormalEquations(matrix, gradient))

    def fitted(
        self,
        start: AxesParameters,
        free: Mask,
        *,
        n_steps: int = 20,
        still: float = 1e-4,
        progress: Progress | None = None,
    ) -> AxesParameters:
        """Return the parameters of the least cost from a start; from where it was, had it begun before.

        Args:
            start: where from.
            free: which entries of the vector move.
            n_steps: at most so many.
            still: the relative gain of a step below which it ends.
            progress: told share and text of each step.
        """
        plays = np.zeros(free.size, dtype=bool)  # the relay's weights, which follow them, are of either sign
        plays[start.places()["play_weights"][: self.response.n_plays].ravel()] = True
        plays &= free
        done = 0

        def within(vector: Array) -> AxesParameters:
            vector[plays] = np.maximum(vector[plays], LEAST_PLAY_WEIGHT)
            return start.moved_to(vector)

        def stepped(point: _Point, step: Array) -> _Point | None:
            trial = point.parameters.vector()
            trial[free] += step
            moved = within(trial)
            return _Point(moved, self.cost(moved)) if is_sound(moved, self.response.step_s) else None

        def linearize(point: _Point) -> Linearized[_Point]:
            nonlocal done
            if progress is not None and done:
                progress(done / n_steps, f"error {100.0 * np.sqrt(point.squared_error):.3f} %")
            done += 1
            whole = self.linearised(point.parameters).equations
            equations = NormalEquations(whole.gram[np.ix_(free, free)], whole.moment[free])
            return Linearized(equations, lambda step: stepped(point, step), np.full(equations.moment.size, np.inf))

        trail = self._kept.trail(lambda: self._digest, start.vector(), free, np.array([n_steps, still, start.n_modes]))
        begun = within(start.vector()) if trail.vector is None else start.moved_to(trail.vector)
        if trail.is_done:
            return begun
        point = _Point(begun, self.cost(begun))
        descent = descend(point, linearize, n_iterations=n_steps, least_gain=still, trail=trail)
        trail.end(descent.point)
        return descent.point.parameters


def real_rows(columns: ComplexArray) -> Array:
    """Return complex rows as twice as many real ones, of the same sum of squares."""
    return np.concatenate([columns.real, columns.imag])


def is_sound(parameters: AxesParameters, step_s: float) -> bool:
    """Whether every mode decays, and the delay is within a sample."""
    damping = np.exp(parameters.log_damping)
    delay = float(parameters.delay_s[0])
    changes = np.abs(parameters.damping_change).max(initial=0.0)
    return bool(
        np.all(np.isfinite(parameters.vector()))
        and damping.min(initial=1.0) > _LEAST_DAMPING
        and damping.max(initial=0.0) < 0.5
        and changes < 3.0
        and 1e-4 * step_s < delay < (1.0 - 1e-4) * step_s
        and 0.05 < parameters.exponent[0] < 3.0
    )
