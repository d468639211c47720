"""``python -m fomrc_ros.simulated_stage``."""

import sys

from fomrc_ros.simulated_stage.node import main

sys.exit(main())
