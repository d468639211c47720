"""One case of the third world, drawn from its seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, draw_bench, log_uniform
from test.hidden.third.catalogue import EFFECTS
from test.hidden.third.causes_of_material import IN_MOTION, MISSING
from test.hidden.third.chain import readings_um
from test.hidden.third.drives import draw_kinds
from test.hidden.third.effect import Hidden
from test.hidden.third.frame import Frame, draw_frame
from test.hidden.third.sensor_noise import NOISE_KINDS, draw_noise
from test.hidden.third.sizing import Visible, sized, visible
from test.hidden.third.surrogate import Base

NAMES = ("train", "test", "report")
_N_ATTEMPTS = 20
# Noise over the stroke: from a good capacitive sensor to a poor strain gauge.
_NOISE_SHARES = (1e-4, 3e-3)
# What the base leaves where nothing is hidden, over the noise, is at most this: then a base that is right exists.
_LEAST_HONEST = 1.0 / 3.0
# Chance of a column beside the record's own that has nothing to do with what is read.
_INNOCENT = 0.15


@dataclass(frozen=True)
class Record:
    """What was measured, and what would have been without noise."""

    name: str
    time_s: Array
    voltage_v: Array
    measured_um: Array
    clean_um: Array
    temperature_c: Array | None
    cross_voltage_v: Array | None
    cross_displacement_um: Array | None


@dataclass(frozen=True)
class ThirdCase:
    """Three records and the key to them.

    Args:
        records: to train, to test, to report.
        bench: they were made on.
        hidden: what acts.
        visible_um: of each hidden effect alone, or of a form of hysteresis.
        noise_kind: one of NOISE_KINDS.
        noise_um: rms.
        drive_kinds: of each record.
        n_attempts: draws until the effects were visible.
    """

    records: tuple[Record, ...]
    bench: Bench
    hidden: tuple[Hidden, ...]
    visible_um: dict[str, Visible]
    noise_kind: str
    noise_um: float
    drive_kinds: tuple[tuple[str, ...], ...]
    n_attempts: int

    @property
    def n_coarse_elements(self) -> int | None:
        """Elements of the model to hand over, where one that lacks some is hidden."""
        return next((one.values["n_elements"] for one in self.hidden if one.effect.name == MISSING), None)


@dataclass(frozen=True)
class Order:
    """What a case is to be.

    Args:
        causes: what is hidden.
        form: of the hysteresis: "masing" or one of OTHER_FORMS.
        noise: kind, at random where None.
        lengths: fewest and most samples of a record.
    """

    causes: tuple[str, ...] = ()
    form: str = "masing"
    noise: str | None = None
    lengths: tuple[int, int] = (2000, 20_000)


def draw(seed: int, order: Order) -> ThirdCase:
    """Draw a case.

    Raises:
        ValueError: if what is hidden cannot be made visible in any of twenty draws.
    """
    for attempt in range(_N_ATTEMPTS):
        case = _attempt(np.random.default_rng([seed, attempt]), order, attempt + 1)
        if case is not None:
            return case
    raise ValueError(f"seed {seed}: {order.causes or order.form} not visible in {_N_ATTEMPTS} draws")


def _attempt(rng: np.random.Generator, order: Order, n_attempts: int) -> ThirdCase | None:
    needs = frozenset[str]().union(*(EFFECTS[c].needs for c in order.causes))
    bench = draw_bench(rng, order.form, order.lengths, "bipolar" in needs)
    hidden = [EFFECTS[c].drawn(bench, rng) for c in order.causes]
    kinds = draw_kinds(rng, "smooth" in needs)
    wanted = _columns(rng, needs)
    if any(one.values.get("kind") == IN_MOTION for one in hidden):
        wanted |= {"motion"}
    frames = [draw_frame(rng, bench, k, kinds[k], wanted) for k in range(len(NAMES))]
    bases = [Base(frame) for frame in frames[:2]]
    noise_um = bench.stroke_um * log_uniform(rng, *_NOISE_SHARES)
    ratio = log_uniform(rng, 7.0, 32.0)
    visible_um: dict[str, Visible] = {}
    if order.form == "masing" and "motion" not in wanted:
        plain = visible([], frames, bases)
        noise_um = max(noise_um, max(plain.training_um, plain.test_um) / _LEAST_HONEST)
    elif order.form != "masing":
        visible_um[order.form] = visible([], frames, bases)
        noise_um = visible_um[order.form].training_um / ratio
    for k, one in enumerate(hidden):
        name = one.effect.name
        if name == MISSING:
            few = [Base(frame, one.values["n_elements"]) for frame in frames[:2]]
            visible_um[name] = visible([], frames, few)
        else:
            hidden[k] = sized(one, frames, bases, ratio * noise_um)
            visible_um[name] = visible([hidden[k]], frames, bases)
    if not all(v.is_within_promise(noise_um) for v in visible_um.values()):
        return None
    noise_kind = order.noise or str(rng.choice(NOISE_KINDS))
    share = float(rng.random())
    records = tuple(_measured(rng, frame, hidden, noise_kind, (noise_um, share)) for frame in frames)
    return ThirdCase(records, bench, tuple(hidden), visible_um, noise_kind, noise_um, kinds, n_attempts)


def _columns(rng: np.random.Generator, needs: frozenset[str]) -> frozenset[str]:
    """Draw what is recorded beside displacement: what an effect needs, or what a lab has anyway."""
    columns = set()
    if rng.random() < (0.5 if "perhaps_temperature" in needs else _INNOCENT):
        columns.add("temperature")
    if "second_axis" in needs or rng.random() < _INNOCENT:
        columns.add(str(rng.choice(["cross_voltage", "cross_displacement"])))
    return frozenset(columns)


def _measured(
    rng: np.random.Generator, frame: Frame, hidden: Sequence[Hidden], kind: str, noise: tuple[float, float]
) -> Record:
    clean_um = readings_um(frame, hidden)
    noise_um, share = noise
    return Record(
        NAMES[frame.index],
        np.arange(frame.n_samples) * frame.dt_s,
        frame.recorded_v,
        clean_um + draw_noise(rng, kind, clean_um, noise_um, share),
        clean_um,
        frame.temperature_c,
        frame.cross_voltage_v,
        frame.cross_displacement_um,
    )
