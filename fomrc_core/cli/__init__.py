"""The ``fomrc`` command."""

from fomrc_core.cli.application import main

__all__ = ["main"]
