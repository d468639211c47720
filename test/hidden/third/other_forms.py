"""Hysteresis no sum of plays can be: loops that depend on the past, or that do not close."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.masing import masing
from test.hidden.third.virgin_curves import VirginCurve


def duhem(voltage_v: Array, curve: VirginCurve, reach_v: float) -> Array:
    """Return a Duhem response: dy/dv = way (f(v) - y) / length + g, f bent like a polarisation."""
    length_v, knee_v = 0.25 * reach_v, 0.9 * reach_v
    top = float(curve.slope(np.array([reach_v]))[0])
    bottom = curve.slope_um_per_v
    middle_v = 0.5 * (voltage_v[1:] + voltage_v[:-1])
    steep = top / np.cosh(middle_v / knee_v) ** 2
    step_v = np.diff(voltage_v)
    stays = np.exp(-np.abs(step_v) / length_v)
    # The distance from f is solved exactly in each step, with f taken as straight within it.
    pushed = (bottom - steep) * np.sign(step_v) * length_v * (1.0 - stays)
    distance, out = 0.0, [0.0]
    for keep, push in zip(stays.tolist(), pushed.tolist(), strict=True):
        distance = distance * keep + push
        out.append(distance)
    return np.array(out) + top * knee_v * np.tanh(voltage_v / knee_v)


def dahl(voltage_v: Array, curve: VirginCurve, reach_v: float) -> Array:
    """Return a response behind a friction of Dahl's form with an exponent other than one: minor loops do not close."""
    exponent, length_v = 1.6, 0.3 * reach_v
    top = float(curve.slope(np.array([reach_v]))[0])
    depth = 1.0 - curve.slope_um_per_v / top
    force, out = 0.0, [0.0]
    for step_v in np.diff(voltage_v).tolist():
        way = math.copysign(1.0, step_v)
        # Each step's end in closed form: with a = 1 - way f, da/dv = -a**n / length.
        left = max(1.0 - way * force, 1e-12)
        left = (left ** (1.0 - exponent) + (exponent - 1.0) * abs(step_v) / length_v) ** (1.0 / (1.0 - exponent))
        force = way * (1.0 - left)
        out.append(force)
    return top * (voltage_v - depth * length_v * np.array(out))


def accommodating(voltage_v: Array, curve: VirginCurve, reach_v: float) -> Array:
    """Return increments of a Masing response that grow with what has switched: loops drift, and depend on the past."""
    response = masing(voltage_v, curve)
    switched = response - curve.slope_um_per_v * voltage_v
    top = float(curve(np.array([reach_v]))[0]) - curve.slope_um_per_v * reach_v
    share = 0.5 * (switched[1:] + switched[:-1]) / top
    return np.concatenate([[0.0], np.cumsum(np.diff(response) * (1.0 + 0.15 * share))])


OTHER_FORMS: Mapping[str, Callable[[Array, VirginCurve, float], Array]] = {
    "duhem": duhem,
    "dahl": dahl,
    "accommodating": accommodating,
}
