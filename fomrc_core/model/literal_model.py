"""The FOMRC model taken literally, (20)-(22): every element with its own charge, memory and order.

The paper goes on from it to the simplified (26), in which hysteresis and creep come one after the other:
that is ``PiezoModel``. This one is an option for studies; docs/decisions/literal-or-simplified-model.md
says how far apart the two are.

Per element: D^alpha_i q_i = kappa_i u_i, charges divided by T_e and so in um. While |u_i| < u_S,i its charge
follows the displacement, dq_i = dx. Saturated it is frozen, upon which u_i relaxes, falls below u_S,i and
lets charge in again: between the two it takes just as much charge as keeps it at u_S,i. The last element
never saturates, so its charge is the displacement. Both directions are direct: forward, the sum of the u_i
is a concave, piecewise linear function of the change of displacement, and Newton's method ends after
finitely many pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.errors import ParameterError
from fomrc_core.operators.creep import (
    CACHED_STEP,
    CURRENT_WEIGHT,
    check_order,
    creep_block,
    creep_history,
    creep_modes,
    creep_remember,
    prepare_step,
)
from fomrc_core.operators.hysteresis import check_elements

Array = NDArray[np.float64]

_SHORTEST_ORDER = 1e-9  # an element without creep still needs a block of the common size


@compiled
def follow(
    steps_s: Array,
    given: Array,
    is_inverse: bool,
    kappa: Array,
    saturation: Array,
    blocks: Array,
    charge: Array,
    out: Array,
) -> None:
    """Fill ``out`` with displacement for given voltage, or with voltage for given displacement."""
    n = saturation.size
    held = np.empty(n + 1)
    slope = np.empty(n + 1)
    history = np.empty(n + 1)
    for k in range(steps_s.size):
        for i in range(n + 1):
            block = blocks[i]
            if block[CACHED_STEP] != steps_s[k]:
                prepare_step(block, 0, steps_s[k])
            history[i] = creep_history(block, 0)
            weight = block[CURRENT_WEIGHT]
            held[i] = (charge[i] / kappa[i] - history[i]) / weight
            slope[i] = 1.0 / (kappa[i] * weight)
        if is_inverse:
            change = given[k] - charge[n]
            sign = 1.0 if change >= 0.0 else -1.0
            change = abs(change)
        else:
            total = 0.0
            for i in range(n + 1):
                total += held[i]
            sign = 1.0 if given[k] >= total else -1.0
            change = 0.0
            n_free = -1
            while True:
                total = 0.0
                rise = 0.0
                n_now = 0
                for i in range(n + 1):
                    risen = sign * held[i] + slope[i] * change
                    limit = max(saturation[i], sign * held[i]) if i < n else np.inf
                    if risen < limit:
                        total += risen
                        rise += slope[i]
                        n_now += 1
                    else:
                        total += limit
                if n_now == n_free:
                    break
                n_free = n_now
                change += (sign * given[k] - total) / rise
        voltage = 0.0
        for i in range(n + 1):
            risen = sign * held[i] + slope[i] * change
            if i < n:
                risen = min(risen, max(saturation[i], sign * held[i]))
            own = sign * risen
            charge[i] = kappa[i] * (blocks[i][CURRENT_WEIGHT] * own + history[i])
            creep_remember(blocks[i], 0, own)
            voltage += own
        out[k] = voltage if is_inverse else charge[n]


@dataclass
class LiteralState:
    """What the literal model remembers.

    Attributes:
        blocks: creep block of each element, shape (n + 1, block size).
        charge_um: q_i / T_e of each element [um], shape (n + 1,).
    """

    blocks: Array
    charge_um: Array


@dataclass(frozen=True, eq=False)
class LiteralModel:
    """The model of (20)-(22) without the simplification (26).

    Args:
        kappa_um_per_v: gains kappa_i [um s^-alpha / V], shape (n + 1,).
        saturation_v: saturation voltages [V], shape (n,).
        creep_order: alpha_i, one for all or shape (n + 1,), 0 to below 1.

    Raises:
        ParameterError: a value out of range, or lists that do not fit.
    """

    kappa_um_per_v: Array
    saturation_v: Array
    creep_order: float | Array

    def __post_init__(self) -> None:
        kappa, saturation = check_elements(self.kappa_um_per_v, self.saturation_v)
        orders = np.broadcast_to(np.asarray(self.creep_order, dtype=np.float64), kappa.shape).copy()
        for order in orders:
            if not check_order(float(order)) < 1.0:
                raise ParameterError(
                    "creep order out of range", where="creep_order", value=float(order), allowed="0 to below 1"
                )
        object.__setattr__(self, "kappa_um_per_v", kappa)
        object.__setattr__(self, "saturation_v", saturation)
        object.__setattr__(self, "creep_order", orders)

    def initial_state(self) -> LiteralState:
        """Return the relaxed state."""
        orders = np.maximum(np.asarray(self.creep_order), _SHORTEST_ORDER)
        blocks = [creep_block(creep_modes(float(order))) for order in orders]
        return LiteralState(np.vstack(blocks), np.zeros(self.kappa_um_per_v.size))

    def simulate(self, steps_s: ArrayLike, voltage_v: ArrayLike, state: LiteralState | None = None) -> Array:
        """Return the displacement [um], shape (n_samples,).

        Args:
            steps_s: step that leads to each sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            state: moves on where given.
        """
        return self._follow(steps_s, voltage_v, state, False)

    def invert(self, steps_s: ArrayLike, desired_um: ArrayLike, state: LiteralState | None = None) -> Array:
        """Return the drive [V] for a desired displacement [um], shape (n_samples,)."""
        return self._follow(steps_s, desired_um, state, True)

    def _follow(self, steps_s: ArrayLike, given: ArrayLike, state: LiteralState | None, is_inverse: bool) -> Array:
        steps = np.ascontiguousarray(steps_s, dtype=np.float64)
        values = np.ascontiguousarray(given, dtype=np.float64)
        if steps.shape != values.shape or steps.ndim != 1 or not np.all(steps > 0.0):
            raise ParameterError("steps do not fit", where="steps_s", value=steps.shape, allowed="> 0, one a sample")
        if not np.all(np.isfinite(values)):
            raise ParameterError("value is not finite", where="given", allowed="finite numbers")
        own = self.initial_state() if state is None else state
        out = np.empty(values.size)
        follow(steps, values, is_inverse, self.kappa_um_per_v, self.saturation_v, own.blocks, own.charge_um, out)
        return out
