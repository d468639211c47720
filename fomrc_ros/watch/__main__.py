"""``python -m fomrc_ros.watch``."""

import sys

from fomrc_ros.watch.node import main

sys.exit(main())
