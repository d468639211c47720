"""The electromechanical model of Goldfarb and Celanovic 1997, (3)-(10): MRC, transformer and mechanics.

As published: one transformer ratio for both ways (T_F = T_q), ideal capacitors, no creep. Voltage and
displacement alone determine the elements and the mechanics, not the capacitance: what the mechanics give
back to the circuit only enters through T^2 / (k C), held here at a stage's usual value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fomrc_core.comparison.baselines.mrc import FittedStops, fitted_stops
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord, training_error_um
from fomrc_core.plants.electromechanical import ElectromechanicalPlant

Array = NDArray[np.float64]

_STIFFNESS_N_PER_M = 45e6
_COUPLING = 0.2  # T^2 / (k C)
_N_FIT_SAMPLES = 3000


@dataclass(frozen=True, eq=False)
class FittedGoldfarbCelanovic(FittedRival):
    """The plant with its elements and mechanics found.

    Attributes:
        stops: the elements.
        resonance_hz: of the mechanics [Hz].
        damping_ratio: of the mechanics.
        substep_s: of the integration [s].
    """

    stops: FittedStops
    resonance_hz: float
    damping_ratio: float
    substep_s: float

    has_inverse = False

    @property
    def n_parameters(self) -> int:
        """Elements, resonance and damping."""
        return self.stops.n_parameters + 2

    def plant(self) -> ElectromechanicalPlant:
        """Return the plant, its capacitance from the coupling."""
        gain_um_per_v = 1.0 / self.stops.last_v_per_um
        ratio = gain_um_per_v * 1e-6 * _STIFFNESS_N_PER_M  # T [N/V] = [C/m]
        capacitance = ratio**2 / (_STIFFNESS_N_PER_M * _COUPLING)
        effective = capacitance * _STIFFNESS_N_PER_M / ratio + ratio
        mass = _STIFFNESS_N_PER_M / (2.0 * math.pi * self.resonance_hz) ** 2
        kappa = 1.0 / self.stops.compliance_v_per_um
        return ElectromechanicalPlant(
            mass_kg=mass,
            damping_n_s_per_m=2.0 * self.damping_ratio * math.sqrt(_STIFFNESS_N_PER_M * mass),
            stiffness_n_per_m=_STIFFNESS_N_PER_M,
            force_ratio_n_per_v=ratio,
            charge_ratio_c_per_m=ratio,
            capacitance_f=capacitance,
            element_capacitance_f=kappa * 1e-6 * effective,
            saturation_v=self.stops.thresholds_um / kappa,
            element_order=np.zeros(kappa.size),
            branch_order=0.0,
            substep_s=self.substep_s,
            longest_time_s=1e-3,  # orders of zero: nothing to remember
        )

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return self.plant().simulate(steps_s, voltage_v)


@dataclass(frozen=True)
class GoldfarbCelanovic(Rival):
    """The electromechanical model.

    Args:
        n_thresholds: size of the grid of thresholds of its MRC.
    """

    n_thresholds: int = 16
    name: str = field(default="Goldfarb-Celanovic electromechanical", init=False)
    publication: str = field(default="Goldfarb and Celanovic 1997, references 12 and 13", init=False)

    def fit(self, records: Sequence[TrainingRecord]) -> FittedGoldfarbCelanovic:
        """Return the rival fitted: the mechanics, and for each trial of them the elements.

        The elements are fitted on the voltage as the mechanics would delay it, or else they would take the
        lag of the mechanics for hysteresis.
        """
        step_s = float(np.median(records[0].steps_s))
        first = [
            TrainingRecord(
                r.steps_s[:_N_FIT_SAMPLES],
                r.voltage_v[:_N_FIT_SAMPLES],
                r.displacement_um[:_N_FIT_SAMPLES],
                r.is_scored[:_N_FIT_SAMPLES],
            )
            for r in records
        ]
        first = [r for r in first if np.count_nonzero(r.is_scored) > 2] or list(records)

        def fitted(logs: Array) -> FittedGoldfarbCelanovic:
            resonance, damping = (float(v) for v in np.exp(logs))
            lag = _mechanics(resonance, damping, step_s / 2.0)
            delayed = [replace(r, voltage_v=lag.simulate(r.steps_s, r.voltage_v)) for r in first]
            stops = fitted_stops(delayed, self.n_thresholds, has_last=True)
            return FittedGoldfarbCelanovic(stops, resonance, damping, step_s / 2.0)

        nyquist = 0.5 / step_s
        minimiser: Any = minimize
        found = minimiser(
            lambda logs: training_error_um(fitted(logs), first),
            np.log([0.3 * nyquist, 0.7]),
            method="Nelder-Mead",
            bounds=[(math.log(0.005 * nyquist), math.log(20.0 * nyquist)), (math.log(0.02), math.log(20.0))],
            options={"maxiter": 40, "xatol": 3e-3, "fatol": 1e-9},
        )
        return fitted(found.x)


def _mechanics(resonance_hz: float, damping_ratio: float, substep_s: float) -> ElectromechanicalPlant:
    """Return mass, spring and damper alone, 1 um per volt."""
    mass = _STIFFNESS_N_PER_M / (2.0 * math.pi * resonance_hz) ** 2
    nothing = np.empty(0)
    return ElectromechanicalPlant(
        mass_kg=mass,
        damping_n_s_per_m=2.0 * damping_ratio * math.sqrt(_STIFFNESS_N_PER_M * mass),
        stiffness_n_per_m=_STIFFNESS_N_PER_M,
        force_ratio_n_per_v=_STIFFNESS_N_PER_M * 1e-6,
        charge_ratio_c_per_m=0.0,
        capacitance_f=1.0,
        element_capacitance_f=nothing,
        saturation_v=nothing,
        element_order=nothing,
        branch_order=0.0,
        substep_s=substep_s,
        longest_time_s=1e-3,
    )
