"""A target of which some future is known, and the preview that undoes dynamics with it, over the life of a loop."""

from __future__ import annotations

from fomrc_core.compute.arrays import Array
from fomrc_core.model.preview_inverse import Planned, PreviewInverse
from fomrc_core.model.preview_window import PreviewWindow
from fomrc_core.model.state import ModelState


class PreviewedTarget:
    """Holds the window of a previewing inverse: begins it, lets it follow what is driven, and hands it on.

    Args:
        preview: the inverse in force.
    """

    def __init__(self, preview: PreviewInverse) -> None:
        self.preview = preview
        self._window: PreviewWindow | None = None
        self._inner_v = 0.0

    @property
    def desired_um(self) -> float | None:
        """Where the stage is to be now [um]; None where no target is followed."""
        window = self._window
        return None if window is None or not window.is_followed else window.desired_um

    def driven_ahead(self, n_steps: int) -> Array | None:
        """Return where the stage is to be driven in steps to come [um], (n_steps,), the newest target held.

        None where no target is followed.
        """
        window = self._window
        is_followed = window is not None and window.is_followed
        return self.preview.driven_ahead(window, n_steps) if window is not None and is_followed else None

    def voltages_ahead(self, state: ModelState, n_steps: int, correction_um: float, cross: float) -> Array | None:
        """Return the voltages of steps to come [V], (n_steps,), the newest target held; None where none is followed."""
        window = self._window
        if window is None or not window.is_followed:
            return None
        return self.preview.voltages_ahead(state, window, n_steps, correction_um, cross)

    def restart(self) -> None:
        """Forget everything: the memory has changed otherwise than by following."""
        self._window = None

    def change(self, preview: PreviewInverse) -> None:
        """Take another model's inverse, with what is known; what is older counts as the oldest known."""
        old, self.preview = self._window, preview
        if old is None:
            return
        self._window = new = preview.window()
        for name in ("targets_um", "voltages_v", "inner_v"):
            before, after = getattr(old, name), getattr(new, name)
            n = min(before.size, after.size)
            after[:] = before[0]
            after[after.size - n :] = before[before.size - n :]
        if new.bends_v.shape == old.bends_v.shape:
            new.bends_v[:] = old.bends_v
        new.is_followed, new.n_missed = old.is_followed, old.n_missed

    def begin(self, state: ModelState, position_um: float, voltage_v: float) -> None:
        """Stand ready for a target: begun where the stage rests, or where it was brought to otherwise.

        Args:
            state: of the core, where the actuator is.
            position_um: where the stage is [um], less what a sensor adds.
            voltage_v: voltage on the actuator [V].
        """
        window = self._window
        if window is None:
            window = self._window = self.preview.window()
            window.begin(position_um, voltage_v, self.preview.peek(state, state.last_input))
        elif not window.is_followed:
            window.targets_um[:] = position_um
            window.is_followed, window.n_missed = True, 0

    def take(self, target_um: float, ahead_um: Array | None = None) -> None:
        """Take the newest target [um], or all those from now on where the future is known outright."""
        assert self._window is not None
        if ahead_um is None:
            self._window.take(target_um)
        else:
            self._window.see(ahead_um)

    def plan(self, state: ModelState, correction_um: float, cross: float) -> Planned:
        """Return the step to the target for now; see ``PreviewInverse.plan``."""
        assert self._window is not None
        planned = self.preview.plan(state, self._window, correction_um, cross)
        self._inner_v = planned.inner_v
        return planned

    def inner_after(self, voltage_v: float) -> float:
        """Return what the amplifier makes of a voltage [V] driven in place of what was planned."""
        if self._window is None:
            self._inner_v = voltage_v
        else:
            self._window.forget_plan()
            self._inner_v = self.preview.inner_after(self._window, voltage_v)
        return self._inner_v

    def note(self, voltage_v: float) -> None:
        """Note the voltage of a step [V]."""
        if self._window is not None:
            self._window.note(voltage_v, self._inner_v)

    def hold(self, n_periods: int) -> None:
        """Note periods in which the voltage was held and no target came."""
        if self._window is not None:
            self._window.hold(n_periods)

    def forget_targets(self) -> None:
        """Something else than a target is followed."""
        if self._window is not None:
            self._window.forget_targets()
