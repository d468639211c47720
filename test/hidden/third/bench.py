"""One laboratory's actuator, amplifier range and recorder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.creep_kernel import Modes, power_law
from test.hidden.third.masing import masing
from test.hidden.third.other_forms import OTHER_FORMS
from test.hidden.third.virgin_curves import FAMILIES, VirginCurve

_LARGEST_V = (5.0, 10.0, 20.0, 60.0, 100.0, 120.0, 150.0, 200.0, 500.0, 1000.0)
_RATE_FACTORS = (0.25, 0.5, 0.5, 1.0, 2.0, 2.0, 4.0)


@dataclass(frozen=True)
class Bench:
    """What stays the same over the records of a case.

    Args:
        low_v: lowest voltage of the drives, zero or below.
        high_v: highest.
        stroke_um: of a first loading from the lowest to the highest.
        rates_hz: sampling of each record.
        n_samples: of each record.
        curve: first loading of the hysteresis.
        creep_order: of the power law.
        creep_reference_s: time at which creep has a gain of one.
        form: "masing", or one of OTHER_FORMS.
    """

    low_v: float
    high_v: float
    stroke_um: float
    rates_hz: tuple[float, ...]
    n_samples: tuple[int, ...]
    curve: VirginCurve
    creep_order: float
    creep_reference_s: float
    form: str = "masing"

    @property
    def span_v(self) -> float:
        """Range of the drives [V]."""
        return self.high_v - self.low_v

    @property
    def reach_v(self) -> float:
        """Largest voltage of either sign [V]."""
        return max(self.high_v, -self.low_v)

    @property
    def top_um(self) -> float:
        """Displacement at the highest voltage, but for creep [um]."""
        return float(self.curve(np.array([self.high_v]))[0])

    @property
    def dt_s(self) -> float:
        """Sampling of the training record [s]."""
        return 1.0 / self.rates_hz[0]

    @property
    def slowest_dt_s(self) -> float:
        """Sampling of the slowest record [s]."""
        return 1.0 / min(self.rates_hz)

    @property
    def duration_s(self) -> float:
        """Length of the training record [s]."""
        return self.n_samples[0] / self.rates_hz[0]

    @property
    def is_bipolar(self) -> bool:
        """Whether drives cross zero by far."""
        return self.low_v < -0.5 * self.high_v

    def hysteresis_um(self, voltage_v: Array) -> Array:
        """Return the response to a path of the voltage, without creep."""
        if self.form == "masing":
            return masing(voltage_v, self.curve)
        return OTHER_FORMS[self.form](voltage_v, self.curve, self.reach_v)

    def creep(self, step_s: float, duration_s: float) -> Modes:
        """Return the creep of the power law on a grid."""
        return power_law(self.creep_order, self.creep_reference_s, step_s, duration_s)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is spread evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_bench(
    rng: np.random.Generator, form: str, lengths: tuple[int, int], is_bipolar: bool, n_records: int = 3
) -> Bench:
    """Draw a bench.

    Args:
        rng: source of chance.
        form: "masing", or one of OTHER_FORMS.
        lengths: fewest and most samples of a record.
        is_bipolar: whether the drives have to cross zero.
        n_records: how many records there are.
    """
    high_v = float(rng.choice(_LARGEST_V))
    share = -1.0 if is_bipolar else float(rng.choice([0.0, -0.2, -1.0], p=[0.45, 0.2, 0.35]))
    low_v, stroke_um = high_v * share, log_uniform(rng, 0.05, 5000.0)
    rate_hz = log_uniform(rng, 1.0, 1e5)
    factors = (1.0, *(float(rng.choice(_RATE_FACTORS)) for _ in range(n_records - 1)))
    first = int(log_uniform(rng, *lengths))
    # A later record is about as long in time as the first, within the bounds: what drifts has time to.
    others = (int(np.clip(first * f * log_uniform(rng, 0.5, 1.5), *lengths)) for f in factors[1:])
    rates_hz = tuple(float(np.clip(rate_hz * f, 1.0, 1e5)) for f in factors)
    slope, bend = 1.0, log_uniform(rng, 0.15, 0.8)
    knee_v = high_v * log_uniform(rng, 0.15, 0.8)
    raw = VirginCurve(str(rng.choice(FAMILIES)), slope, bend, knee_v, float(rng.uniform(1.6, 2.3)))
    unit = stroke_um / float(np.diff(raw(np.array([low_v, high_v])))[0])
    curve = VirginCurve(raw.family, slope * unit, bend * unit, knee_v, raw.exponent)
    order, reference_s = log_uniform(rng, 0.004, 0.04), 100.0 / rate_hz
    return Bench(low_v, high_v, stroke_um, rates_hz, (first, *others), curve, order, reference_s, form)
