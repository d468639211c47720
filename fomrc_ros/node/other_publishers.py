"""Who else publishes a topic that only one may publish."""

from __future__ import annotations

from rclpy.node import Node


def other_publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of the other nodes that publish a topic, each once, sorted.

    A second node of the same name counts: the graph then lists the name twice.

    Args:
        node: the node that may publish it, by one publisher.
        topic: full name of the topic.
    """
    own = node.get_fully_qualified_name()
    names = [f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in node.get_publishers_info_by_topic(topic)]
    if own in names:
        names.remove(own)
    return sorted(set(names))
