"""What a previewing inverse remembers beside hysteresis and creep: some samples of targets and voltages."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled


@compiled
def _shift_in(window: Array, value: float) -> None:
    for k in range(window.size - 1):
        window[k] = window[k + 1]
    window[-1] = value


@compiled
def _note_step(voltages: Array, inner: Array, bends: Array, newest: Array, voltage: float, inner_v: float) -> None:
    for k in range(voltages.size - 1):
        voltages[k] = voltages[k + 1]
    voltages[-1] = voltage
    for k in range(inner.size - 1):
        inner[k] = inner[k + 1]
    inner[-1] = inner_v
    for i in range(bends.shape[0]):
        for k in range(bends.shape[1] - 1):
            bends[i, k] = bends[i, k + 1]
        bends[i, -1] = newest[i]
        newest[i] = 0.0


def _no_bends() -> Array:
    return np.zeros((0, 1))


@dataclass
class PreviewWindow:
    """Samples a period apart, the oldest first; all that is forgotten is older than dynamics remember.

    Attributes:
        n_preview: how many targets lie ahead of where the stage is to be now.
        targets_um: past targets, the one for now, those ahead [um], shape (n_behind + 1 + n_preview,).
        voltages_v: voltages driven [V], the last at the end, shape (n_driven,).
        inner_v: what the amplifier made of them, the voltage of the hysteresis [V], shape (n_driven,).
        bends_v: bends of the hysteresis within past samples [V], shape (n_bends, n_bends_behind).
        is_followed: whether the targets are those that are followed; else the next one begins anew.
        n_missed: periods since the last target that passed without one.
        planned_bends_v: bends within the step that was planned last [V], shape (n_bends,).
    """

    n_preview: int
    targets_um: Array
    voltages_v: Array
    inner_v: Array
    bends_v: Array = field(default_factory=_no_bends)
    is_followed: bool = False
    n_missed: int = 0
    planned_bends_v: Array = field(init=False)
    _present: int = field(init=False)

    def __post_init__(self) -> None:
        self.planned_bends_v = np.zeros(self.bends_v.shape[0])
        self._present = int(self.targets_um.size) - 1 - self.n_preview

    @property
    def present(self) -> int:
        """Where the target for now stands."""
        return self._present

    @property
    def desired_um(self) -> float:
        """Where the stage is to be now [um]."""
        return float(self.targets_um[self._present])

    def begin(self, position_um: float, voltage_v: float, inner_v: float) -> None:
        """Begin at rest at a position [um], with a voltage [V] and what the amplifier makes of it [V]."""
        self.targets_um[:] = position_um
        self.voltages_v[:] = voltage_v
        self.inner_v[:] = inner_v
        self.bends_v[:] = 0.0
        self.is_followed, self.n_missed = True, 0

    def forget_targets(self) -> None:
        """Something else than targets is followed: the next target begins anew, from where the stage is then."""
        self.is_followed = False

    def take(self, target_um: float) -> None:
        """Take the newest target [um], a period after the one before; those missed lie on the line between."""
        if self.n_missed:
            last_um, n = float(self.targets_um[-1]), self.n_missed + 1
            self.n_missed = 0
            for k in range(max(1, n - self.targets_um.size), n):
                _shift_in(self.targets_um, last_um + (target_um - last_um) * k / n)
        _shift_in(self.targets_um, target_um)

    def see(self, ahead_um: Array) -> None:
        """Take what is ahead outright: the target for now and all those of the preview [um], (n_preview + 1,)."""
        self.take(float(self.targets_um[-1]))
        self.targets_um[self._present :] = ahead_um

    def note(self, voltage_v: float, inner_v: float) -> None:
        """Note the voltage of a period [V], what the amplifier made of it [V], and the bends that were planned."""
        _note_step(self.voltages_v, self.inner_v, self.bends_v, self.planned_bends_v, voltage_v, inner_v)

    def forget_plan(self) -> None:
        """Something else than the plan is driven: how hysteresis bends then is not known."""
        self.planned_bends_v[:] = 0.0

    def hold(self, n_periods: int) -> None:
        """Note that for some periods nothing new was driven and no target came."""
        self.n_missed += n_periods
        self.forget_plan()
        for _ in range(min(n_periods, self.voltages_v.size)):
            self.note(float(self.voltages_v[-1]), float(self.voltages_v[-1]))
