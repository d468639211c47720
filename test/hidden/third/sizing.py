"""How strong a hidden effect is made: by what a re-fitted base without it leaves, over the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from test.hidden.third.chain import readings_um
from test.hidden.third.effect import Hidden
from test.hidden.third.frame import Frame
from test.hidden.third.surrogate import Base

# Over the noise's rms in the training record, and in the test record, which the base has not seen. Beyond the second's
# bound the two records are so unlike that a laboratory would have seen what is wrong without any model.
VISIBLE_IN_TRAINING = (6.0, 40.0)
VISIBLE_IN_TEST = (4.0, 120.0)
# Within a factor of this the strength is right: what is wanted is drawn anyway.
_CLOSE = 1.25
_N_TRIALS = 8


@dataclass(frozen=True)
class Visible:
    """What a base leaves of an effect, rms [um].

    Args:
        training_um: of the record it is fitted to.
        test_um: of the next.
    """

    training_um: float
    test_um: float

    def is_within_promise(self, noise_um: float) -> bool:
        """Return whether that is visible beside a noise, and not so large that anything would find it."""
        parts = ((self.training_um, VISIBLE_IN_TRAINING), (self.test_um, VISIBLE_IN_TEST))
        return all(low <= left_um / noise_um <= high for left_um, (low, high) in parts)


def visible(hidden: Sequence[Hidden], frames: Sequence[Frame], bases: Sequence[Base]) -> Visible:
    """Return what bases of the first two records leave of effects."""
    fit, training_um = bases[0].fit(readings_um(frames[0], hidden))
    return Visible(training_um, bases[1].left_by(fit, readings_um(frames[1], hidden)))


def sized(hidden: Hidden, frames: Sequence[Frame], bases: Sequence[Base], wanted_um: float) -> Hidden:
    """Return an effect at about the strength at which a base leaves what is wanted in the training record.

    Args:
        hidden: the effect at strength one.
        frames: of the records.
        bases: of the first two of them.
        wanted_um: rms.
    """
    if not hidden.effect.powers.keys() & hidden.values.keys():
        return hidden
    weakest, strongest = hidden.effect.strengths
    tried: list[tuple[float, float]] = []
    strength = 1.0
    for _ in range(_N_TRIALS):
        _, left_um = bases[0].fit(readings_um(frames[0], [hidden.stronger(strength)]))
        tried.append((float(np.log(strength)), float(np.log(max(left_um, 1e-30) / wanted_um))))
        if abs(tried[-1][1]) < np.log(_CLOSE):
            break
        following = float(np.clip(np.exp(_next(tried)), weakest, strongest))
        if any(abs(np.log(following) - s) < 1e-3 for s, _ in tried):
            break
        strength = following
    best = min(tried, key=lambda pair: abs(pair[1]))
    return hidden.stronger(float(np.exp(best[0])))


def _next(tried: list[tuple[float, float]]) -> float:
    """Return where a straight line through the nearest trials, of logarithms, crosses zero; a decade away at most."""
    at, left = tried[-1]
    below = [t for t in tried if t[1] < 0.0]
    above = [t for t in tried if t[1] > 0.0]
    if below and above:
        (a, low), (b, high) = max(below, key=lambda t: t[1]), min(above, key=lambda t: t[1])
        # Between them, but no closer to either than a tenth: some effects set in of a sudden.
        share = float(np.clip(-low / (high - low), 0.1, 0.9))
        return a + share * (b - a)
    return at - float(np.clip(left, -np.log(10.0), np.log(10.0)))
