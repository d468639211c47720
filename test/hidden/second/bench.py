"""A bench drawn at random: an actuator, its scales, and the drives of three records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.second.actuator import Actuator
from test.hidden.second.creep import PowerLaw
from test.hidden.second.drives import draw_kinds, programme
from test.hidden.second.hidden_causes import ON_PLAYS
from test.hidden.second.hysteresis_forms import OTHER, REPRESENTABLE, draw_loops
from test.hidden.second.scale import Scale, draw_scale
from test.hidden.second.surrogate import Trace

PARTS = ("train", "test", "report")
_FINE_STEPS = 120_000  # of the physics in the training record, if that is 4 to 10 a sample


@dataclass
class Bench:
    """An actuator with nothing hidden yet, and what it is to be driven with.

    Args:
        actuator: without effects.
        form: of its hysteresis.
        creep_order: of its power law.
        scale: of the bench.
        traces: drives of train, test and report.
        kinds: what they are made of.
        befalls_all: whether loads and earlier excursions befall the held-out records too.
    """

    actuator: Actuator
    form: str
    creep_order: float
    scale: Scale
    traces: tuple[Trace, ...]
    kinds: dict[str, tuple[str, ...]]
    befalls_all: bool

    @property
    def command_v(self) -> np.ndarray:
        """Drive of the training record [V]."""
        return self.traces[0].command_v

    @property
    def largest_rate_v_per_s(self) -> float:
        """Fastest motion of the training drive, but for single steps [V/s]."""
        rates = np.abs(np.diff(self.command_v)) * self.scale.rate_hz
        return float(np.quantile(rates[rates > 0.0], 0.95))


def draw_bench(
    rng: np.random.Generator, causes: tuple[str, ...], form: str, n_samples: tuple[int, int], extent: str = "any"
) -> Bench:
    """Draw a bench on which the causes to come can be seen at all.

    Args:
        rng: source of chance.
        causes: what is to be hidden.
        form: "representable", "other" or a form of `hysteresis_forms`.
        n_samples: least and most samples of the training record.
        extent: of the scales, "any" or "usual".
    """
    # A dead zone about 0 V is met at all only by a drive of both signs.
    polarity = ("bipolar", "skewed")[int(rng.integers(2))] if "dead_zone" in causes else None
    scale = draw_scale(rng, n_samples, polarity, extent)
    if form in ("representable", "other"):
        forms = REPRESENTABLE if form == "representable" or any(c in ON_PLAYS for c in causes) else OTHER
        if "rate_dependent_hysteresis" in causes:
            forms = ("few_plays", "many_plays")
        form = forms[int(rng.integers(len(forms)))]
    order = rng.uniform(0.005, 0.04)
    loops = draw_loops(form, scale, rng)
    creep_law = PowerLaw(order, scale.duration_s)
    oversampling = int(np.clip(_FINE_STEPS // scale.n_samples, 4, 10))
    traces, kinds, used = [], {}, ()
    for part in PARTS:
        kinds[part] = draw_kinds(part, scale.n_samples, used, rng)
        used = used or kinds[part]
        n = scale.n_samples if part == "train" else max(150, round(rng.uniform(0.4, 0.7) * scale.n_samples))
        rates = (0.5, 2.0) if "zero_order_hold" in causes else (0.5, 1.0, 2.0)
        step_s = scale.step_s if part == "train" else scale.step_s / rates[int(rng.integers(len(rates)))]
        traces.append(Trace(programme(scale, n, kinds[part], part, rng), step_s))
    return Bench(
        actuator=Actuator(loops, creep_law, scale.reach_v, {}, oversampling),
        form=form,
        creep_order=order,
        scale=scale,
        traces=tuple(traces),
        kinds=kinds,
        befalls_all=bool(rng.random() < 0.5),
    )
