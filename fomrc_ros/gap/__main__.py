"""``python -m fomrc_ros.gap``: the command node, or with ``--monitor`` the monitor."""

import sys

from fomrc_ros.gap.nodes import command_main, monitor_main

sys.exit(monitor_main() if "--monitor" in sys.argv else command_main())
