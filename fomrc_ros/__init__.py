"""ROS 2 nodes over fomrc_core."""
