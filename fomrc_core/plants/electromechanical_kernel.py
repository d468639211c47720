"""Time stepping of the electromechanical plant: each substep solves equations (3)-(10) together.

No approximation but drive and force being linear within a substep. Columns ``0..n-1`` of the element arrays
are the saturating elements, column ``n`` is the branch of the clamped capacitance and the transformer, which
never saturates. Every column is a resistocaptance, equation (18),

    q = K I^alpha u   ~   K (d u + sum_j W_j z_j),      dz_j/dt = r_j (u - z_j),

and u is linear within a substep, so that z_j is stepped exactly and q is an affine function of the new u.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled

Array = NDArray[np.float64]

POSITION, VELOCITY, FORCE, VOLTAGE = 0, 1, 2, 3
N_MECHANICAL = 4


@compiled
def lag_step(rates_per_s: Array, step_s: float) -> tuple[Array, Array, Array]:
    """Return (keep, old, new): z <- keep z + old u_old + new u_new, exact for u linear within the step."""
    n_rates = rates_per_s.size
    keep = np.empty(n_rates)
    old = np.empty(n_rates)
    new = np.empty(n_rates)
    for j in range(n_rates):
        y = rates_per_s[j] * step_s
        keep[j] = math.exp(-y)
        if y < 1e-3:  # the closed forms cancel here; the series is exact to 1e-13
            new[j] = y * (1.0 / 2.0 - y * (1.0 / 6.0 - y / 24.0))
            old[j] = y * (1.0 / 2.0 - y * (1.0 / 3.0 - y / 8.0))
        else:
            mean = -math.expm1(-y) / y
            new[j] = 1.0 - mean
            old[j] = mean - keep[j]
    return keep, old, new


@compiled
def oscillator_step(mass: float, damping: float, stiffness: float, step_s: float) -> tuple[float, float, float, float]:
    """Return the free motion (xx, xv, vx, vv) over one step of m x'' + c x' + k x = 0, any damping."""
    decay = 0.5 * damping / mass
    squared = stiffness / mass - decay * decay
    if squared > 0.0:
        rate = math.sqrt(squared)
        cosine, sine = math.cos(rate * step_s), math.sin(rate * step_s) / rate
    elif squared < 0.0:
        rate = math.sqrt(-squared)
        cosine, sine = math.cosh(rate * step_s), math.sinh(rate * step_s) / rate
    else:
        cosine, sine = 1.0, step_s
    shrink = math.exp(-decay * step_s)
    return (
        shrink * (cosine + decay * sine),
        shrink * sine,
        -shrink * sine * stiffness / mass,
        shrink * (cosine - decay * sine),
    )


@compiled
def run(
    steps_s: Array,
    voltage_v: Array,
    external_force_n: Array,
    substep_s: float,
    mechanics: Array,  # mass, damping, stiffness, T_F, T_q, C
    compliance_f: Array,  # K of every column; the branch's is 1: its "charge" is the transformer voltage u_T
    saturation_v: Array,
    instant: Array,
    weights: Array,
    rates_per_s: Array,
    motion: Array,
    potential_v: Array,
    scaled_charge: Array,  # q / K per column
    lags: Array,
    displacement_m: Array,
) -> None:
    """Step the plant through the samples in place; displacement_m receives the displacements."""
    mass, damping, stiffness = mechanics[0], mechanics[1], mechanics[2]
    force_ratio, charge_ratio, capacitance = mechanics[3], mechanics[4], mechanics[5]
    n = saturation_v.size
    last_step = -1.0
    for k in range(steps_s.size):
        n_substeps = max(1, math.ceil(steps_s[k] / substep_s - 1e-9))
        step = steps_s[k] / n_substeps
        if step != last_step:
            last_step = step
            keep, old, new = lag_step(rates_per_s, step)
            xx, xv, vx, vv = oscillator_step(mass, damping, stiffness, step)
            # Response of the displacement to the force at the end of the substep, force linear within it.
            slip = damping / (stiffness * stiffness * step)
            reach = 1.0 / stiffness - slip + xx * slip - xv / (stiffness * step)
            stiffened = capacitance + charge_ratio * reach * force_ratio
            grip = instant.copy()
            for j in range(rates_per_s.size):
                grip += new[j] * weights[j]
            slope = 1.0 / (compliance_f[:n] * grip[:n])
            branch_slope = 1.0 / (stiffened * grip[n])
        start_voltage, start_external = motion[VOLTAGE], motion[FORCE] - force_ratio * scaled_charge[n]
        for m in range(n_substeps):
            share = (m + 1.0) / n_substeps
            voltage = start_voltage + share * (voltage_v[k] - start_voltage)
            external = start_external + share * (external_force_n[k] - start_external)
            past = np.zeros(n + 1)
            for j in range(rates_per_s.size):
                lags[j] = keep[j] * lags[j] + old[j] * potential_v
                past += weights[j] * lags[j]
            # Mechanics: displacement = fixed + reach * (T_F u_T + F_ext) at the end of the substep.
            force0 = motion[FORCE]
            rest0 = force0 / stiffness + slip * force0
            rest_rate = force0 / (stiffness * step)
            fixed = xx * (motion[POSITION] - rest0) + xv * (motion[VELOCITY] + rest_rate) + slip * force0
            charge = capacitance * scaled_charge[n] + charge_ratio * motion[POSITION]
            branch = ((charge - charge_ratio * (fixed + reach * external)) / stiffened - past[n]) / grip[n]
            # The change of charge is shared by all: each element follows it up to its saturation voltage and
            # then only so far as keeps it there; not at all if even that leaves it beyond (8), (20).
            held = (scaled_charge[:n] - past[:n]) / grip[:n]
            sign = 1.0 if voltage >= held.sum() + branch else -1.0
            held = sign * held
            limit = np.maximum(saturation_v, held)
            change = 0.0
            n_free = -1
            # Newton on an increasing, concave, piecewise linear function: ends after finitely many pieces.
            while True:
                risen = held + slope * change
                free = risen < limit
                n_now = int(free.sum())
                if n_now == n_free:
                    break
                n_free = n_now
                total = np.where(free, risen, limit).sum() + sign * branch + branch_slope * change
                change += (sign * voltage - total) / ((slope * free).sum() + branch_slope)
            potential_v[:n] = sign * np.minimum(risen, limit)
            potential_v[n] = branch + sign * branch_slope * change
            scaled_charge[:] = grip * potential_v + past
            for j in range(rates_per_s.size):
                lags[j] += new[j] * potential_v
            force1 = force_ratio * scaled_charge[n] + external
            rest_rate = (force1 - force0) / (stiffness * step)
            rest0 = force0 / stiffness - damping * rest_rate / stiffness
            velocity = vx * (motion[POSITION] - rest0) + vv * (motion[VELOCITY] - rest_rate) + rest_rate
            motion[POSITION] = fixed + reach * force1
            motion[VELOCITY] = velocity
            motion[FORCE] = force1
        motion[VOLTAGE] = voltage_v[k]
        displacement_m[k] = motion[POSITION]
