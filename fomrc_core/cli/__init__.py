"""The ``fomrc`` command."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]

_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 2 bad input told in one line, 130 interrupted."""
    try:
        # imported here, for a second of imports is a second in which a user may interrupt
        from fomrc_core.cli.application import run

        status = run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        status = _INTERRUPTED
    sys.exit(status)
