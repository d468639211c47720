"""What a hidden effect is: where it acts, how it is drawn, and what makes it stronger."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench
from test.hidden.third.frame import Frame

Values = Mapping[str, Any]
Act = Callable[[Array, Values, Frame], Array]

# In the order of the chain. Those of REPLACED take the place of what a bench has there, so two exclude each other.
STAGES = ("command", "path", "drive", "hysteresis", "strain", "creep", "late", "motion", "clock", "reading")
REPLACED = frozenset({"path", "hysteresis", "creep"})


@dataclass(frozen=True)
class Effect:
    """A kind of effect.

    Args:
        name: of the cause, or of what the library has no cause for.
        draw: parameters at strength one, in the names and units of docs/causes.md where it has them; three in a tuple
            are the records' own.
        acts: by stage, what it does to the signal there.
        powers: for each parameter that grows with the strength, the power of it.
        strengths: weakest and strongest that make sense.
        needs: of a bench: "bipolar", "smooth"; of records: see `frame.draw_frame`.
        before: what happened before a record, which gets its past by it.
    """

    name: str
    draw: Callable[[Bench, np.random.Generator], dict[str, Any]]
    acts: Mapping[str, Act] = field(default_factory=dict)
    powers: Mapping[str, float] = field(default_factory=dict)
    strengths: tuple[float, float] = (1e-3, 1e3)
    needs: frozenset[str] = frozenset()
    before: Callable[[Frame, Values], Frame] | None = None

    def drawn(self, bench: Bench, rng: np.random.Generator) -> Hidden:
        """Draw the effect at strength one."""
        return Hidden(self, self.draw(bench, rng))


@dataclass(frozen=True)
class Hidden:
    """An effect with its parameters."""

    effect: Effect
    values: Values

    def stronger(self, factor: float) -> Hidden:
        """Return the same effect at another strength."""
        scaled = dict(self.values)
        for name in self.effect.powers.keys() & scaled.keys():
            value, by = scaled[name], factor ** self.effect.powers[name]
            scaled[name] = tuple(v * by for v in value) if isinstance(value, tuple) else value * by
        return replace(self, values=scaled)
