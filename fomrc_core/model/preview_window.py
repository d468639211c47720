"""What a previewing inverse remembers beside hysteresis and creep: some samples of targets and voltages."""

from __future__ import annotations

from dataclasses import dataclass, field

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled


@compiled
def _shift_in(window: Array, value: float) -> None:
    for k in range(window.size - 1):
        window[k] = window[k + 1]
    window[-1] = value


@dataclass
class PreviewWindow:
    """Samples a period apart, the oldest first; all that is forgotten is older than dynamics remember.

    Attributes:
        n_preview: how many targets lie ahead of where the stage is to be now.
        targets_um: past targets, the one for now, those ahead [um], shape (n_behind + 1 + n_preview,).
        voltages_v: voltages driven [V], the last at the end, shape (n_driven,).
        inner_v: what the amplifier made of them, the voltage of the hysteresis [V], shape (n_driven,).
        is_followed: whether the targets are those that are followed; else the next one begins anew.
        n_missed: periods since the last target that passed without one.
    """

    n_preview: int
    targets_um: Array
    voltages_v: Array
    inner_v: Array
    is_followed: bool = False
    n_missed: int = 0
    _present: int = field(init=False)

    def __post_init__(self) -> None:
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
        """Note the voltage of a period [V], and what the amplifier made of it [V]."""
        _shift_in(self.voltages_v, voltage_v)
        _shift_in(self.inner_v, inner_v)

    def hold(self, n_periods: int) -> None:
        """Note that for some periods nothing new was driven and no target came."""
        self.n_missed += n_periods
        for _ in range(min(n_periods, self.voltages_v.size)):
            self.note(float(self.voltages_v[-1]), float(self.voltages_v[-1]))
