"""``python -m fomrc_ros.gap``: the command node, or with ``--monitor`` the monitor."""

import sys

from fomrc_ros.gap.nodes import command_main, monitor_main

if "--monitor" in sys.argv[1:2]:
    del sys.argv[1]
    sys.exit(monitor_main())
sys.exit(command_main())
