"""The loop is not symmetric about its centre: rising and falling branch differ."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import knee_block, run_knees, with_plays_of
from fomrc_core.effects.base.step_form import Fields, Number, StateField, StepForm
from fomrc_core.errors import ParameterError
from fomrc_core.records.drive import MANY_LOOPS

# Of the range of the drive, half widths and knees of the family: as fine as loops of few, or of many, kinds determine.
_THRESHOLD_SHARES = (0.0, 0.03, 0.1, 0.25, 0.45)
_KNEE_SHARES = (0.15, 0.38, 0.62, 0.85)
_FINE_THRESHOLD_SHARES = (0.0, 0.015, 0.04, 0.08, 0.15, 0.25, 0.37, 0.5)
_FINE_KNEE_SHARES = (0.08, 0.2, 0.32, 0.44, 0.56, 0.68, 0.8, 0.92)


def _move(s: Fields, c: Fields, value: float) -> Number:
    total = 0.0
    for j in range(len(c.thresholds_v)):
        s.plays[j] = min(max(s.plays[j], value - c.thresholds_v[j]), value + c.thresholds_v[j])
        total = total + c.weights_um_per_v[j] * (max(s.plays[j], c.knees_v[j]) - max(0.0, c.knees_v[j]))
    return total


def _peek(s: Fields, c: Fields, value: float) -> Number:
    total = 0.0
    for j in range(len(c.thresholds_v)):
        play = min(max(s.plays[j], value - c.thresholds_v[j]), value + c.thresholds_v[j])
        total = total + c.weights_um_per_v[j] * (max(play, c.knees_v[j]) - max(0.0, c.knees_v[j]))
    return total


def _warp(c: Fields, value: float) -> Number:
    return value * (1.0 + value * (c.warp_per_v + c.warp_per_v2 * value))


def _unwarp(c: Fields, value: float) -> Number:
    # Newton's method, as in ``unwarp``; not a number where the warp turns back.
    drive = value
    for _ in range(60):
        slope = 1.0 + drive * (2.0 * c.warp_per_v + 3.0 * c.warp_per_v2 * drive)
        if slope <= 0.0:
            return math.nan
        step = (drive * (1.0 + drive * (c.warp_per_v + c.warp_per_v2 * drive)) - value) / slope
        drive = drive - step
        if abs(step) <= 1e-15 * (1.0 + abs(drive)):
            break
    return drive


@dataclass(frozen=True)
class AsymmetricHysteresis(Effect):
    """A warp of the drive before the elements, and plays that count only above a knee beside them.

    The warp u + q u^2 + c u^3 stretches the thresholds over the range. The plays, of either sign, make hysteresis
    depend on where in the range it happens (threshold zero is a bend of the drive itself): a coarse Preisach density
    that depends on the mean as well as on the width.
    """

    name: ClassVar[str] = "asymmetric_hysteresis"
    stage: ClassVar[Stage] = Stage.HYSTERESIS
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("thresholds_v", "V", 0.0, 1e6, is_list=True, description="half widths of the one-sided plays"),
        Parameter("knees_v", "V", -1e6, 1e6, is_list=True, description="where each begins to count"),
        Parameter("weights_um_per_v", "um/V", -1e6, 1e6, is_list=True, description="their weights"),
        Parameter("warp_per_v", "1/V", -1e6, 1e6, description="quadratic warp of the drive"),
        Parameter("warp_per_v2", "1/V^2", -1e12, 1e12, description="cubic warp of the drive"),
    )
    main_parameter: ClassVar[str] = "weights_um_per_v"
    meaning: ClassVar[str] = "Poled ceramic switches more easily along the poling field than against it."
    signature: ClassVar[str] = "residual depends on voltage and branch: rising and falling halves differ in shape"
    experiment: ClassVar[str] = "small slow triangles about several mean voltages: loops of unequal width and slope"
    inverse_note: ClassVar[str] = "inverted by a scalar search, while displacement still rises with voltage"
    bends_to_much: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True
    owns_columns: ClassVar[bool] = True
    is_exchangeable: ClassVar[bool] = False  # only the last look exchanges its plays
    needs_many_loops: ClassVar[bool] = True  # one-sided plays bend to any lag in a loop that repeats
    needs_loops: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um_per_v", "warp_per_v", "warp_per_v2")

    thresholds_v: tuple[float, ...] = ()
    knees_v: tuple[float, ...] = ()
    weights_um_per_v: tuple[float, ...] = ()
    warp_per_v: float = 0.0
    warp_per_v2: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_alike("thresholds_v", "knees_v", "weights_um_per_v")

    def initial_state(self) -> Array:
        """Return the packed one-sided plays, relaxed."""
        return knee_block(*self.plays())

    def plays(self) -> tuple[Array, Array, Array]:
        """Return thresholds [V], knees [V] and weights [um/V] of the one-sided plays."""
        return np.array(self.thresholds_v), np.array(self.knees_v), np.array(self.weights_um_per_v)

    def with_plays(self, thresholds_v: Array, knees_v: Array, weights_um_per_v: Array) -> AsymmetricHysteresis:
        """Return the same warp with these one-sided plays."""
        return replace(
            self,
            thresholds_v=tuple(thresholds_v.tolist()),
            knees_v=tuple(knees_v.tolist()),
            weights_um_per_v=tuple(weights_um_per_v.tolist()),
        )

    def free_names(self) -> tuple[str, ...]:
        """Return the warp; the weights belong to the linear part of a fit."""
        return ("warp_per_v", "warp_per_v2")

    def scale_of(self, name: str, value: float) -> float:
        """Return a unit for a warp that stands at zero."""
        return max(abs(value), 1e-3)

    def warp(self, drive_v: Array) -> Array:
        """Return the warped drive [V], which the elements see."""
        if self.warp_per_v == 0.0 and self.warp_per_v2 == 0.0:
            return drive_v
        return drive_v * (1.0 + drive_v * (self.warp_per_v + self.warp_per_v2 * drive_v))

    def unwarp(self, warped_v: Array) -> Array:
        """Return the drive [V] that gives a warped one, by Newton's method from the drive itself.

        Raises:
            ParameterError: the warp turns back within the range asked for.
        """
        drive = warped_v
        for _ in range(60):
            slope = 1.0 + drive * (2.0 * self.warp_per_v + 3.0 * self.warp_per_v2 * drive)
            if np.any(slope <= 0.0):
                raise ParameterError(
                    "drive warp turns back",
                    where=self.name,
                    value=self.warp_per_v,
                    allowed="a warp that rises over the range",
                )
            step = (self.warp(drive) - warped_v) / slope
            drive = drive - step
            if np.all(np.abs(step) <= 1e-15 * (1.0 + np.abs(drive))):
                break
        return drive

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the amplifier that ends where a way from zero is broken off most: plays with a knee can be that too.

        Upward a play begins to count at its threshold and knee together, and breaks the way off with a negative weight;
        downward it ceases there, and does so with a positive one.
        """
        thresholds_v, knees_v, weights = self.plays()
        up, down = np.where(knees_v >= 0.0, -weights, 0.0), np.where(knees_v < 0.0, weights, 0.0)
        if not max(np.max(up, initial=0.0), np.max(down, initial=0.0)) > 0.0:
            return {}
        if np.max(up) >= np.max(down):
            at = int(np.argmax(up))
            return {"amplifier_saturation": {"high_v": float(knees_v[at] + thresholds_v[at])}}
        at = int(np.argmax(down))
        return {"amplifier_saturation": {"low_v": float(knees_v[at] - thresholds_v[at])}}

    def carried_state(self, old: Array) -> Array:
        """Return the packed plays where those of another left them, with thresholds and weights of its own."""
        return with_plays_of(self.initial_state(), old)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return what is added to the elements' sum [um], shape (n_samples,), for the warped drive [V]."""
        out = np.empty(values.size)
        run_knees(state, values, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        is_warped = self.warp_per_v != 0.0 or self.warp_per_v2 != 0.0
        form = StepForm(
            constants=(("warp_per_v", self.warp_per_v), ("warp_per_v2", self.warp_per_v2)),
            warp=_warp if is_warped else None,
            unwarp=_unwarp if is_warped else None,
        )
        if not self.thresholds_v:
            return form
        plays = (
            ("thresholds_v", self.thresholds_v),
            ("knees_v", self.knees_v),
            ("weights_um_per_v", self.weights_um_per_v),
        )
        return replace(
            form,
            constants=(*form.constants, *plays),
            state=(StateField("plays", (0.0,) * len(self.thresholds_v), is_array=True, comment="[V]"),),
            forward=_move,
            beside=_peek,
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AsymmetricHysteresis]:
        """Return the whole family of one-sided plays over the drive's range, with zero weights, and warps alone.

        Where the drive makes few kinds of loops the family is small: what no loop has shown, a weight would invent.
        """
        low, span = evidence.smallest_v, evidence.largest_v - evidence.smallest_v
        if not span > 0.0:
            return []
        is_rich = evidence.n_loop_kinds >= MANY_LOOPS
        shares = _FINE_THRESHOLD_SHARES if is_rich else _THRESHOLD_SHARES
        knees = _FINE_KNEE_SHARES if is_rich else _KNEE_SHARES
        pairs = [(span * t, low + span * k) for t in shares for k in knees]
        family = {
            "thresholds_v": tuple(t for t, _ in pairs),
            "knees_v": tuple(k for _, k in pairs),
            "weights_um_per_v": (0.0,) * len(pairs),
        }
        return cls.proposed([family, {"warp_per_v": 1e-3 / span}, {"warp_per_v2": 1e-3 / span**2}])
