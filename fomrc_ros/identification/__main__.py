"""``python -m fomrc_ros.identification``."""

import sys

from fomrc_ros.identification.node import main

sys.exit(main())
