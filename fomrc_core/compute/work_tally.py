"""How much has been simulated: a measure of work that is the same on every machine, as processor time is not."""

from __future__ import annotations

from threading import Lock


class WorkTally:
    """A count that only grows, also where threads share it.

    Who decides by it asks where no thread is at work: so much has been done by then in whatever order it was.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._n_done = 0

    @property
    def n_done(self) -> int:
        """Operations so far, one for each play and each mode of a simulated part of a step [1]."""
        return self._n_done

    def add(self, n_operations: int) -> None:
        """Count so many operations more."""
        with self._lock:
            self._n_done += n_operations
