"""``python -m fomrc_core.cli``."""

from fomrc_core.cli import main

main()
