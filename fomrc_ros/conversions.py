"""Messages to core quantities and back; the one place where metres meet micrometres."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from fomrc_core.errors import InputError

UM_PER_M = 1e6
# Further than any piezo travels: a value in other units than metres.
LARGEST_POSITION_M = 0.1
INTERFACES = ("float64", "joint_state", "float64_multi_array")


def m_to_um(position_m: float) -> float:
    """Return a length in micrometres."""
    return position_m * UM_PER_M


def um_to_m(position_um: float) -> float:
    """Return a length in metres."""
    return position_um / UM_PER_M


def stamp_s(stamp: Time) -> float:
    """Return a message stamp in seconds."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def finite(value: float, where: str, unit: str) -> float:
    """Return the value; raises InputError where it is not finite."""
    if not math.isfinite(value):
        raise InputError("not finite", where=where, value=value, allowed=f"finite, in {unit}")
    return float(value)


def entry_of_array(message: Float64MultiArray, what: str) -> float:
    """Return the first entry of an array, unchecked; raises InputError where there is none.

    Args:
        message: the array.
        what: what it is one of, for the error.
    """
    if not message.data:
        raise InputError(f"no {what}", where="Float64MultiArray.data", value=0, allowed="1 or more entries")
    return float(message.data[0])


def entry_of_joint(message: JointState, joint_name: str, field: str) -> float:
    """Return what a message says of a joint, unchecked; raises InputError where it says nothing.

    Args:
        message: of several joints or one.
        joint_name: which; in a message without names it is the first.
        field: "position", "velocity" or "effort".
    """
    names, entries = list(message.name), getattr(message, field)
    if names and joint_name not in names:
        raise InputError("joint not in the message", where="JointState.name", value=names[:5], allowed=joint_name)
    k = names.index(joint_name) if names else 0
    if k >= len(entries):
        raise InputError(
            f"no {field} for the joint",
            where=f"JointState.{field}",
            value=len(entries),
            allowed=f"{k + 1} or more entries",
        )
    return float(entries[k])


class PositionInterface(ABC):
    """How a position travels: the message type, and to and from micrometres."""

    message_type: type[Any]

    @abstractmethod
    def to_message(self, position_um: float, stamp: Time) -> Any:
        """Return the message of a position [um] taken at ``stamp``."""

    @abstractmethod
    def position_m(self, message: Any) -> float:
        """Return the position in a message [m], unchecked; raises InputError where it has none."""

    def time_s(self, message: Any, received_s: float) -> float:
        """Return when the position was taken [s]; the time of receipt where the message has no stamp."""
        return received_s

    def to_um(self, message: Any) -> float:
        """Return the position in a message [um].

        Raises:
            InputError: no position, not finite, or further than any piezo travels.
        """
        position_m = finite(self.position_m(message), "position", "m")
        if abs(position_m) > LARGEST_POSITION_M:
            raise InputError(
                "position out of range, is it in metres?",
                where="position",
                value=position_m,
                allowed=f"-{LARGEST_POSITION_M} to {LARGEST_POSITION_M} m",
            )
        return m_to_um(position_m)


class Float64Position(PositionInterface):
    """std_msgs/Float64, metres."""

    message_type = Float64

    def to_message(self, position_um: float, stamp: Time) -> Float64:
        """Return the message of a position [um]; the stamp has no place in it."""
        return Float64(data=um_to_m(position_um))

    def position_m(self, message: Float64) -> float:
        """Return the position [m], unchecked."""
        return float(message.data)


class MultiArrayPosition(PositionInterface):
    """std_msgs/Float64MultiArray of one entry, metres, as ros2_control's forward controllers take and give it."""

    message_type = Float64MultiArray

    def to_message(self, position_um: float, stamp: Time) -> Float64MultiArray:
        """Return the message of a position [um]; the stamp has no place in it."""
        return Float64MultiArray(data=[um_to_m(position_um)])

    def position_m(self, message: Float64MultiArray) -> float:
        """Return the first entry [m], unchecked; raises InputError where there is none."""
        return entry_of_array(message, "position")


class JointStatePosition(PositionInterface):
    """sensor_msgs/JointState, stamped, metres; one joint of it.

    Args:
        joint_name: which joint; in messages without names it is the first.
    """

    message_type = JointState

    def __init__(self, joint_name: str) -> None:
        self.joint_name = joint_name

    def to_message(self, position_um: float, stamp: Time) -> JointState:
        """Return the stamped message of a position [um]."""
        message = JointState(name=[self.joint_name], position=[um_to_m(position_um)])
        message.header.stamp = stamp
        return message

    def position_m(self, message: JointState) -> float:
        """Return the position of the joint [m], unchecked; raises InputError where it is missing."""
        return entry_of_joint(message, self.joint_name, "position")

    def time_s(self, message: JointState, received_s: float) -> float:
        """Return the stamp [s], or the time of receipt where the stamp is zero."""
        return stamp_s(message.header.stamp) or received_s


def position_interface(interface: str, joint_name: str) -> PositionInterface:
    """Return the interface of this name, one of ``INTERFACES``; raises InputError for others."""
    if interface == "float64":
        return Float64Position()
    if interface == "joint_state":
        return JointStatePosition(joint_name)
    if interface == "float64_multi_array":
        return MultiArrayPosition()
    raise InputError("unknown interface", where="interface", value=interface, allowed=" | ".join(INTERFACES))
