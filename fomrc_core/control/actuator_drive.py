"""Who drives the actuator: the compensation loop, a borrower of the voltage, or the ramp to the safe voltage.

Whatever the source, there is one way out: within the limits in force, and told to the memory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.loop_account import Activity
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError

MEMORY_UNKNOWN = "the memory is unknown: call ~/relax"


@dataclass(frozen=True)
class DriveSettings:
    """What every voltage has to keep to, whoever asks for it.

    Args:
        limits: voltage limits.
        ramps_on_stop: ramp to the safe voltage on a stop; else hold.
        lease_s: how long a borrower may be silent before the voltage is taken back [s].
    """

    limits: VoltageLimits
    ramps_on_stop: bool
    lease_s: float


@dataclass
class _Lease:
    goal_v: float | None
    renewed_at_s: float


class ActuatorDrive:
    """Decides each tick which voltage goes to the actuator.

    Args:
        settings: limits, policy and lease.

    Attributes:
        settings: in force; replaced as a whole.
        loop: the compensation loop, None where there is no model or it is not configured.
        is_active: whether the loop is to drive where nobody else does.
        problem: what the user should know of and act on, "" where nothing.
    """

    def __init__(self, settings: DriveSettings) -> None:
        self.settings = settings
        self.loop: CompensationLoop | None = None
        self.is_active = False
        self.problem = ""
        self._voltage_v: float | None = None  # last driven without a loop
        self._lease: _Lease | None = None
        self._is_ramping = False
        self._is_stopping = False
        self._is_memory_unknown = False

    @property
    def voltage_v(self) -> float | None:
        """Voltage on the actuator [V], None where nothing has been driven."""
        if self.loop is not None and self.loop.has_driven:
            return self.loop.voltage_v
        return self._voltage_v

    @property
    def is_lent(self) -> bool:
        """Whether a borrower drives."""
        return self._lease is not None

    @property
    def is_stopping(self) -> bool:
        """Whether a stop has begun and not been ended."""
        return self._is_stopping

    @property
    def is_ramping(self) -> bool:
        """Whether the voltage is on its way to the safe one, whatever else is asked for."""
        return self._is_ramping

    @property
    def needs_ticks(self) -> bool:
        """Whether ``tick`` has anything to do."""
        return self.is_active or self.is_lent or self._is_ramping

    @property
    def activity(self) -> str:
        """What is being done, in words."""
        if self._is_ramping:
            return Activity.RAMPING.value
        if self.is_lent:
            return Activity.BORROWED.value
        if not self.is_active:
            return "inactive"
        return Activity.WAITING.value if self.loop is None else self.loop.activity.value

    def take_loop(self, loop: CompensationLoop | None) -> None:
        """Take another loop, or none; the voltage on the actuator stays known.

        Raises:
            FomrcError: the voltage is lent, and a memory beginning now would be that of another actuator.
        """
        if loop is not None and self.is_lent:
            raise FomrcError("the voltage is lent: wait for it to be returned")
        before_v = self.voltage_v
        if loop is None:
            self._voltage_v = before_v
        elif before_v is not None and not loop.has_driven:
            loop.voltage_v, loop.has_driven = before_v, True
            self._is_memory_unknown = self._is_memory_unknown or before_v != 0.0
        self.loop = loop
        if loop is not None and self._is_memory_unknown:
            self.problem = MEMORY_UNKNOWN

    def set_relaxed(self) -> None:
        """Take the actuator as relaxed from now on."""
        self._is_memory_unknown = False
        self.problem = ""
        if self.loop is not None:
            self.loop.set_relaxed()

    # lending

    def lend(self, now_s: float) -> None:
        """Let somebody else say the voltage, until it is returned or the lease runs out.

        Raises:
            FomrcError: lent already, stopping, or driving a routine.
        """
        if self.is_lent:
            raise FomrcError("the voltage is lent already")
        if self._is_ramping or self._is_stopping:
            raise FomrcError("the voltage is on its way to the safe one")
        if self.loop is not None and self.loop.is_in_routine:
            raise FomrcError("a routine runs")
        self._lease = _Lease(None, now_s)

    def borrow(self, goal_v: float, now_s: float) -> bool:
        """Take the borrower's wish [V], which renews the lease; return whether there is one."""
        if self._lease is None or not math.isfinite(goal_v):
            return False
        self._lease.goal_v, self._lease.renewed_at_s = goal_v, now_s
        return True

    def take_back(self) -> bool:
        """End the lease on the borrower's own word; return whether there was one.

        The loop goes on with a memory of what was driven. Without a loop nobody has remembered it.
        """
        if self._lease is None:
            return False
        was_driven = self._lease.goal_v is not None
        self._lease = None
        if was_driven and self.loop is None:
            self._is_memory_unknown = True
            self.problem = MEMORY_UNKNOWN
        return True

    # stopping

    def begin_stop(self) -> bool:
        """Stop as the policy says; return whether ``tick`` has a ramp to drive first."""
        was_driving = self.is_active or self._is_ramping or self.is_lent
        self._is_stopping = True
        self.take_back()
        if self.loop is not None:
            self.loop.cancel_routine()
        self._is_ramping = (
            self.settings.ramps_on_stop
            and self.voltage_v is not None
            and self.voltage_v != self.settings.limits.safe_v
            and was_driving
        )
        return self._is_ramping

    def end_stop(self) -> None:
        """The stop is over: whoever wants to may drive again."""
        self._is_stopping = self._is_ramping = False

    def fail(self, problem: str) -> None:
        """Give the loop up for a reason, and bring the voltage to safety without it."""
        self.problem = problem
        self.take_loop(None)
        self._lease = None
        self._is_memory_unknown = True
        self._is_ramping = self._voltage_v is not None

    # ticks

    def tick(self, step_s: float, now_s: float, time_s: float = math.nan) -> float | None:
        """Return the voltage [V] of this tick, None where there is none to publish.

        Args:
            step_s: time since the last tick [s].
            now_s: time of a clock that nobody sets, for the lease [s].
            time_s: time of the clock that trajectories go by [s].
        """
        lease = self._lease
        if lease is not None and now_s - lease.renewed_at_s > self.settings.lease_s:
            self._run_out(lease)
            lease = None
        if self._is_ramping:
            return self._tick_ramp(step_s)
        if lease is not None and lease.goal_v is not None:
            return self._tick_to(lease.goal_v, step_s)
        if lease is not None:
            return None if self.loop is None else self.loop.rest(step_s)
        if self._is_stopping or not self.is_active or self.loop is None:
            return None
        return self.loop.tick(step_s, time_s)

    def _run_out(self, lease: _Lease) -> None:
        self.take_back()
        if lease.goal_v is None:
            return
        unknown = f"; {MEMORY_UNKNOWN}" if self.loop is None else ""
        self.problem = (
            f"the borrower of the voltage fell silent for {self.settings.lease_s:g} s: "
            f"the voltage is brought to the safe one{unknown}"
        )
        self._is_ramping = True
        if self.loop is not None:
            # What was followed before may be minutes old; the next target is followed again.
            self.loop.forget_target()

    def _tick_ramp(self, step_s: float) -> float | None:
        limits = self.settings.limits
        if self.voltage_v is None or self.voltage_v == limits.safe_v:
            self._is_ramping = False
            return None
        voltage_v = (
            self.loop.tick_to_safe(step_s) if self.loop is not None else limits.ramp_to_safe(self.voltage_v, step_s)
        )
        self._voltage_v = voltage_v
        self._is_ramping = voltage_v != limits.safe_v
        return voltage_v

    def _tick_to(self, goal_v: float, step_s: float) -> float:
        if self.loop is not None:
            return self.loop.tick_to(goal_v, step_s)
        # Nothing has been driven yet: an amplifier that was just switched on is at zero.
        last_v = 0.0 if self._voltage_v is None else self._voltage_v
        self._voltage_v = self.settings.limits.approach(last_v, goal_v, step_s)
        return self._voltage_v
