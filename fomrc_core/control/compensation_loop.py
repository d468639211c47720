"""The compensator's loop without ROS: target in, voltage out, one call per tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.control.actuator_memory import (
    ActuatorMemory,
    carried,
    carries_exactly,
    displacement_for_voltage,
    pause_steps,
)
from fomrc_core.control.loop_account import Activity, LoopCounts, Move
from fomrc_core.control.previewed_target import PreviewedTarget
from fomrc_core.control.target_history import MemoryReplay, TargetHistory
from fomrc_core.control.trajectory import Trajectory
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.preview_inverse import PreviewInverse

# Part of a period that catching up with a changed model may take from each tick.
_REPLAY_SHARE = 0.3
# A tick has not come late before so many periods have passed; the grid rounds to whole ones.
_LATE_PERIODS = 1.5


@dataclass(frozen=True)
class LoopSettings:
    """What the loop is to respect.

    Args:
        limits: voltage limits.
        stale_after_s: age at which a target is stale [s], 0 for never.
        ramps_when_stale: ramp to the safe voltage on a stale target; else hold it, compensating creep.
        period_s: nominal period [s].
        history_s: how much of the past is kept sample by sample for a model swap [s].
    """

    limits: VoltageLimits
    stale_after_s: float
    ramps_when_stale: bool
    period_s: float
    history_s: float


class CompensationLoop:
    """Owns the compensator's memory and steps it.

    Args:
        compensator: the compensator of the present model.
        settings: limits and policies.
        memory: where to go on from; a relaxed actuator where not given.
        voltage_v: voltage on the actuator [V].
        target_um: last desired displacement [um], None where there was none.
        preview: undoes dynamics with the target's future, which then is followed late; its core is the compensator.
    """

    def __init__(
        self,
        compensator: Compensator,
        settings: LoopSettings,
        memory: ActuatorMemory | None = None,
        voltage_v: float = 0.0,
        target_um: float | None = None,
        preview: PreviewInverse | None = None,
    ) -> None:
        self.compensator = compensator
        self._previewed = None if preview is None else PreviewedTarget(preview)
        self._newest_preview = preview
        self._trajectory: Trajectory | None = None
        self.correction_um = 0.0  # what a sensor adds to where the stage is to go
        self.limited_by_v = 0.0  # by how much the last voltage fell short of what was asked for
        self.settings = settings
        self.counts = LoopCounts()
        self.activity = Activity.WAITING
        self.voltage_v = voltage_v
        self.target_um = target_um
        # Whether the voltage on the actuator is one this loop, or the one it goes on from, has driven.
        self.has_driven = memory is not None
        self.age_s = 0.0
        self.followed_um = 0.0
        self.cross = math.nan
        self._shortfall_um = 0.0
        # What slew limits go by: the time since the last voltage, whatever of it the memory has sat out.
        self._reach_s = settings.period_s
        # By what the memory has moved in the last tick, for who keeps it; more than one move where the tick was late.
        self.moves: list[Move] = []
        self.is_discontinuous = True
        self._target_age_s = 0.0
        self._replay: MemoryReplay | None = None
        self._is_catching_up = False
        self._routine: Iterator[float] | None = None
        self._begin(ActuatorMemory.relaxed(compensator) if memory is None else memory)

    def _begin(self, memory: ActuatorMemory) -> None:
        self.is_discontinuous = True
        self.memory = memory
        if self._previewed is not None:
            self._previewed.restart()
        n_samples = max(int(self.settings.history_s / self.settings.period_s), 64)
        self._history = TargetHistory(self.compensator, memory, n_samples)
        self._replay = None

    @property
    def is_swapping(self) -> bool:
        """Whether a changed model is still being brought up to date or its step is being slewed."""
        return self._replay is not None or self._is_catching_up

    @property
    def newest_compensator(self) -> Compensator:
        """The compensator in force, or the one about to be."""
        return self.compensator if self._replay is None else self._replay.compensator

    @property
    def target_age_s(self) -> float:
        """How long ago the last target came [s]."""
        return self._target_age_s

    def take_shortfall_um(self) -> float:
        """Return the furthest [um] the voltage limits kept the actuator from its target since last asked."""
        shortfall_um, self._shortfall_um = self._shortfall_um, 0.0
        return shortfall_um

    @property
    def preview(self) -> PreviewInverse | None:
        """What undoes dynamics with the target's future, None where targets are followed at once."""
        return None if self._previewed is None else self._previewed.preview

    @property
    def trajectory(self) -> Trajectory | None:
        """What is followed in place of single targets."""
        return self._trajectory

    @property
    def desired_um(self) -> float | None:
        """Where the stage is to be now [um]: with a preview, the target of that much earlier."""
        followed_um = None if self._previewed is None else self._previewed.desired_um
        return self.target_um if followed_um is None else followed_um

    @property
    def previewed(self) -> PreviewedTarget | None:
        """The target with its future, None where targets are followed at once."""
        return self._previewed

    def forget_target(self) -> None:
        """Drop the target: nothing is followed before the next one."""
        self.target_um = self._trajectory = None

    def set_target(self, desired_um: float) -> None:
        """Take a new target [um]; it ends a trajectory."""
        self.target_um = desired_um
        self._trajectory = None
        self._target_age_s = 0.0

    def set_trajectory(self, trajectory: Trajectory | None) -> None:
        """Follow a trajectory on its times, in place of all targets before it; None stays where it is now."""
        desired_um = self.desired_um
        if trajectory is None and desired_um is not None:
            trajectory = Trajectory.at_rest(desired_um)
        self._trajectory = trajectory

    def set_relaxed(self) -> None:
        """Take the actuator as relaxed, as it is after the relaxation routine."""
        # A model still catching up has nothing to catch up with any more.
        self.compensator = self.newest_compensator
        self._begin(ActuatorMemory.relaxed(self.compensator))
        self.age_s = 0.0

    def start_routine(self, voltages_v: Iterator[float]) -> None:
        """Drive these voltages, one per tick, instead of following the target; relaxed at the end."""
        self._routine = voltages_v

    @property
    def is_in_routine(self) -> bool:
        """Whether a routine runs."""
        return self._routine is not None

    def cancel_routine(self) -> None:
        """Go back to following the target."""
        self._routine = None

    def swap(self, compensator: Compensator, preview: PreviewInverse | None = None) -> None:
        """Take over a changed model: at once where its memory carries over, else when it has caught up.

        Args:
            compensator: of the changed model.
            preview: its inverse with a preview, where the loop has one.
        """
        self.counts.n_swaps += 1
        self._newest_preview = preview
        if carries_exactly(self.compensator, compensator):
            self._take_over(compensator, carried(self.compensator, compensator, self.memory))
        else:
            self._replay = MemoryReplay(self._history, compensator)

    def _take_over(self, compensator: Compensator, memory: ActuatorMemory) -> None:
        self.compensator, self.memory = compensator, memory
        if self._previewed is not None and self._newest_preview is not None:
            self._previewed.change(self._newest_preview)
        self._replay = None
        # What is left of the step is slewed without telling the model: it stands where it would have stood.
        self._is_catching_up = True

    def tick(self, step_s: float, time_s: float = math.nan) -> float | None:
        """Return the voltage [V] of this tick, None while there has been no target.

        Args:
            step_s: time since the last tick [s].
            time_s: time of the clock that trajectories go by [s].
        """
        step_s = self._begin_tick(step_s)
        if self._routine is not None:
            return self._tick_routine(self._routine, step_s)
        ahead_um = None if self._trajectory is None else self._seen_ahead(self._trajectory, time_s)
        if self.target_um is None:
            self.activity = Activity.WAITING
            return self._rest(step_s)
        is_stale = 0.0 < self.settings.stale_after_s < self._target_age_s
        if is_stale:
            if self.activity is Activity.TRACKING:
                self.counts.n_stale += 1
            if self.settings.ramps_when_stale:
                return self._ramp(step_s)
        self.activity = Activity.HOLDING if is_stale else Activity.TRACKING
        if self._previewed is not None:
            self._previewed.begin(self.memory.state, self.position_um, self.voltage_v)
            self._previewed.take(self.target_um, ahead_um)
        return self._tick_tracking(self.target_um, step_s)

    @property
    def position_um(self) -> float:
        """Where the stage is by the memory [um], less what a sensor has added."""
        return self.memory.state.last_input - self.correction_um

    def _seen_ahead(self, trajectory: Trajectory, time_s: float) -> Array:
        """Return where a trajectory goes from now to the end of the preview [um]; the target is where it is now."""
        n_preview = 0 if self.preview is None else self.preview.n_preview
        ahead_um = trajectory.at(time_s + self.settings.period_s * np.arange(n_preview + 1.0))
        self.target_um, self._target_age_s = float(ahead_um[-1]), 0.0
        if not time_s < trajectory.end_s:
            self._trajectory = None  # the last point is a target like any other
        return ahead_um

    def _begin_tick(self, step_s: float) -> float:
        self.moves = []
        self.age_s += step_s
        self._target_age_s += step_s
        self._reach_s = step_s
        if step_s > _LATE_PERIODS * self.settings.period_s:
            self._sit_out(step_s - self.settings.period_s)
            step_s = self.settings.period_s
        self._work_on_replay()
        return step_s

    def _sit_out(self, pause_s: float) -> None:
        """Let the memory follow a time in which nothing was driven: a late tick, inactive, suspended.

        The actuator crept at the voltage held. Creep runs by the logarithm of time: steps that double lose nothing.
        """
        if self._previewed is not None:
            self._previewed.hold(round(pause_s / self.settings.period_s))
        for step_s in pause_steps(pause_s, self.settings.period_s):
            if self._is_catching_up:  # a changed model takes the voltage to be further on its way than it is
                self.compensator.advance(self.memory.state, self.followed_um, step_s, cross=self.cross)
                self._remember(step_s, self.followed_um, self.voltage_v)
            else:
                self._move_with(self.voltage_v, step_s)

    def rest(self, step_s: float) -> float | None:
        """Let a tick pass in which nobody says what to drive; return a voltage [V] where limits now ask for another."""
        return self._rest(self._begin_tick(step_s))

    def _rest(self, step_s: float) -> float | None:
        if not self.has_driven:
            return None
        # The amplifier holds its voltage and the actuator creeps on; but beyond limits narrowed since it must not stay.
        before_v, allowed_v = self.voltage_v, self.settings.limits.clamp(self.voltage_v)
        self._apply(allowed_v, step_s)
        return None if allowed_v == before_v else allowed_v

    def tick_to_safe(self, step_s: float) -> float:
        """Return the next voltage [V] of the ramp to the safe voltage; the memory follows."""
        return self._ramp(self._begin_tick(step_s))

    def _ramp(self, step_s: float) -> float:
        self._leave_target(Activity.RAMPING)
        return self._apply(self.settings.limits.ramp_to_safe(self.voltage_v, self._reach_s), step_s)

    def tick_to(self, goal_v: float, step_s: float) -> float:
        """Return the voltage [V] nearest to one somebody else asks for; the memory follows."""
        step_s = self._begin_tick(step_s)
        self._leave_target(Activity.BORROWED)
        return self._apply(self.settings.limits.approach(self.voltage_v, goal_v, self._reach_s), step_s)

    def _tick_routine(self, routine: Iterator[float], step_s: float) -> float:
        self._leave_target(Activity.ROUTINE)
        wanted = next(routine, None)
        if wanted is None:
            self._routine = None
            self.set_relaxed()
            return self.voltage_v
        return self._apply(self.settings.limits.approach(self.voltage_v, wanted, self._reach_s), step_s)

    def _leave_target(self, activity: Activity) -> None:
        self.activity = activity
        if self._previewed is not None:
            self._previewed.forget_targets()

    def _follow(self, target_um: float, step_s: float) -> tuple[float, float]:
        """Move the memory to where the stage is to go; return the voltage that takes [V], and where that is [um]."""
        state = self.memory.state
        if self._previewed is None:
            goal_um = target_um + self.correction_um if self.correction_um else target_um
            return self.compensator.advance(state, goal_um, step_s, cross=self.cross), goal_um
        planned = self._previewed.plan(state, self.correction_um, self.cross)
        if math.isfinite(planned.voltage_v):
            self.compensator.advance(state, planned.moved_um, step_s, cross=self.cross)
        return planned.voltage_v, planned.moved_um

    def _tick_tracking(self, target_um: float, step_s: float) -> float:
        limits = self.settings.limits
        before = self.memory.state.copy()
        wanted, goal_um = self._follow(target_um, step_s)
        if not math.isfinite(wanted):
            # A model far from its actuator can ask for no voltage at all: stay, and keep the memory sound.
            self.counts.n_without_voltage += 1
            self.memory.state = before
            self.voltage_v = limits.clamp(self.voltage_v)
            return self.voltage_v
        voltage = limits.approach(self.voltage_v, wanted, self._reach_s)
        self.limited_by_v = wanted - voltage
        is_clamped = limits.clamp(wanted) != wanted
        if voltage == wanted or is_clamped:
            self._is_catching_up = False
        if voltage == wanted:
            self._remember(step_s, goal_um, voltage)
            self.voltage_v = voltage
            self.has_driven = True
            return voltage
        if self._is_catching_up:
            self.counts.n_slewed += 1
            self._remember(step_s, goal_um, voltage)
            self.voltage_v = voltage
            return voltage
        if voltage == limits.clamp(wanted):
            self.counts.n_clamped += 1
        else:
            self.counts.n_slewed += 1
        # The actuator does not get there: let the model know where it goes instead.
        self.memory.state = before
        self._apply(voltage, step_s)
        if is_clamped and voltage == limits.clamp(wanted):
            self._shortfall_um = max(self._shortfall_um, abs(goal_um - self.followed_um))
        return voltage

    def _apply(self, voltage_v: float, step_s: float) -> float:
        self._move_with(voltage_v, step_s)
        self.voltage_v = voltage_v
        self.has_driven = True
        return voltage_v

    def _move_with(self, voltage_v: float, step_s: float) -> None:
        """Move the memory to where the actuator goes with a voltage."""
        near_um = self.memory.state.last_input
        gain = 1.0 / self.compensator.model.stop_form.slope
        inner_v = voltage_v if self._previewed is None else self._previewed.inner_after(voltage_v)
        reached_um = displacement_for_voltage(
            self.compensator, self.memory.state, inner_v, step_s, near_um, gain, self.cross
        )
        self.compensator.advance(self.memory.state, reached_um, step_s, cross=self.cross)
        self._remember(step_s, reached_um, voltage_v)

    def _remember(self, step_s: float, desired_um: float, voltage_v: float) -> None:
        self.followed_um = desired_um
        if self._previewed is not None:
            self._previewed.note(voltage_v)
        self.moves.append(Move(step_s, desired_um, self.cross, voltage_v))
        self.memory.note_turning_point(self.compensator)
        self._history.append(step_s, desired_um, self.cross)
        self._history.mark(self.compensator, self.memory)

    def _work_on_replay(self) -> None:
        replay = self._replay
        if replay is None:
            return
        try:
            has_caught_up = replay.work(_REPLAY_SHARE * self.settings.period_s)
        except FomrcError:
            # Too slow for its own history: begin with what can be carried, which is close.
            self._take_over(replay.compensator, carried(self.compensator, replay.compensator, self.memory))
            return
        if has_caught_up:
            self._take_over(replay.compensator, replay.memory)
