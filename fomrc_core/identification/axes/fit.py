"""Levenberg-Marquardt on the periodic steady state: by Parseval that is least squares on the time signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.identification.axes.parameters import AxesParameters, Mask
from fomrc_core.identification.axes.response import ResponseFit

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_LEAST_DAMPING = 5e-4  # a mode that rings longer than 2000 periods is the fit's, not the structure's
_MOST_LAMBDA = 1e6
LEAST_PLAY_WEIGHT = 1e-3  # of the slope beside it: Maxwell elements need one greater than zero


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sum of squares, its gradient and Gauss-Newton matrix, over the whole vector."""

    cost: float
    gradient: Array
    matrix: Array


class AxesFit:
    """The sum of relative squared errors of a model of several axes over records.

    Every record and output counts alike: error over the displacement without its mean, as scores are told.

    Args:
        response: spectra of the model for the records to learn from.
    """

    def __init__(self, response: ResponseFit):
        self.response = response
        rms = np.array([record.rms_um for record in response.records])
        self.weights = 1.0 / rms / np.sqrt(rms.size)

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

    def normal_equations(self, parameters: AxesParameters) -> NormalEquations:
        """Return the linearised problem at these parameters."""
        n = parameters.vector().size
        matrix, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0
        for r, record in enumerate(self.response.records):
            left = record.displacement - self.response.spectrum(parameters, r)
            for o, columns, at in self.response.derivatives(parameters, r):
                w = self.weights[r, o]
                stacked = np.concatenate([columns.real, columns.imag]) * w
                rest = np.concatenate([left[o].real, left[o].imag]) * w
                matrix[np.ix_(at, at)] += stacked.T @ stacked
                gradient[at] += stacked.T @ rest
                cost += float(rest @ rest)
        return NormalEquations(cost, gradient, matrix)

    def fitted(
        self,
        start: AxesParameters,
        free: Mask,
        *,
        n_steps: int = 20,
        still: float = 1e-4,
        progress: Progress | None = None,
    ) -> tuple[AxesParameters, NormalEquations]:
        """Return the parameters of the least cost from a start, and the problem linearised before the last step.

        Args:
            start: where from.
            free: which entries of the vector move.
            n_steps: at most so many.
            still: the relative gain of a step below which it ends.
            progress: told share and text of each step.
        """
        x, damping = start.vector(), 1e-3
        plays = np.zeros(x.size, dtype=bool)  # the relay's weights, which follow them, are of either sign
        plays[start.places()["play_weights"][: self.response.n_plays].ravel()] = True
        plays &= free
        problem = self.normal_equations(start)
        for k in range(n_steps):
            matrix, gradient = problem.matrix[np.ix_(free, free)], problem.gradient[free]
            scale = np.diag(matrix) + 1e-14 * np.diag(problem.matrix).max()
            cost = problem.cost
            while damping < _MOST_LAMBDA:
                trial = x.copy()
                trial[free] += np.linalg.solve(matrix + damping * np.diag(scale), gradient)
                trial[plays] = np.maximum(trial[plays], LEAST_PLAY_WEIGHT)
                moved = start.moved_to(trial)
                if is_sound(moved, self.response.step_s) and (cost := self.cost(moved)) < problem.cost:
                    break
                damping *= 6.0
            else:
                break
            x, damping = trial, max(damping / 6.0, 1e-8)
            gain = 1.0 - cost / problem.cost
            if progress is not None:
                progress((k + 1) / n_steps, f"error {100.0 * np.sqrt(cost):.3f} %")
            problem = self.normal_equations(moved)
            if gain < still:
                break
        return start.moved_to(x), problem


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
