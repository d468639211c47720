"""From weights on a grid of thresholds to the Maxwell elements of a model: few, in the right place."""

from __future__ import annotations

import numpy as np

from fomrc_core.operators.hysteresis import OperatorSum


def merged(form: OperatorSum, n_elements: int) -> OperatorSum:
    """Return a play form of at most ``n_elements`` plays that stays closest to the given one.

    Plays of weight zero go; then the two neighbours whose union bends the first rising curve least are joined
    at their centre of weight, until few enough are left.
    """
    kept = form.weights > 1e-9 * max(float(np.max(form.weights, initial=0.0)), 1e-300)
    thresholds, weights = list(form.thresholds[kept]), list(form.weights[kept])
    while len(thresholds) > n_elements:
        cost = [
            weights[k] * weights[k + 1] / (weights[k] + weights[k + 1]) * (thresholds[k + 1] - thresholds[k]) ** 2
            for k in range(len(thresholds) - 1)
        ]
        k = int(np.argmin(cost))
        total = weights[k] + weights[k + 1]
        thresholds[k] = (weights[k] * thresholds[k] + weights[k + 1] * thresholds[k + 1]) / total
        weights[k] = total
        del thresholds[k + 1], weights[k + 1]
    return OperatorSum(form.slope, np.array(thresholds), np.array(weights))


def split(form: OperatorSum, n_elements: int) -> OperatorSum:
    """Return the play form with its heaviest plays halved and set apart until there are ``n_elements``."""
    thresholds, weights = list(form.thresholds), list(form.weights)
    while thresholds and len(thresholds) < n_elements:
        k = int(np.argmax(np.array(weights) * np.array(thresholds)))
        apart = 0.15 * thresholds[k]
        half = 0.5 * weights[k]
        thresholds[k : k + 1] = [thresholds[k] - apart, thresholds[k] + apart]
        weights[k : k + 1] = [half, half]
    order = np.argsort(thresholds, kind="stable")
    return OperatorSum(form.slope, np.array(thresholds)[order], np.array(weights)[order])
