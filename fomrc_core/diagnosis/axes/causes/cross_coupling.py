"""One axis moves another: at once, or by way of the modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.diagnosis.axes.causes.mixing import inputs_mixed, outputs_mixed
from fomrc_core.model.axes import AxesModel

_FORMS = ("sensor", "drive", "modes")
_MOST = 3.0  # change of a logarithm, either way
_SHOWN = 0.1  # of the largest entry: smaller ones are not worth a word


@dataclass(frozen=True, eq=False)
class CrossCoupling(AxesCause):
    """Static: sensors see, or drives make, a share of other axes. Dynamic: modes of one axis move others as well.

    Static values are the entries beside the diagonal of I + E, on the displacements or on the inputs. Dynamic ones
    are, for each mode, shares of what it does at the axis it belongs to, at the other sensors and the other drives,
    and what comes with it at that axis itself: relative changes of its answer, its frequency and its damping.

    Attributes:
        form: "sensor", "drive" or "modes".
        n_others: of "modes", for each mode the number of other sensors and other drives.
    """

    name: ClassVar[str] = "cross_coupling"
    meaning: ClassVar[str] = "One axis moves another, or is seen by its sensor."
    signature: ClassVar[str] = "the residual of one axis follows the drive of another"
    experiment: ClassVar[str] = "drive one axis at a time while the others are held, slowly and fast"

    form: str = "sensor"
    n_others: int = 0

    @property
    def kind(self) -> str:
        """Whether it is the same at all frequencies."""
        return "dynamic" if self.form == "modes" else "static"

    @property
    def side(self) -> str:
        """Sensors, drives or modes."""
        return self.form

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return each form, all entries zero; none of a single axis."""
        model = evidence.model
        n_in, n_out = model.n_inputs, model.n_outputs
        found: list[AxesCause] = []
        if n_out > 1:
            found.append(cls(np.zeros(n_out * (n_out - 1)), "sensor"))
        if n_in > 1:
            found.append(cls(np.zeros(n_in * (n_in - 1)), "drive"))
        if model.modes is not None and n_in > 1 and n_out > 1:
            found.append(cls(np.zeros(model.modes.n_modes * (n_out + n_in + 1)), "modes", n_out + n_in - 2))
        return found

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the coupling."""
        if self.form == "sensor":
            return outputs_mixed(model, self._mix(model.n_outputs))
        if self.form == "drive":
            return inputs_mixed(model, self._mix(model.n_inputs))
        modes = model.modes
        assert modes is not None
        n, n_out, n_in = modes.n_modes, model.n_outputs, model.n_inputs
        values = self.values.reshape(n, n_out + n_in + 1)
        gain, frequency, damping = np.exp(np.clip(values[:, -3:].T, -_MOST, _MOST))
        changed = replace(
            modes,
            output_shape=_shared(modes.output_shape, values[:, : n_out - 1]) * gain[:, None],
            input_shape=_shared(modes.input_shape, values[:, n_out - 1 : -3]),
            frequency_hz=modes.frequency_hz * frequency,
            damping=modes.damping * damping,
        )
        return replace(model, modes=changed)

    def companions(self) -> AxesCause | None:
        """Return what it does to the axes themselves; nothing where it is static."""
        if self.form != "modes":
            return None
        return replace(self, values=self.values * self._is_companion)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return where it acts, and the entries that matter as "to<from" with their size [um/um]."""
        if self.form != "modes":
            mix = self._mix(model.n_outputs if self.form == "sensor" else model.n_inputs)
            np.fill_diagonal(mix, 0.0)
        else:
            gain, before = self.applied(model).static_gain(), model.static_gain()
            mix = (gain - before) / np.max(np.abs(before))
            np.fill_diagonal(mix, 0.0)
        largest = float(np.max(np.abs(mix)))
        entries = {
            f"axis_{i + 1}_at_{o + 1}": float(mix[o, i])
            for o, i in np.ndindex(*mix.shape)
            if abs(mix[o, i]) > _SHOWN * largest
        }
        return {"form": self.form, **entries}

    @property
    def _is_companion(self) -> Array:
        n_each = self.n_others + 3
        return np.asarray(np.arange(self.values.size) % n_each >= self.n_others, dtype=np.float64)

    def _mix(self, n: int) -> Array:
        mix = np.eye(n)
        mix[~np.eye(n, dtype=bool)] = self.values
        return mix


def _shared(shape: ComplexArray, shares: Array) -> ComplexArray:
    """Return shapes (n_modes, n_axes) with shares of each mode's largest entry added to its others."""
    n, n_axes = shape.shape
    own = np.argmax(np.abs(shape), axis=1)
    others = np.array([[a for a in range(n_axes) if a != k] for k in own], dtype=int).reshape(n, n_axes - 1)
    changed, rows = shape.copy(), np.arange(n)[:, None]
    changed[rows, others] += shares * shape[np.arange(n), own][:, None]
    return np.asarray(changed)
