"""How a voltage travels: the message type, the quality of service, and to and from volts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.qos import HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from fomrc_core.errors import InputError
from fomrc_ros.conversions import INTERFACES, entry_of_array, entry_of_joint, finite, stamp_s
from fomrc_ros.node.quality_of_service import COMMAND

# A driver is told that the compensator is gone when so long has passed without a sign of life from its process.
LEASE_S = 0.5
# And that it drives no more when this many periods have passed without a voltage.
_DEADLINE_PERIODS, _LEAST_DEADLINE_S = 10.0, 0.1


class VoltageInterface(ABC):
    """A voltage as a message and back."""

    message_type: type[Any]

    @abstractmethod
    def to_message(self, voltage_v: float, stamp: Time) -> Any:
        """Return the message of a voltage [V] sent at ``stamp``."""

    @abstractmethod
    def entry_v(self, message: Any) -> float:
        """Return the voltage in a message [V], unchecked; raises InputError where it has none."""

    def voltage_v(self, message: Any) -> float:
        """Return the voltage in a message [V]; raises InputError where it has none, or one that is not finite."""
        return finite(self.entry_v(message), "voltage", "V")

    def time_s(self, message: Any, sent_s: float) -> float:
        """Return when the voltage was sent [s]: by the message's own stamp where it has one, else as told."""
        return sent_s


class Float64Voltage(VoltageInterface):
    """std_msgs/Float64."""

    message_type = Float64

    def to_message(self, voltage_v: float, stamp: Time) -> Float64:
        """Return the message of a voltage [V]; the stamp has no place in it."""
        return Float64(data=voltage_v)

    def entry_v(self, message: Float64) -> float:
        """Return the voltage [V], unchecked."""
        return float(message.data)


class MultiArrayVoltage(VoltageInterface):
    """std_msgs/Float64MultiArray of one entry, as forward controllers of ros2_control take it."""

    message_type = Float64MultiArray

    def to_message(self, voltage_v: float, stamp: Time) -> Float64MultiArray:
        """Return the message of a voltage [V]; the stamp has no place in it."""
        return Float64MultiArray(data=[voltage_v])

    def entry_v(self, message: Float64MultiArray) -> float:
        """Return the first entry [V], unchecked; raises InputError where there is none."""
        return entry_of_array(message, "voltage")


class JointStateVoltage(VoltageInterface):
    """sensor_msgs/JointState, stamped, the voltage as the effort of a joint.

    Args:
        joint_name: which joint; in messages without names it is the first.
    """

    message_type = JointState

    def __init__(self, joint_name: str) -> None:
        self.joint_name = joint_name

    def to_message(self, voltage_v: float, stamp: Time) -> JointState:
        """Return the stamped message of a voltage [V]."""
        message = JointState(name=[self.joint_name], effort=[voltage_v])
        message.header.stamp = stamp
        return message

    def entry_v(self, message: JointState) -> float:
        """Return the effort of the joint [V], unchecked; raises InputError where it is missing."""
        return entry_of_joint(message, self.joint_name, "effort")

    def time_s(self, message: JointState, sent_s: float) -> float:
        """Return the stamp [s], or the time told where the stamp is zero."""
        return stamp_s(message.header.stamp) or sent_s


def voltage_interface(interface: str, joint_name: str) -> VoltageInterface:
    """Return the interface of this name, one of ``INTERFACES``; raises InputError for others."""
    if interface == "float64":
        return Float64Voltage()
    if interface == "joint_state":
        return JointStateVoltage(joint_name)
    if interface == "float64_multi_array":
        return MultiArrayVoltage()
    raise InputError("unknown interface", where="voltage_interface", value=interface, allowed=" | ".join(INTERFACES))


def voltage_quality(period_s: float, is_promised: bool) -> QoSProfile:
    """Return the quality of service of a voltage: newest only, reliable; where promised a deadline and a sign of life.

    Promised only where asked for: with promises a listener that closed after a publisher had been killed was seen to
    end with a segmentation fault. Its cause is Fast DDS's shared memory, which a killed process leaves behind, not the
    promise; without one it is seldomer met.

    Args:
        period_s: period of the voltage [s].
        is_promised: whether drivers are to be told by events.
    """
    if not is_promised:
        return COMMAND
    deadline_s = max(_DEADLINE_PERIODS * period_s, _LEAST_DEADLINE_S)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        deadline=Duration(nanoseconds=round(1e9 * deadline_s)),
        liveliness=LivelinessPolicy.AUTOMATIC,
        liveliness_lease_duration=Duration(nanoseconds=round(1e9 * LEASE_S)),
    )
