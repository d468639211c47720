"""How sure identified parameters are, which elements the data determine, what to measure for the rest.

Moving-block bootstrap: what the model left over is cut into blocks, blocks are drawn at random and put
behind the fitted response, and the parameters are refitted, linearised about the fit. Blocks keep what is
coloured in the residual, so the intervals hold where the residual is not white, which standard errors from
the Jacobian do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.fitting.base_fit import choose_starts
from fomrc_core.fitting.element_fit import trial_of
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.memory_plan import IDENTIFYING
from fomrc_core.fitting.trial_model import predict
from fomrc_core.identification.fit import Fit
from fomrc_core.identification.moving_blocks import moving_blocks
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

_DETERMINED = 0.3  # largest relative standard error of an element that counts as determined
_ORDER_DETERMINED = 0.1
_ALIKE = 0.95  # correlation above which two elements cannot be told apart
_WIDEST_LOG = 50.0  # an interval wider than this is without end


@dataclass(frozen=True, eq=False)
class ElementUncertainty:
    """One element.

    Attributes:
        number: of the element in the model, from 1.
        kappa_um_per_v: fitted [um/V], with relative standard error.
        kappa_relative_error: [1].
        saturation_v: fitted [V].
        saturation_relative_error: [1].
        knee_v: voltage from the relaxed state at which it saturates [V].
        is_determined: whether the data determine its gain and its saturation voltage.
    """

    number: int
    kappa_um_per_v: float
    kappa_relative_error: float
    saturation_v: float
    saturation_relative_error: float
    knee_v: float
    is_determined: bool

    def __str__(self) -> str:
        return (
            f"element {self.number}: "
            f"kappa {self.kappa_um_per_v:.4g} um/V +- {100 * self.kappa_relative_error:.2g} %, "
            f"saturation {self.saturation_v:.4g} V +- {100 * self.saturation_relative_error:.2g} %"
            f"{'' if self.is_determined else ', not determined by this data'}"
        )


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Uncertainty of a fit.

    Attributes:
        elements: one per element, in the order of the model.
        creep_order: fitted [1].
        creep_order_interval: 95 % interval [1].
        last_kappa_interval_um_per_v: 95 % interval of kappa_{n+1} [um/V].
        replicates: natural logarithms of the parameters per replicate, kappa (n + 1), saturation (n), and
            the creep order itself, shape (n_replicates, 2 n + 2).
        advice: sentences, what to measure; empty where all is determined.
    """

    elements: tuple[ElementUncertainty, ...]
    creep_order: float
    creep_order_interval: tuple[float, float]
    last_kappa_interval_um_per_v: tuple[float, float]
    replicates: Array
    advice: tuple[str, ...]

    def __str__(self) -> str:
        low, high = self.creep_order_interval
        order = f"creep order {self.creep_order:.5g}, between {low:.5g} and {high:.5g} (95 %)"
        return "\n".join([order, *map(str, self.elements), *self.advice])

    @property
    def n_determined(self) -> int:
        """Number of elements the data determine."""
        return sum(element.is_determined for element in self.elements)


def estimate_uncertainty(
    fit: Fit,
    recordings: Recording | Sequence[Recording],
    *,
    n_replicates: int = 300,
    seed: int = 0,
    progress: Callable[[float, str], None] | None = None,
) -> Uncertainty:
    """Return the uncertainty of a fit's parameters, and advice on the excitation.

    Args:
        fit: from ``identify``.
        recordings: the records it was fitted on.
        n_replicates: bootstrap replicates, 20 or more.
        seed: of the bootstrap.
        progress: called with the share done and a word.

    Raises:
        ParameterError: too few replicates, or records that were thinned for the fit.
    """
    if fit.thinning is not None:
        raise ParameterError(
            "records too long for a bootstrap",
            where="recordings",
            value=fit.thinning.n_samples,
            allowed=f"{IDENTIFYING.n_whole_max} samples; give a part of them",
        )
    if n_replicates < 20:
        raise ParameterError("too few replicates", where="n_replicates", value=n_replicates, allowed="20 or more")
    given = [examine(r).recording for r in ([recordings] if isinstance(recordings, Recording) else recordings)]
    records = tuple(FitRecord.of(r) for r in given)
    starts = choose_starts(records)
    model = fit.model
    n = model.n_elements
    centre = np.concatenate([np.log(model.kappa_um_per_v), np.log(model.saturation_v), [model.creep_order]])

    def responses(parameters: Array) -> list[Array]:
        order = float(min(max(parameters[-1], 0.0), 1.0))
        form = PiezoModel(np.exp(parameters[: n + 1]), np.exp(parameters[n + 1 : -1]), order).play_form
        moved = [predict(trial_of(form, order, records, starts), record, index) for index, record in enumerate(records)]
        return [x - x.mean() for x in moved]

    def tell(share: float, text: str) -> None:
        if progress is not None:
            progress(share, text)

    fitted = responses(centre)
    residuals = [(r.measured_um - r.measured_um.mean()) - x for r, x in zip(records, fitted, strict=True)]
    sensitivity = np.empty((sum(x.size for x in fitted), centre.size))
    for column in range(centre.size):
        tell(0.8 * column / centre.size, "sensitivity of the response")
        step = np.zeros(centre.size)
        step[column] = 1e-5 if column == centre.size - 1 else 1e-3
        sensitivity[:, column] = (
            np.concatenate(responses(centre + step)) - np.concatenate(responses(centre - step))
        ) / (2.0 * step[column])
    spread = _bootstrap(sensitivity, residuals, n_replicates, np.random.default_rng(seed))
    tell(1.0, "done")
    errors = spread.std(axis=0)
    elements = _elements(model, errors)
    low, high = np.quantile(centre + spread, [0.025, 0.975], axis=0)
    return Uncertainty(
        elements,
        model.creep_order,
        (float(max(low[-1], 0.0)), float(high[-1])),
        (float(np.exp(max(low[n], -_WIDEST_LOG))), float(np.exp(min(high[n], _WIDEST_LOG)))),
        centre + spread,
        _advice(model, elements, float(errors[-1]), spread, given),
    )


def _elements(model: PiezoModel, errors: Array) -> tuple[ElementUncertainty, ...]:
    """Return each element with the standard errors of the logarithms of its gain and saturation voltage."""
    n = model.n_elements
    knees = _knees_v(model)
    return tuple(
        ElementUncertainty(
            i + 1,
            float(model.kappa_um_per_v[i]),
            float(errors[i]),
            float(model.saturation_v[i]),
            float(errors[n + 1 + i]),
            float(knees[i]),
            bool(errors[i] <= _DETERMINED and errors[n + 1 + i] <= _DETERMINED),
        )
        for i in range(n)
    )


def _bootstrap(sensitivity: Array, residuals: Sequence[Array], n_replicates: int, rng: np.random.Generator) -> Array:
    """Return changes of the parameters that block-resampled residuals would have made."""
    orthogonal, triangle = np.linalg.qr(sensitivity)
    # Directions the data do not see at all come out with as large a change as they like, but finite.
    left, singular, right = np.linalg.svd(triangle)
    inverse = (right.T / np.maximum(singular, 1e-9 * singular[0])) @ left.T
    drawn = np.empty((n_replicates, sensitivity.shape[0]))
    at = 0
    for residual in residuals:
        drawn[:, at : at + residual.size] = moving_blocks(residual, n_replicates, rng)
        at += residual.size
    changes: Array = (drawn @ orthogonal) @ inverse.T
    return changes


def _knees_v(model: PiezoModel) -> Array:
    """Return the voltage at which each element saturates on the first rise [V], in the order of the model."""
    order = np.argsort(model.kappa_um_per_v[:-1] * model.saturation_v, kind="stable")
    knees = np.empty(order.size)
    knees[order] = model.play_form.thresholds
    return knees


def _advice(
    model: PiezoModel,
    elements: Sequence[ElementUncertainty],
    order_error: float,
    spread: Array,
    recordings: Sequence[Recording],
) -> tuple[str, ...]:
    n = model.n_elements
    largest = max(float(np.abs(r.voltage_v).max()) for r in recordings)
    swing = max(float(np.ptp(r.voltage_v)) for r in recordings)
    advice = []
    open_elements = [e for e in elements if not e.is_determined]
    beyond = [e for e in open_elements if e.knee_v > max(largest, 0.5 * swing)]
    if beyond:
        reach = 1.1 * max(e.knee_v for e in beyond)
        verb = "saturates" if len(beyond) == 1 else "saturate"
        advice.append(
            f"{_named(beyond)} never {verb} on a drive of {largest:.3g} V: drive up to {reach:.3g} V "
            f"(fomrc excite triangle --amplitude {reach:.3g}), or use fewer elements"
        )
    correlation = np.corrcoef(spread[:, :n].T) if n > 1 else np.ones((1, 1))
    for first, second in pairwise(sorted(elements, key=lambda e: e.knee_v)):
        is_open = not (first.is_determined and second.is_determined)
        if is_open and abs(correlation[first.number - 1, second.number - 1]) > _ALIKE:
            apart = max(abs(second.knee_v - first.knee_v), 0.01 * largest)
            advice.append(
                f"elements {first.number} and {second.number} cannot be told apart (knees {first.knee_v:.3g} "
                f"and {second.knee_v:.3g} V): add turning points between them, a triangle of decreasing "
                f"amplitude in steps of about {apart:.2g} V, or merge them"
            )
    rest = [e for e in open_elements if e not in beyond]
    if rest and not any("told apart" in text for text in advice):
        verb = "is" if len(rest) == 1 else "are"
        knees = [e.knee_v for e in rest]
        advice.append(
            f"{_named(rest)} {verb} weak in this drive: repeat it, or add loops of amplitude "
            f"{min(knees):.2g} to {max(knees):.2g} V"
        )
    if order_error > _ORDER_DETERMINED * max(model.creep_order, 1e-3):
        hold_s = max(30.0, 3.0 * max(r.duration_s for r in recordings))
        advice.append(
            f"the creep order is known to {order_error:.2g} only: hold steps of {0.6 * largest:.2g} V "
            f"or more for {hold_s:.0f} s (fomrc excite steps)"
        )
    return tuple(advice)


def _named(elements: Sequence[ElementUncertainty]) -> str:
    numbers = ", ".join(str(e.number) for e in elements)
    return f"element {numbers}" if len(elements) == 1 else f"elements {numbers}"
