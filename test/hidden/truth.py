"""Hidden cases: records of an actuator with known effects in it, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from test.hidden.bench import Setup, chance, draw_setup, with_effects
from test.hidden.coarse import coarse_displacement_um, coarse_model
from test.hidden.effects import CAUSES
from test.hidden.excitation import draw_drive
from test.hidden.handover import Recording, to_model
from test.hidden.sizing import Sizing
from test.hidden.visibility import raw_and_visible_um


@dataclass(frozen=True)
class HiddenCase:
    """Records with an effect hidden in them, and the key to the riddle.

    Args:
        recordings: training records, all relaxed at their start unless initial_state is hidden.
        test: held-out record for acceptance.
        report: third record, for before and after.
        model_mapping: the model to hand to a diagnosis, as a model file holds it; None: let it fit its own.
        causes: what is hidden, in no order.
        parameters: true parameters of each cause.
        effect_rms_um: rms [um] each cause makes in the training records, the offset taken out.
        visible_rms_um: the same, with what hysteresis and creep of any parameters could absorb taken out.
        noise_um: rms [um] of the sensor noise.
        excitation: kind of drive.
        seed: what it was drawn from.
        setup: the bench, to measure further drives on.
    """

    recordings: tuple[Recording, ...]
    test: Recording
    report: Recording
    model_mapping: dict[str, object] | None
    causes: tuple[str, ...]
    parameters: dict[str, dict[str, Any]]
    effect_rms_um: dict[str, float]
    visible_rms_um: dict[str, float]
    noise_um: float
    excitation: str
    seed: int
    setup: Setup = field(repr=False)

    @property
    def model(self) -> Any:
        """The model to hand to a diagnosis, or None."""
        return None if self.model_mapping is None else to_model(self.model_mapping)


def draw_case(
    seed: int,
    causes: tuple[str, ...] = (),
    *,
    noise_um: float = 1e-3,
    excitation: str = "rich",
    oversampling: int = 20,
    rate_hz: float = 1000.0,
    n_elements: int | None = None,
) -> HiddenCase:
    """Draw an actuator with effects hidden in it, and measure it.

    Args:
        seed: source of all chance; the same seed gives the same actuator whatever is hidden.
        causes: names of what to hide; () for nothing.
        noise_um: rms of the sensor noise [um].
        excitation: "rich", "short", or a poor one (see `excitation.EXCITATIONS`).
        oversampling: steps of the physics per sample.
        rate_hz: rate of the records [Hz].
        n_elements: elements of the coarse model for missing_hysteresis; 2 or 3 at random where None.
    """
    unknown = set(causes) - set(CAUSES)
    if unknown:
        raise ValueError(f"unknown causes {sorted(unknown)}, known: {CAUSES}")
    bare = draw_setup(seed, causes, noise_um, oversampling, rate_hz)
    commands = _training_drives(bare, excitation)
    # Poor drives may not show an effect at all; its size is then what a rich drive would have shown.
    yardstick = commands if excitation in ("rich", "short") else _training_drives(bare, "rich")
    sizing = Sizing(bare, yardstick)
    parameters = {cause: sizing.fit(cause) for cause in causes if cause != "missing_hysteresis"}
    setup = with_effects(bare, dict(parameters))
    if "thermal_drift" in parameters:
        # A drift that is not the room's is one where nobody recorded a temperature.
        setup = replace(setup, has_temperature="um_per_degc" in parameters["thermal_drift"])
    actual = sizing if yardstick is commands else Sizing(bare, commands)
    sizes = {cause: actual.raw_and_visible(cause, parameters[cause]) for cause in parameters}

    model_mapping = None
    if "missing_hysteresis" in causes:
        n_coarse = n_elements or int(chance(seed, "coarse").integers(2, 4))
        model_mapping = coarse_model(
            setup.world.hysteresis, setup.world.creep_order, setup.low_v, setup.high_v, n_coarse
        )
        missed = [actual.plain[k] - coarse_displacement_um(model_mapping, c, rate_hz) for k, c in enumerate(commands)]
        parameters["missing_hysteresis"] = {"n_elements_given": n_coarse}
        sizes["missing_hysteresis"] = (raw_and_visible_um(missed, actual.basis)[0],) * 2
    if "external_load" in causes:
        events = setup.circumstance(commands[0].size, "train", "train 1").loads
        parameters["external_load"] |= {"start_s": events[0].start_s}
        parameters["external_load"] |= {"stop_s": events[1].start_s if len(events) > 1 else float("inf")}

    held_out = [
        setup.measure(
            draw_drive(excitation, part, setup.low_v, setup.high_v, rate_hz, chance(seed, f"drive {part}")),
            part,
            part,
        )
        for part in ("test", "report")
    ]
    return HiddenCase(
        recordings=tuple(setup.measure(c, "train", f"train {k + 1}") for k, c in enumerate(commands)),
        test=held_out[0],
        report=held_out[1],
        model_mapping=model_mapping,
        causes=tuple(causes),
        parameters=parameters,
        effect_rms_um={c: raw for c, (raw, _) in sizes.items()},
        visible_rms_um={c: visible for c, (_, visible) in sizes.items()},
        noise_um=noise_um,
        excitation=excitation,
        seed=seed,
        setup=setup,
    )


def _training_drives(setup: Setup, excitation: str) -> list[np.ndarray]:
    def drive(name: str, part: str) -> np.ndarray:
        return draw_drive(
            excitation, part, setup.low_v, setup.high_v, setup.rate_hz, chance(setup.seed, f"drive {name}")
        )

    if excitation == "rich" and chance(setup.seed, "split").random() < 0.25:
        return [drive("train 1", "test"), drive("train 2", "test")]
    return [drive("train 1", "train")]
