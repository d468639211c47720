"""``python -m fomrc_ros.compensator``."""

import sys

from fomrc_ros.compensator.node import main

sys.exit(main())
