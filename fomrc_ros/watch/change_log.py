"""A line for each change, in a file that does not grow beyond bounds."""

from __future__ import annotations

import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path

LOG_NAME = "watch.log"
_LARGEST_BYTES, _N_OLDER = 1_000_000, 5


class ChangeLog:
    """Appends lines with the time of day; older ones go to ``watch.log.1`` to ``.5``.

    Args:
        folder: where the file is.
    """

    def __init__(self, folder: Path) -> None:
        # Made at the first line, so that a watch that notices nothing leaves nothing.
        self._handler = RotatingFileHandler(
            folder / LOG_NAME, maxBytes=_LARGEST_BYTES, backupCount=_N_OLDER, encoding="utf-8", delay=True
        )
        self._handler.setFormatter(logging.Formatter("%(asctime)s %(message)s"))

    def write(self, line: str) -> None:
        """Append a line."""
        text = " ".join(line.split())
        self._handler.emit(logging.LogRecord("watch", logging.INFO, "", 0, text, None, None))

    def close(self) -> None:
        """Close the file."""
        self._handler.close()
