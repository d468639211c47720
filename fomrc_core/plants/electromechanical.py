"""The electromechanical plant of Goldfarb and Celanovic, equations (3)-(10), with creep by equation (18).

A second, independent description of the actuator: circuit and mechanics, integrated in time with small steps.
It shares no code and no form with the model it is used to test.

Equations, in the paper's symbols and SI units (voltage at the controller's input):

    (3)   m x'' + c x' + k x = F_T + F_ext
    (4)   F_T = T_F u_T
    (5)   q_T = T_q x
    (6)   u   = u_1 + ... + u_n + u_{n+1}
    (7)   q   = C u_T + q_T
    (8)   dq_i = dq while |u_i| < u_S,i; saturated, only as much as keeps u_i at u_S,i
    (18)  D^alpha_i q_i = C_i u_i                 in place of (9), for every element i = 1..n
    (18)  D^alpha_{n+1} u_T = u_{n+1}             for the branch of C and the transformer

Choices where the paper leaves one:

- (3)-(10) were written for pure capacitors, and (12)-(14) then gather the capacitance and the
  transformer into one element n+1 with q = T_e x. (21) makes that whole element a resistocaptance. So
  here the capacitive coupling of the branch, to the charge and to the force alike, is the fractional
  one: the voltage u_T of the ideal capacitor and transformer is the polarisation I^alpha u_{n+1} that
  the voltage across the branch has built up. At rest and without load D^alpha_{n+1} (q / T_e) = (T_F /
  k) u_{n+1}, T_e = C k / T_F + T_q: (12), (13) and (21) hold.
- The literal, per-element form of (20)-(22): each element has its own charge, memory and order. A
  charge held while saturated lets u_i relax below u_S,i, upon which (8) lets charge in again: the two
  limits of (8) together say 0 <= dq_i / dq <= 1 with |u_i| <= u_S,i, which is what is solved.
- The operator s^-alpha is a sum of first-order lags at geometric rates, two a decade, with weights by
  non-negative least squares on the step response over ``shortest_time_s``..``longest_time_s`` (error
  about 1.5e-5).
- The voltage and the external force are linear between samples; before the first sample they rose from
  zero over one step. The oscillator (3) is integrated exactly for a force linear within a substep.

Cost with 40 elements and 50 us substeps: about 90 us per 1 ms sample compiled, 2.2 ms in plain Python, nearly
all of it per substep (110 us), not per element. Without numba choose ``substep_s=1e-3``: 0.16 ms per sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fomrc_core.compute.least_squares import non_negative_fit
from fomrc_core.compute.pulse import beat
from fomrc_core.errors import ParameterError
from fomrc_core.plants import electromechanical_kernel as kernel
from fomrc_core.plants.paper_stage import CREEP_ORDER, KAPPA_UM_PER_V

UM_PER_M = 1e6
_N_TOGETHER = 1 << 14  # samples stepped through before it is told: some tenths of a second with forty elements
_LAGS_PER_DECADE = 2


@dataclass
class ElectromechanicalState:
    """What the plant remembers; owned and changed by whoever steps it.

    Attributes:
        motion: displacement [m], velocity [m/s], force on the mass [N], voltage [V].
        potential_v: voltage of each element and of the branch [V], shape (n_elements + 1,).
        scaled_charge: charge of each over its capacitance [V s^alpha], shape (n_elements + 1,).
        lags: memory of the resistocaptances [V], shape (n_lags, n_elements + 1).
    """

    motion: NDArray[np.float64]
    potential_v: NDArray[np.float64]
    scaled_charge: NDArray[np.float64]
    lags: NDArray[np.float64]

    def copy(self) -> ElectromechanicalState:
        """Return an independent copy."""
        return ElectromechanicalState(*(getattr(self, field.name).copy() for field in fields(self)))


@dataclass(frozen=True, eq=False)
class ElectromechanicalPlant:
    """Parameters of the plant; see the module for the equations.

    Args:
        mass_kg: effective mass m [kg], (3).
        damping_n_s_per_m: damping c [N s/m], (3).
        stiffness_n_per_m: stiffness k [N/m], (3).
        force_ratio_n_per_v: T_F, voltage to force [N/V], (4).
        charge_ratio_c_per_m: T_q, displacement to charge [C/m], (5).
        capacitance_f: C [F], (7).
        element_capacitance_f: C_i [F s^-alpha_i], shape (n_elements,), (18).
        saturation_v: u_S,i [V], shape (n_elements,), (8).
        element_order: alpha_i, shape (n_elements,), 0 <= alpha_i < 1.
        branch_order: alpha_{n+1}, 0 <= alpha < 1.
        substep_s: longest step of the integration [s].
        shortest_time_s: below this time the creep has no further detail [s].
        longest_time_s: up to this time the creep follows the power law [s].

    Raises:
        ParameterError: a value outside its range, or lists of unequal length.
    """

    mass_kg: float
    damping_n_s_per_m: float
    stiffness_n_per_m: float
    force_ratio_n_per_v: float
    charge_ratio_c_per_m: float
    capacitance_f: float
    element_capacitance_f: NDArray[np.float64]
    saturation_v: NDArray[np.float64]
    element_order: NDArray[np.float64]
    branch_order: float
    substep_s: float = 5e-5
    shortest_time_s: float = 2e-5
    longest_time_s: float = 1e5
    # What the kernel takes, made once.
    _rates_per_s: NDArray[np.float64] = field(init=False, repr=False)
    _instant: NDArray[np.float64] = field(init=False, repr=False)
    _weights: NDArray[np.float64] = field(init=False, repr=False)
    _mechanics: NDArray[np.float64] = field(init=False, repr=False)
    _compliance_f: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("element_capacitance_f", "saturation_v", "element_order"):
            values = np.array(getattr(self, name), dtype=np.float64).reshape(-1)
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        for name in ("mass_kg", "stiffness_n_per_m", "capacitance_f", "substep_s", "shortest_time_s"):
            _require(name, getattr(self, name), lambda v: v > 0.0, "> 0")
        for name in ("damping_n_s_per_m", "force_ratio_n_per_v", "charge_ratio_c_per_m"):
            _require(name, getattr(self, name), lambda v: v >= 0.0, ">= 0")
        _require("longest_time_s", self.longest_time_s, lambda v: v > self.shortest_time_s, "> shortest_time_s")
        _require("branch_order", self.branch_order, lambda v: 0.0 <= v < 1.0, "0 <= order < 1")
        n = self.element_capacitance_f.size
        for name, allowed in (("saturation_v", "> 0"), ("element_order", "0 <= order < 1")):
            if getattr(self, name).size != n:
                raise ParameterError(
                    "another length than element_capacitance_f",
                    where=name,
                    value=getattr(self, name).size,
                    allowed=str(n),
                )
            for value in getattr(self, name):
                is_saturation = name == "saturation_v"
                _require(name, float(value), lambda v: v > 0.0 if is_saturation else 0.0 <= v < 1.0, allowed)  # noqa: B023
        for value in self.element_capacitance_f:
            _require("element_capacitance_f", value, lambda v: v > 0.0, "> 0")
        self._prepare()

    def _prepare(self) -> None:
        n_lags = _LAGS_PER_DECADE * math.ceil(math.log10(self.longest_time_s / self.shortest_time_s)) + 1
        rates = np.geomspace(0.2 / self.longest_time_s, 3.0 / self.shortest_time_s, n_lags)
        orders = np.append(self.element_order, self.branch_order)
        span_s = (self.shortest_time_s, self.longest_time_s)
        fitted = np.array([_lag_weights(order, rates, *span_s) for order in orders])
        mechanics = (
            self.mass_kg,
            self.damping_n_s_per_m,
            self.stiffness_n_per_m,
            self.force_ratio_n_per_v,
            self.charge_ratio_c_per_m,
            self.capacitance_f,
        )
        prepared = {
            "_rates_per_s": rates,
            "_instant": np.ascontiguousarray(fitted[:, 0]),
            "_weights": np.ascontiguousarray(fitted[:, 1:].T),
            "_mechanics": np.array(mechanics, dtype=np.float64),
            "_compliance_f": np.append(self.element_capacitance_f, 1.0),
        }
        for name, value in prepared.items():
            object.__setattr__(self, name, value)

    @property
    def n_elements(self) -> int:
        """Number of saturating elements."""
        return int(self.saturation_v.size)

    @property
    def effective_ratio_c_per_m(self) -> float:
        """T_e = C k / T_F + T_q, charge per displacement at rest and without load [C/m], (12)."""
        return self.capacitance_f * self.stiffness_n_per_m / self.force_ratio_n_per_v + self.charge_ratio_c_per_m

    def initial_state(self) -> ElectromechanicalState:
        """Return the relaxed state: no charge, no voltage, at rest."""
        n = self.n_elements + 1
        lags = np.zeros((self._rates_per_s.size, n))
        return ElectromechanicalState(np.zeros(kernel.N_MECHANICAL), np.zeros(n), np.zeros(n), lags)

    def advance(
        self, state: ElectromechanicalState, voltage_v: float, step_s: float, external_force_n: float = 0.0
    ) -> float:
        """Step the state to the next sample and return its displacement [um].

        Args:
            state: changed in place.
            voltage_v: voltage at the next sample [V]; linear on the way there.
            step_s: time to the next sample [s], > 0.
            external_force_n: F_ext at the next sample [N]; linear on the way there.

        Raises:
            ParameterError: a value that is not finite, or a step that is not positive.
        """
        out = self.simulate(np.array([step_s]), np.array([voltage_v]), state, external_force_n=external_force_n)
        return float(out[0])

    def simulate(
        self,
        steps_s: ArrayLike,
        voltage_v: ArrayLike,
        state: ElectromechanicalState | None = None,
        external_force_n: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Return the displacement at each sample [um], shape (n_samples,).

        Args:
            steps_s: step that leads to each sample [s], shape (n_samples,) or one number for all.
            voltage_v: voltage [V], shape (n_samples,).
            state: advanced in place; relaxed where not given.
            external_force_n: F_ext [N], shape (n_samples,) or one number for all.

        Raises:
            ParameterError: values not finite, steps not positive, or unequal lengths.
        """
        voltage = _column("voltage_v", voltage_v, None)
        steps = _column("steps_s", steps_s, voltage.size)
        force = _column("external_force_n", 0.0 if external_force_n is None else external_force_n, voltage.size)
        if not np.all(steps > 0.0):
            raise ParameterError("step is not positive", where="steps_s", value=float(steps.min()), allowed="> 0")
        state = self.initial_state() if state is None else state
        displacement_m = np.empty(voltage.size)
        for first in range(0, voltage.size, _N_TOGETHER):
            part = slice(first, first + _N_TOGETHER)
            kernel.run(
                steps[part],
                voltage[part],
                force[part],
                self.substep_s,
                self._mechanics,
                self._compliance_f,
                self.saturation_v,
                self._instant,
                self._weights,
                self._rates_per_s,
                state.motion,
                state.potential_v,
                state.scaled_charge,
                state.lags,
                displacement_m[part],
            )
            beat("samples of the plant", steps[part].size)
        return UM_PER_M * displacement_m


def table1_plant(
    n_elements: int = 40,
    *,
    creep_order: float = CREEP_ORDER,
    order_spread: float = 0.05,
    resonance_hz: float = 5600.0,
    damping_ratio: float = 0.3,
    substep_s: float = 5e-5,
) -> ElectromechanicalPlant:
    """Return a plant that behaves like the paper's stage (Table 1; PI P-753.1CD on an E-625), 1.2 um/V.

    The elements are not Table 1's: their thresholds are spread evenly in the square root of the
    displacement, and their weights follow a smooth curve through Table 1's initial rising curve.

    Args:
        n_elements: saturating elements.
        creep_order: mean order alpha of the elements.
        order_spread: largest relative deviation of an element's order from the mean.
        resonance_hz: of the stage without the circuit [Hz].
        damping_ratio: of the stage without the circuit.
        substep_s: longest step of the integration [s].

    Raises:
        ParameterError: a value out of range.
    """
    if n_elements < 1:
        raise ParameterError("too few elements", where="n_elements", value=n_elements, allowed="1 or more")
    edges = np.linspace(0.0, math.sqrt(_LARGEST_THRESHOLD_UM), n_elements + 1) ** 2
    weight_v_per_um = -np.diff(_rising_slope_v_per_um(edges))
    threshold_um = 0.5 * (edges[1:] + edges[:-1])
    # A sequence that fills [-1, 1] evenly and without order: golden-ratio steps.
    deviation = 2.0 * np.modf(0.5 + 0.6180339887498949 * np.arange(1, n_elements + 1))[0] - 1.0
    stiffness = 45e6
    mass = stiffness / (2.0 * math.pi * resonance_hz) ** 2
    force_ratio = KAPPA_UM_PER_V[-1] * stiffness / UM_PER_M
    # P-753: 1.5 uF at the piezo, ten times that charge per volt at the controller's input.
    capacitance, charge_ratio = 1.2e-5, 2.5
    effective_ratio = capacitance * stiffness / force_ratio + charge_ratio
    return ElectromechanicalPlant(
        mass_kg=mass,
        damping_n_s_per_m=2.0 * damping_ratio * math.sqrt(stiffness * mass),
        stiffness_n_per_m=stiffness,
        force_ratio_n_per_v=force_ratio,
        charge_ratio_c_per_m=charge_ratio,
        capacitance_f=capacitance,
        element_capacitance_f=effective_ratio / UM_PER_M / weight_v_per_um,
        saturation_v=weight_v_per_um * threshold_um,
        element_order=creep_order * (1.0 + order_spread * deviation),
        branch_order=creep_order,
        substep_s=substep_s,
    )


_LARGEST_THRESHOLD_UM = 3.2


def _rising_slope_v_per_um(displacement_um: NDArray[np.float64]) -> NDArray[np.float64]:
    # Of the initial rising curve u(y) of Table 1: 1.255 V/um at 0, falling to 1/kappa_11 = 0.781.
    share = displacement_um / _LARGEST_THRESHOLD_UM
    return 1.0 / KAPPA_UM_PER_V[-1] + 0.474 * (0.7 * np.exp(-displacement_um / 0.5) + 0.3 * (1.0 - share))


def _lag_weights(
    order: float, rates_per_s: NDArray[np.float64], shortest_s: float, longest_s: float
) -> NDArray[np.float64]:
    """Return feedthrough and lag weights whose step response is t^alpha / Gamma(1 + alpha), least squares."""
    time_s = np.geomspace(shortest_s, longest_s, 40 * rates_per_s.size // 2)
    wanted = time_s**order / math.gamma(1.0 + order)
    basis = np.column_stack([np.ones_like(time_s), -np.expm1(-np.outer(time_s, rates_per_s))])
    return non_negative_fit([basis / wanted[:, None]], [np.ones_like(time_s)])


def _require(name: str, value: float, is_allowed: object, allowed: str) -> None:
    if not (isinstance(value, (int, float)) and math.isfinite(value) and is_allowed(value)):  # type: ignore[operator]
        raise ParameterError("value out of range", where=name, value=value, allowed=allowed)


def _column(name: str, values: ArrayLike, n_samples: int | None) -> NDArray[np.float64]:
    column = np.array(values, dtype=np.float64)
    if column.ndim == 0 and n_samples is not None:
        column = np.full(n_samples, float(column))
    if column.ndim != 1 or (n_samples is not None and column.size != n_samples):
        raise ParameterError("wrong shape", where=name, value=column.shape, allowed=f"({n_samples or 'n_samples'},)")
    if not np.all(np.isfinite(column)):
        raise ParameterError(
            "not finite", where=name, value=float(column[~np.isfinite(column)][0]), allowed="finite numbers"
        )
    return column
