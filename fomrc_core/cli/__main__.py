"""``python -m fomrc_core.cli``."""

from fomrc_core.cli.application import main

main()
