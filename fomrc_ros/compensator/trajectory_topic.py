"""``~/trajectory``: a motion told beforehand, followed on its time stamps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from fomrc_core.compute.arrays import Array
from fomrc_core.control.actuator_drive import ActuatorDrive
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.trajectory import MOST_POINTS, TrajectoryPoints
from fomrc_core.errors import FomrcError, InputError
from fomrc_ros.conversions import LARGEST_POSITION_M, UM_PER_M, stamp_s
from fomrc_ros.node.quality_of_service import COMMAND, overridable


class TrajectoryTopic:
    """Subscribes ``~/trajectory`` (trajectory_msgs/JointTrajectory, m); an empty one cancels what is followed.

    Args:
        node: the compensator.
        drive: whose loop follows it.
        joint_name: which joint is ours.
        refuse: told of a message that cannot be used, with the reason.
    """

    def __init__(
        self, node: Node, drive: ActuatorDrive, joint_name: str, refuse: Callable[[str, FomrcError], None]
    ) -> None:
        self._node, self._drive, self._joint_name, self._refuse = node, drive, joint_name, refuse
        node.create_subscription(
            JointTrajectory, "~/trajectory", self._on_message, COMMAND, qos_overriding_options=overridable()
        )

    def _on_message(self, message: JointTrajectory) -> None:
        now_s = 1e-9 * float(self._node.get_clock().now().nanoseconds)
        loop = self._drive.loop
        try:
            if loop is None or not self._drive.is_active:
                raise InputError("the compensator is not active", where="trajectory")
            if message.points:
                begin(loop, points_of(message, self._joint_name, now_s), now_s)
            elif loop.trajectory is not None:
                loop.set_trajectory(None)
        except FomrcError as error:
            self._refuse("trajectory", error)


def begin(loop: CompensationLoop, points: TrajectoryPoints, now_s: float) -> None:
    """Have a loop follow points from where its stage is to be now.

    Raises:
        InputError: points that have passed, or are on another clock.
    """
    if loop.trajectory is not None:
        state = loop.trajectory.state(now_s)
    else:
        desired_um = loop.desired_um
        state = (loop.position_um if desired_um is None else desired_um, 0.0, 0.0)
    loop.set_trajectory(points.from_state(state, now_s))


def points_of(message: JointTrajectory, joint_name: str, now_s: float) -> TrajectoryPoints:
    """Return the points of a joint in a message.

    Args:
        message: of several joints or one; without a stamp it begins now.
        joint_name: which.
        now_s: time of the node's clock [s].

    Raises:
        InputError: the joint is not in it, a point without a position, numbers that are not finite or too far, times
            that do not rise.
    """
    names = list(message.joint_names)
    if joint_name not in names:
        raise InputError("joint not in the message", where="joint_names", value=names[:5], allowed=joint_name)
    if len(message.points) > MOST_POINTS:
        raise InputError(
            "too many points", where="trajectory", value=len(message.points), allowed=f"{MOST_POINTS} or fewer"
        )
    k = names.index(joint_name)
    begins_s = stamp_s(message.header.stamp) or now_s
    since_s = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points])
    if since_s[0] < 0.0:
        raise InputError("of the first point", where="time_from_start", value=float(since_s[0]), allowed="0 s or later")
    positions_um = _entries(message, "positions", k, len(names))
    if positions_um is None:
        raise InputError("no positions", where="trajectory", allowed="a position in each point")
    is_far = np.abs(positions_um) > UM_PER_M * LARGEST_POSITION_M
    if np.any(is_far):
        raise InputError(
            "position out of range, is it in metres?",
            where="positions",
            value=float(positions_um[int(np.argmax(is_far))] / UM_PER_M),
            allowed=f"-{LARGEST_POSITION_M} to {LARGEST_POSITION_M} m",
        )
    velocities, accelerations = (_entries(message, what, k, len(names)) for what in ("velocities", "accelerations"))
    return TrajectoryPoints(begins_s + since_s, positions_um, velocities, accelerations)


def _entries(message: JointTrajectory, what: str, k: int, n_joints: int) -> Array | None:
    """Return what the points say of the joint [um, um/s, um/s^2]; None where none says anything."""
    told = [getattr(point, what) for point in message.points]
    if not any(len(entries) for entries in told):
        return None
    for number, entries in enumerate(told):
        if len(entries) != n_joints:
            raise InputError(
                f"of point {number}", where=what, value=len(entries), allowed=f"{n_joints}, one for each joint"
            )
    return UM_PER_M * np.array([entries[k] for entries in told], dtype=np.float64)
