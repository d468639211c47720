"""Which hysteresis an actuator has, drawn at random: forms a stack of plays can be, and forms it cannot."""

from __future__ import annotations

import numpy as np

from test.hidden.second.actuator import Loops
from test.hidden.second.bouc_wen import BoucWen
from test.hidden.second.plays import GeneralisedPlays, PlayStack
from test.hidden.second.preisach import discretised, gaussian_density, grid, lorentzian_density
from test.hidden.second.scale import Scale, log_uniform

REPRESENTABLE = ("few_plays", "many_plays", "smooth_stack")
OTHER = ("preisach_gaussian", "preisach_lorentzian", "bouc_wen", "generalised_plays", "odd_envelope")
PLAY_FORMS = REPRESENTABLE  # a cause that acts on single plays needs one of them
_N_SMOOTH = 400


def draw_loops(form: str, scale: Scale, rng: np.random.Generator) -> Loops:
    """Draw an actuator's hysteresis whose stroke and relative width are those of piezos: 5 to 20 % of the stroke."""
    reach = scale.reach_v
    slope = scale.stroke_um / scale.span_v
    width = rng.uniform(0.05, 0.2)
    if form in REPRESENTABLE:
        return _stack(form, slope, width, reach, rng)
    if form in ("preisach_gaussian", "preisach_lorentzian"):
        edges_v, up, down = grid(1.1 * reach)
        coercive_v, spread_v = rng.uniform(0.05, 0.3) * reach, rng.uniform(0.15, 0.5) * reach
        bias_v = rng.uniform(-0.2, 0.2) * reach
        if form == "preisach_gaussian":
            density = gaussian_density(
                up, down, coercive_v=coercive_v, spread_v=spread_v, correlation=rng.uniform(0.0, 0.8), bias_v=bias_v
            )
        else:
            density = lorentzian_density(up, down, coercive_v=coercive_v, spread_v=spread_v, bias_v=bias_v)
        return discretised(density, 2.0 * width * slope * reach, (1.0 - width) * slope, edges_v)
    if form == "bouc_wen":
        scale_v = rng.uniform(0.1, 0.5) * reach
        beta = rng.uniform(0.4, 1.0)
        gamma = rng.uniform(-0.4, 0.8) * beta
        exponent = rng.uniform(1.0, 2.0)
        # What z comes to at most, so that the loop is as wide as it should be.
        largest = (beta + gamma) ** (-1.0 / exponent)
        lag_um = min(0.5 * width * slope * scale.span_v / largest, 0.6 * slope * scale_v)
        return BoucWen(slope * (1.0 + 0.5 * width), lag_um, scale_v, exponent, beta, gamma)
    stack = _stack("many_plays", slope, width, reach, rng)
    bends = rng.uniform(0.02, 0.2, 3) * rng.choice([-1.0, 1.0], 3)
    if form == "generalised_plays":
        bend, widening = (bends[0], 0.5 * bends[1]), bends[2]
    elif form == "odd_envelope":
        bend, widening = (0.0, bends[0]), 0.0
    else:
        raise ValueError(f"hysteresis {form!r}, one of {(*REPRESENTABLE, *OTHER)}")
    return GeneralisedPlays(stack.slope_um_per_v, stack.thresholds_v, stack.weights_um_per_v, reach, bend, widening)


def _stack(form: str, slope: float, width: float, reach_v: float, rng: np.random.Generator) -> PlayStack:
    """Draw plays; their weights together are a share of the slope that makes the loop as wide as asked for."""
    if form == "few_plays":
        n = int(rng.integers(3, 9))
        thresholds_v = np.sort(rng.uniform(0.03, 0.85, n)) * reach_v
        weights = rng.dirichlet(np.full(n, 3.0))
    elif form == "many_plays":
        n = int(rng.integers(15, 50))
        thresholds_v = np.sort(rng.uniform(0.01, 0.95, n)) * reach_v
        weights = rng.dirichlet(np.full(n, 2.0))
    else:
        thresholds_v = (np.arange(_N_SMOOTH) + 0.5) / _N_SMOOTH * reach_v
        decay_v = log_uniform(rng, 0.1, 1.0) * reach_v
        hump = rng.uniform(0.0, 1.0)
        weights = (1.0 - hump + hump * thresholds_v / decay_v) * np.exp(-thresholds_v / decay_v)
        weights /= weights.sum()
    # Mid-loop, a play of threshold r is 2 r wide while it slides.
    mean_share = float(weights @ np.minimum(thresholds_v, reach_v - thresholds_v)) / reach_v
    share = min(0.6, width / max(mean_share, 1e-3) / 2.0)
    return PlayStack((1.0 - share) * slope, thresholds_v, share * slope * weights)
