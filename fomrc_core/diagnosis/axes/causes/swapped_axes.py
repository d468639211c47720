"""Two axes are exchanged: cables of sensors, or of drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import numpy as np

from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence, no_values
from fomrc_core.diagnosis.axes.causes.mixing import outputs_mixed
from fomrc_core.model.axes import AxesModel, RateRelay


@dataclass(frozen=True, eq=False)
class SwappedAxes(AxesCause):
    """Two sensors or two drives exchanged; no number is free.

    Attributes:
        pair: which two, from 0.
        is_drive: whether the drives are, with all that their own models do.
    """

    name: ClassVar[str] = "swapped_axes"
    meaning: ClassVar[str] = "Two axes are exchanged: what is called one is the other, at the sensors or at the drives."
    signature: ClassVar[str] = "each of two displacements follows the other's voltage"
    experiment: ClassVar[str] = "move one axis at a time and see which sensor answers"

    pair: tuple[int, int] = (0, 1)
    is_drive: bool = False

    @property
    def kind(self) -> str:
        """Which side."""
        return "drives" if self.is_drive else "sensors"

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return each pair of sensors and each pair of drives."""
        model = evidence.model
        sensors: list[AxesCause] = [cls(no_values(), pair) for pair in combinations(range(model.n_outputs), 2)]
        return sensors + [cls(no_values(), pair, True) for pair in combinations(range(model.n_inputs), 2)]

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the two exchanged."""
        order = np.arange(model.n_inputs if self.is_drive else model.n_outputs)
        order[list(self.pair)] = order[list(self.pair[::-1])]
        if not self.is_drive:
            return outputs_mixed(model, np.eye(order.size)[order])
        # voltage i drives the actuator order[i], whose own model it is then
        modes = model.modes
        if modes is not None:
            modes = replace(modes, input_shape=modes.input_shape[:, order])
        relay = model.rate_relay
        if relay is not None:
            relay = RateRelay(relay.scale_v_per_s, relay.prompt_um[order], relay.late_um[order])
        axes = tuple(model.axes[i] for i in order)
        return replace(model, axes=axes, modes=modes, coupling=model.static[:, order], rate_relay=relay)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return the two axes and the side."""
        return {"axes": [float(k + 1) for k in self.pair], "side": self.kind}
