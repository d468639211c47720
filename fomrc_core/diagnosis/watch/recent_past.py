"""What was driven and measured of late, and where the model stood before it: what a diagnosis after an alarm needs."""

from __future__ import annotations

from collections import deque

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording


class RecentPast:
    """Keeps the last blocks, each with the state of the model before it; the oldest go.

    What a record began with was used to find where the model stood, by a model that may no longer have been true:
    it is told of only while there is nothing else.

    Args:
        model: the model in force.
        memory_s: how much is kept [s].
    """

    def __init__(self, model: PiezoModel, memory_s: float) -> None:
        self.model = model
        self._memory_s = memory_s
        self._blocks: deque[tuple[float, Array, Array, Array, ModelState]] = deque()
        self._kept_s = 0.0
        self._n_of_start = 0

    def add(
        self,
        began_s: float,
        steps_s: Array,
        voltage_v: Array,
        moved_um: Array,
        state: ModelState,
        *,
        is_of_start: bool = False,
    ) -> None:
        """Keep one block; the state is the one before it, and is copied.

        Args:
            began_s: when it began, from the start of the watch [s].
            steps_s: step that leads to each sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            moved_um: measured displacement [um], shape (n_samples,).
            state: of the model, before it.
            is_of_start: whether the state the record began with was found from it.
        """
        self._n_of_start += is_of_start
        self._blocks.append((began_s, steps_s, voltage_v, moved_um, state.copy()))
        self._kept_s += float(np.sum(steps_s))
        while len(self._blocks) > 1 and self._kept_s - float(np.sum(self._blocks[0][1])) >= self._memory_s:
            self._kept_s -= float(np.sum(self._blocks.popleft()[1]))
            self._n_of_start = max(self._n_of_start - 1, 0)

    @property
    def _first(self) -> int:
        return self._n_of_start if self._n_of_start < len(self._blocks) else 0

    @property
    def began_s(self) -> float:
        """When the first block that is told of began, from the start of the watch [s]."""
        return self._blocks[self._first][0]

    def state(self) -> ModelState:
        """Return a copy of the state before the first block that is told of."""
        return self._blocks[self._first][4].copy()

    def recording(self) -> Recording:
        """Return what is told of as a recording; its time begins at zero."""
        told = list(self._blocks)[self._first :]
        steps, voltage, moved = (np.concatenate([block[k] for block in told]) for k in (1, 2, 3))
        return Recording(np.cumsum(steps) - steps[0], voltage, moved, name="recent past")
