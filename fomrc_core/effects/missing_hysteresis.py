"""The model has too few Maxwell elements for the actuator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.kernels import plain_block, run_knees, with_plays_of
from fomrc_core.effects.base.step_form import Fields, Number, StateField, StepForm


def _move(s: Fields, c: Fields, value: float) -> Number:
    total = 0.0
    for j in range(len(c.thresholds_v)):
        s.plays[j] = min(max(s.plays[j], value - c.thresholds_v[j]), value + c.thresholds_v[j])
        total = total + c.weights_um_per_v[j] * s.plays[j]
    return total


def _peek(s: Fields, c: Fields, value: float) -> Number:
    total = 0.0
    for j in range(len(c.thresholds_v)):
        play = min(max(s.plays[j], value - c.thresholds_v[j]), value + c.thresholds_v[j])
        total = total + c.weights_um_per_v[j] * play
    return total


@dataclass(frozen=True)
class MissingHysteresis(Effect):
    """Further play operators beside those of the model; a diagnosis folds them into the model's elements."""

    name: ClassVar[str] = "missing_hysteresis"
    stage: ClassVar[Stage] = Stage.HYSTERESIS
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("n_elements", "1", 0.0, 1e4, description="number of elements the data ask for"),
        Parameter("thresholds_v", "V", 0.0, 1e6, is_list=True, description="half widths of the added plays"),
        Parameter("weights_um_per_v", "um/V", -1e6, 1e6, is_list=True, description="their weights"),
    )
    main_parameter: ClassVar[str] = "n_elements"
    meaning: ClassVar[str] = "The ceramic has more kinds of domains than the model has elements."
    signature: ClassVar[str] = "residual has corners at fixed distances after each turning point, at any speed"
    experiment: ClassVar[str] = "slow triangles of many amplitudes"
    inverse_note: ClassVar[str] = "inverted: the elements join those of the model"
    can_invert: ClassVar[bool] = True
    adds_elements: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um_per_v",)

    n_elements: float
    thresholds_v: tuple[float, ...] = ()
    weights_um_per_v: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_alike("thresholds_v", "weights_um_per_v")

    def initial_state(self) -> Array:
        """Return the packed plays, relaxed."""
        return plain_block(np.array(self.thresholds_v), np.array(self.weights_um_per_v))

    def carried_state(self, old: Array) -> Array:
        """Return the packed plays where those of another left them, with thresholds and weights of its own."""
        return with_plays_of(self.initial_state(), old)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return what is added to the elements' sum [um], shape (n_samples,), for the drive [V]."""
        out = np.empty(values.size)
        run_knees(state, values, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        if not self.thresholds_v:
            return StepForm()
        return StepForm(
            constants=(("thresholds_v", self.thresholds_v), ("weights_um_per_v", self.weights_um_per_v)),
            state=(StateField("plays", (0.0,) * len(self.thresholds_v), is_array=True, comment="[V]"),),
            forward=_move,
            beside=_peek,
        )
