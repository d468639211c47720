"""A reader that wants every message of a topic: ``python stalling_reader.py TOPIC``."""

import sys

import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64

rclpy.init()
node = rclpy.create_node("stalling_reader")
quality = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
n_heard = 0


def on_message(message: Float64) -> None:
    global n_heard
    n_heard += 1
    if n_heard == 1:
        print("heard", flush=True)


node.create_subscription(Float64, sys.argv[1], on_message, quality)
rclpy.spin(node)
