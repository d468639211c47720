"""What an exported model must answer: inputs of every kind, and the answers of the Python model itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.export.c_numbers import rounded_to
from fomrc_core.export.options import Precision
from fomrc_core.export.plan import ExportPlan
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

N_FIXED = 240
_N_ANY = 120
# A triangle of so many samples to a sweep, shrinking; then jumps and rests, as few as they are.
_N_SWEEP = 40
_REACH = 1.6  # of the largest threshold: every element saturates, with room behind it
_SHARE_OF_STROKE = 0.7


@dataclass(frozen=True, eq=False)
class GoldenData:
    """Inputs and answers of one direction, from the relaxed state on, arrays of shape (n_samples,).

    Attributes:
        steps_s: step that leads to each sample [s]; the first ``n_fixed`` are the sample time.
        inputs: voltage [V] forward, desired displacement [um] inverse.
        outputs: what the Python model answers, [um] or [V].
        covariates: the signals its effects read, by name.
        n_fixed: number of samples with the sample time as step.
    """

    steps_s: Array
    inputs: Array
    outputs: Array
    covariates: dict[str, Array]
    n_fixed: int


def golden_data(plan: ExportPlan, is_inverse: bool) -> GoldenData:
    """Return the golden data of one direction, answered by the compiled model.

    The inputs are made of sums and products alone: they are the same bits on every machine.
    """
    options, form = plan.options, plan.model.play_form
    largest = float(form.thresholds[-1]) if form.thresholds.size else 1.0
    span = _REACH * largest
    if is_inverse:
        span *= _SHARE_OF_STROKE * (form.slope + float(np.sum(form.weights)))
    shares: list[float] = []
    random = _Random()
    for k in range(N_FIXED + _N_ANY):
        phase = (k + _N_SWEEP // 2) % (2 * _N_SWEEP)
        sweep = abs(phase - _N_SWEEP) * 2.0 / _N_SWEEP - 1.0
        share = sweep * (1.0 - 0.5 * k / N_FIXED)
        if k % 60 >= 48:
            share = 0.8 * (2.0 * random.share() - 1.0) if k % 4 == 0 else shares[-1]
        shares.append(share)
    steps = [options.sample_period_s] * N_FIXED
    steps += [options.sample_period_s * (0.3 + 4.0 * random.share()) for _ in range(_N_ANY)]
    inputs = np.array([rounded_to(span * share, options.precision) for share in shares])
    # The sample time itself is exact in the fixed step; any other comes as a number of this precision.
    steps_s = np.array(steps[:N_FIXED] + [rounded_to(step, options.precision) for step in steps[N_FIXED:]])
    covariates = {name: _covariate(name, inputs.size, options.precision) for name in _covariates(plan, is_inverse)}
    runner = Compensator(plan.model) if is_inverse else plan.model
    return GoldenData(steps_s, inputs, _answers(runner, steps_s, inputs, covariates), covariates, N_FIXED)


def _answers(runner: PiezoModel | Compensator, steps_s: Array, inputs: Array, covariates: dict[str, Array]) -> Array:
    # One by one, as a controller steps: a batch may look ahead (a sensor whose clock runs late).
    state = runner.initial_state()
    rows = zip(steps_s.tolist(), inputs.tolist(), strict=True)
    return np.array(
        [
            runner.advance(state, value, step_s, **{name: float(signal[k]) for name, signal in covariates.items()})
            for k, (step_s, value) in enumerate(rows)
        ]
    )


def _covariates(plan: ExportPlan, is_inverse: bool) -> list[str]:
    return sorted({part.covariate for part in plan.parts_of(is_inverse) if part.covariate})


def _covariate(name: str, n_samples: int, precision: Precision) -> Array:
    # Any signal will do: a level that is none of zero, with a sawtooth on it, another for each name.
    period = 31 + 2 * len(name)
    return np.array([rounded_to(20.0 + 0.125 * (k % period), precision) for k in range(n_samples)])


class _Random:
    """Numbers between 0 and 1 that are the same everywhere (Knuth's MMIX constants)."""

    def __init__(self) -> None:
        self._state = 1

    def share(self) -> float:
        self._state = (self._state * 6364136223846793005 + 1442695040888963407) % (1 << 64)
        return float((self._state >> 11) / (1 << 53))
