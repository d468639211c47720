"""The stage beside the loop: where it is by the model, whether it has arrived, and what a sensor adds."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.control.actuator_memory import ActuatorMemory
from fomrc_core.control.arrival import HORIZON_S, Arrival
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.driven_stage import DrivenStage
from fomrc_core.control.feedback import Feedback
from fomrc_core.control.loop_account import Activity
from fomrc_core.control.predicted_motion import PredictedMotion, late_effects
from fomrc_core.control.steps_ahead import driven_ahead, voltages_ahead
from fomrc_core.model.compensator import Compensator

_FOLLOWING = (Activity.TRACKING, Activity.HOLDING)


class StageMotion:
    """Steps what is known of the stage along with a loop; call it before and after each tick.

    Args:
        arrival: says when it has arrived; None where nobody asks.
        feedback: what a sensor adds; None without one.
    """

    def __init__(self, arrival: Arrival | None, feedback: Feedback | None) -> None:
        self.arrival, self.feedback = arrival, feedback
        self._motion: PredictedMotion | None = None
        self._stage: DrivenStage | None = None
        self._has_looked = False  # whether this model is one that is driven by voltages
        self._compensator: Compensator | None = None
        self._memory: ActuatorMemory | None = None
        self._wanted_um = math.nan

    @property
    def predicted_um(self) -> float:
        """Displacement by the model [um], without what a sensor adds; nan before the first tick."""
        return math.nan if self._motion is None else self._motion.displacement_um

    def before_tick(self, loop: CompensationLoop, now_s: float) -> None:
        """Bring what the sensor has said into the loop.

        Args:
            loop: about to tick.
            now_s: time of its clock [s].
        """
        feedback = self.feedback
        if feedback is None:
            return
        is_followed = loop.activity in _FOLLOWING and not loop.is_in_routine
        believed = feedback.step(now_s, loop.limited_by_v, is_followed=is_followed)
        loop.correction_um = feedback.correction_um
        if self.arrival is not None:
            for time_s, displacement_um in believed:
                self.arrival.judge_measured(time_s, displacement_um)
        if is_followed and loop.desired_um is not None:
            feedback.error.note(feedback.correction_um, loop.desired_um, loop.settings.period_s)

    def after_tick(self, loop: CompensationLoop, now_s: float) -> None:
        """Follow what the loop has driven, and judge the arrival; arguments as ``before_tick``."""
        # Another model, or a memory that begins anew: the motion before it is over.
        if loop.compensator is not self._compensator or loop.memory is not self._memory or self._motion is None:
            self._compensator, self._memory = loop.compensator, loop.memory
            self._motion = PredictedMotion(late_effects(loop.compensator, loop.preview), loop.position_um)
            self._stage, self._has_looked = None, False
        if loop.moves:
            steps_s = np.array([move.step_s for move in loop.moves])
            driven_um = np.array([move.desired_um for move in loop.moves]) - loop.correction_um
            self._motion.advance(steps_s, driven_um)
        if self.feedback is not None:
            self.feedback.note_reference(now_s, self._motion.displacement_um)
        if self.arrival is None:
            self._stage, self._has_looked = None, False
        else:
            if not self._has_looked:
                self._has_looked = True
                self._stage = _driven_stage(loop)
            elif self._stage is not None:
                self._stage.note(loop.moves)
            self._judge_arrival(self.arrival, self._motion, loop, now_s)

    @staticmethod
    def _n_horizon(loop: CompensationLoop) -> int:
        n_preview = 0 if loop.preview is None else loop.preview.n_preview
        return n_preview + round(HORIZON_S / loop.settings.period_s)

    def _judge_arrival(self, arrival: Arrival, motion: PredictedMotion, loop: CompensationLoop, now_s: float) -> None:
        target_um = loop.target_um
        if target_um is None or loop.activity not in _FOLLOWING or loop.trajectory is not None:
            arrival.is_new(math.nan)
            return
        if arrival.is_new(target_um):
            return
        if loop.limited_by_v:
            arrival.forget_prediction()
        elif arrival.needs_prediction:
            displacement_um = self._displacement_ahead(motion, loop)
            arrival.predict(now_s, loop.settings.period_s * np.arange(float(displacement_um.size)), displacement_um)
        if self.feedback is None or not self.feedback.is_closed:
            arrival.judge_predicted(now_s)

    def _displacement_ahead(self, motion: PredictedMotion, loop: CompensationLoop) -> Array:
        """Return the displacement now and in the steps to come [um], without what a sensor adds, (n_horizon + 1,)."""
        n_steps, period_s = self._n_horizon(loop), loop.settings.period_s
        if self._stage is None:
            driven_um = driven_ahead(loop, n_steps)
            ahead_um = motion.ahead(np.full(driven_um.size, period_s), driven_um)
            return np.append(motion.displacement_um, ahead_um)
        ahead_um = self._stage.ahead(period_s, voltages_ahead(loop, n_steps))
        return np.append(self._stage.displacement_um, ahead_um) - loop.correction_um


def _driven_stage(loop: CompensationLoop) -> DrivenStage | None:
    """Return the stage as it rests now; None for a model that is not driven by voltages."""
    if not DrivenStage.knows(loop.compensator, loop.preview):
        return None
    return DrivenStage(loop.compensator, loop.preview, loop.memory, loop.position_um, loop.voltage_v)
