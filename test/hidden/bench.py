"""The bench: an actuator, what is recorded of it, and the measuring of any drive on it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from test.hidden.circumstances import draw_circumstance
from test.hidden.handover import Recording, to_recording
from test.hidden.hysteresis import MaxwellChain, RelayPlane, draw_chain, draw_plane
from test.hidden.noise import draw_noise
from test.hidden.world import Circumstance, World


@dataclass(frozen=True)
class Setup:
    """An actuator on its bench: the world and what is recorded of it. Measures any drive."""

    seed: int
    world: World
    low_v: float
    high_v: float
    rate_hz: float
    befalls_all: bool
    has_temperature: bool
    cross_kind: str
    has_offset: bool

    def circumstance(self, n_samples: int, part: str, name: str, world: World | None = None) -> Circumstance:
        """Draw what is particular to the record of a name; the same name always meets the same."""
        return draw_circumstance(
            (world or self.world).effects,
            n_samples,
            self.rate_hz,
            part,
            self.befalls_all,
            has_temperature=self.has_temperature,
            cross_kind=self.cross_kind,
            has_offset=self.has_offset,
            rng=chance(self.seed, f"circumstance {name}"),
        )

    def clean_um(self, command_v: np.ndarray, part: str, name: str, world: World | None = None) -> np.ndarray:
        """Return the noiseless displacement [um] of a drive, in this world or a variant of it."""
        chosen = world or self.world
        return chosen.displacement_um(command_v, self.rate_hz, self.circumstance(command_v.size, part, name, chosen))

    def measure(self, command_v: np.ndarray, part: str, name: str) -> Recording:
        """Measure a drive [V] that starts at 0: a record with noise on all that is measured."""
        rng = chance(self.seed, f"noise {name}")
        circumstance = self.circumstance(command_v.size, part, name)
        measured_um = self.world.measured_um(command_v, self.rate_hz, circumstance, rng)
        temperature_c, cross = circumstance.temperature_c, circumstance.cross
        if temperature_c is not None:
            temperature_c = 23.0 + temperature_c + 5e-4 * rng.standard_normal(command_v.size)
        if self.cross_kind == "displacement":
            cross = cross + self.world.noise.draw(command_v.size, rng)
        return to_recording(
            command_v,
            measured_um,
            self.rate_hz,
            name,
            temperature_c=temperature_c,
            cross=cross,
            cross_kind=self.cross_kind,
        )


def chance(seed: int, purpose: str) -> np.random.Generator:
    """Return the source of chance of one purpose."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def with_effects(setup: Setup, effects: dict[str, dict[str, Any]]) -> Setup:
    """Return the bench with other effects in its world."""
    return replace(setup, world=replace(setup.world, effects=effects))


def draw_setup(seed: int, causes: tuple[str, ...], noise_um: float, oversampling: int, rate_hz: float) -> Setup:
    """Draw an actuator without effects and its bench; the causes to come decide what must be recorded."""
    rng = chance(seed, "actuator")
    # A dead zone about 0 V is met at all only by a drive of both signs.
    is_bipolar = rng.random() < 0.5 or "dead_zone" in causes
    shrink = rng.uniform(0.8, 1.0)
    low_v, high_v = (-2.5 * shrink, 2.5 * shrink) if is_bipolar else (0.0, 5.0 * shrink)
    stroke_um, width = rng.uniform(5.0, 10.0), rng.uniform(0.10, 0.15)
    creep_order = rng.uniform(0.01, 0.03)
    n_elements = int(rng.integers(80, 140))
    loops: RelayPlane | MaxwellChain
    kind, second = rng.random(), chance(seed, "loops")
    if kind < 0.5:
        loops = draw_plane(stroke_um, width, high_v - low_v, second)
    else:
        loops = draw_chain(stroke_um, width, high_v - low_v, n_elements, second)
    world = World(
        loops,
        max(-low_v, high_v),
        creep_order,
        {},
        draw_noise(noise_um, chance(seed, "sensor")),
        oversampling,
    )
    extras = chance(seed, "extras").random(4)
    is_crossed = "cross_axis" in causes
    return Setup(
        seed=seed,
        world=world,
        low_v=low_v,
        high_v=high_v,
        rate_hz=rate_hz,
        befalls_all=extras[0] < 0.5,
        # Columns that have nothing to do with the matter are recorded now and then too.
        has_temperature="thermal_drift" in causes or extras[1] < 0.25,
        cross_kind=("displacement" if extras[3] < 0.5 else "voltage") if is_crossed or extras[2] < 0.25 else "none",
        has_offset=bool(second.random() < 0.5),
    )
