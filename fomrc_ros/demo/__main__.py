"""``python -m fomrc_ros.demo``."""

import sys

from fomrc_ros.demo.demo import main

sys.exit(main())
