"""``python -m fomrc_ros.gap``: the command node, or with ``--monitor`` the monitor."""

import sys

from fomrc_ros.gap.nodes import command_main, monitor_main

if any(word in ("-h", "--help") for word in sys.argv[1:]):
    print("--monitor first: the monitor in place of the command node")
if "--monitor" in sys.argv[1:2]:
    del sys.argv[1]
    sys.exit(monitor_main())
sys.exit(command_main())
