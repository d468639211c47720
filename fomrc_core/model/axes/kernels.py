"""The modes of several axes, step by step: held drives, delayed, integrated exactly over each piece of a hold.

What is under way between drive and modes is a queue of pieces, each a length [s] and a drive, that together last as
long as the delay. A step pushes the drive held until now and lets as much time out at the other end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled, compiled_inline, compiled_sums

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

N_PIECES = 256  # under way at once: a delay of so many steps less one
N_SLOTS = 3  # lengths whose factors are kept: two pieces of a hold, and the whole
SAME = 1e-9  # lengths that differ by less, relatively, are one: rounding of the queue
MOVED = 1e-3  # relative change of level by which factors are made anew: 1e-5 of a frequency

# Scalars of a state: sums of the level and of its weights, level in use (negative: told), clock of the queue.
LEVEL_SUM, LEVEL_WEIGHT, LEVEL_USED, LEVEL_TOLD, QUEUE_TOTAL = range(5)
N_SCALARS = 5
FIRST, COUNT, NEXT_SLOT = range(3)  # of the queue, and of the slots


@compiled
def set_level(level_v: float, law: Array, base: Array, poles: ComplexArray, gains: Array, lengths: Array) -> None:
    """Set poles (M,), gains (M + 1,; the last is of the static part) and forget all factors.

    law: reference level [V], exponent, memory [s], change of the static part. base: rows of modes' frequency
    [rad/s], damping, softening, its square, change of damping, change of gain.
    """
    q = 0.0
    if law[0] > 0.0:
        q = max(level_v / law[0], 1e-3) ** law[1] - 1.0
    for m in range(poles.size):
        omega = base[0, m] * min(max(1.0 + base[2, m] * q + base[3, m] * q * q, 0.1), 10.0)
        damping = min(max(base[1, m] * np.exp(base[4, m] * q), 1e-6), 0.999)
        poles[m] = complex(-damping * omega, omega * np.sqrt(1.0 - damping * damping))
        gains[m] = 1.0 + base[5, m] * q
    gains[poles.size] = 1.0 + law[3] * q
    lengths[:] = -1.0


@compiled
def _slot(
    length: float, poles: ComplexArray, lengths: Array, decay: ComplexArray, drive: ComplexArray, places: IntArray
) -> int:
    for k in range(N_SLOTS):
        if abs(lengths[k] - length) <= SAME * length:
            return k
    k = int(places[NEXT_SLOT])
    places[NEXT_SLOT] = (k + 1) % N_SLOTS
    lengths[k] = length
    for m in range(poles.size):
        p = poles[m]
        decay[k, m] = np.exp(p * length)
        # -j w^2 / w_d (e^(ph) - 1) / p: w^2 / p is the conjugate of p
        drive[k, m] = complex(0.0, -1.0) / p.imag * p.conjugate() * (decay[k, m] - 1.0)
    return k


@compiled_inline
def _follow_level(
    step: float,
    square: float,
    law: Array,
    base: Array,
    scalars: Array,
    poles: ComplexArray,
    gains: Array,
    lengths: Array,
) -> None:
    fade = np.exp(-step / law[2])
    scalars[LEVEL_SUM] = scalars[LEVEL_SUM] * fade + square * step
    scalars[LEVEL_WEIGHT] = scalars[LEVEL_WEIGHT] * fade + step
    level = np.sqrt(scalars[LEVEL_SUM] / scalars[LEVEL_WEIGHT])
    if abs(level - scalars[LEVEL_USED]) > MOVED * scalars[LEVEL_USED]:
        scalars[LEVEL_USED] = level
        set_level(level, law, base, poles, gains, lengths)


@compiled_inline
def _queue(
    step: float,
    held: Array,
    shapes_in: ComplexArray,
    places: IntArray,
    queue_s: Array,
    queue_um: Array,
    queue_modes: ComplexArray,
) -> None:
    last = (places[FIRST] + places[COUNT]) % N_PIECES
    places[COUNT] += 1
    queue_s[last] = step
    for i in range(held.size):
        queue_um[last, i] = held[i]
    for m in range(shapes_in.shape[0]):
        total = complex(0.0, 0.0)
        for i in range(held.size):
            total += shapes_in[m, i] * held[i]
        queue_modes[last, m] = total


@compiled_inline
def _let_out(
    step: float,
    places: IntArray,
    queue_s: Array,
    queue_modes: ComplexArray,
    xi: ComplexArray,
    poles: ComplexArray,
    lengths: Array,
    decay: ComplexArray,
    drive: ComplexArray,
) -> None:
    left = step
    while left > 0.0 and places[COUNT] > 0:
        first = places[FIRST]
        piece = min(queue_s[first], left)
        is_whole = queue_s[first] <= left * (1.0 + SAME)
        k = _slot(piece, poles, lengths, decay, drive, places)
        for m in range(poles.size):
            xi[0, m] = decay[k, m] * xi[0, m] + drive[k, m] * queue_modes[first, m]
        if is_whole:
            places[FIRST] = (first + 1) % N_PIECES
            places[COUNT] -= 1
        else:
            queue_s[first] -= piece
        left -= piece
        if left <= SAME * step:
            left = 0.0


@compiled_inline
def _answer(
    xi: ComplexArray, shapes_out: ComplexArray, gains: Array, static: Array, drive_um: Array, out: Array
) -> None:
    n_modes = shapes_out.shape[0]
    for o in range(out.size):
        total = 0.0
        for i in range(drive_um.size):
            total += static[o, i] * drive_um[i]
        out[o] = total * gains[n_modes]
    for m in range(n_modes):
        moved = (xi[0, m] + xi[1, m]) * gains[m]
        for o in range(out.size):
            c = shapes_out[m, o]
            out[o] += c.real * moved.real - c.imag * moved.imag


@compiled_sums
def run_modes(
    steps_s: Array,
    voltage_v: Array,
    moved_um: Array,
    law: Array,
    base: Array,
    shapes_in: ComplexArray,
    shapes_out: ComplexArray,
    static: Array,
    joints: Array,
    scalars: Array,
    places: IntArray,
    held: Array,
    queue_s: Array,
    queue_um: Array,
    queue_modes: ComplexArray,
    xi: ComplexArray,
    forces: Array,
    poles: ComplexArray,
    gains: Array,
    lengths: Array,
    decay: ComplexArray,
    drive: ComplexArray,
    out: Array,
) -> bool:
    """Fill ``out`` (N, O) [um] from the axes' own displacements (N, I) [um]; the state moves on.

    Returns False where the queue is too short for the delay in such steps: nothing is right from there on.
    """
    n_in, has_law = moved_um.shape[1], law[0] > 0.0 and scalars[LEVEL_TOLD] < 0.5
    for n in range(steps_s.size):
        step = steps_s[n]
        if has_law:
            square = 0.0
            for i in range(n_in):
                square += voltage_v[n, i] * voltage_v[n, i] / n_in
            _follow_level(step, square, law, base, scalars, poles, gains, lengths)
        if places[COUNT] >= N_PIECES:
            return False
        _queue(step, held, shapes_in, places, queue_s, queue_um, queue_modes)
        if joints.shape[0]:
            # forces held over the step
            k = _slot(step, poles, lengths, decay, drive, places)
            for m in range(poles.size):
                force = 0.0
                for j in range(joints.shape[0]):
                    force += joints[j, m] * forces[j]
                xi[1, m] = decay[k, m] * xi[1, m] + drive[k, m] * force
        _let_out(step, places, queue_s, queue_modes, xi, poles, lengths, decay, drive)
        for i in range(n_in):
            held[i] = moved_um[n, i]
        for j in range(joints.shape[0]):
            strain = 0.0
            for m in range(poles.size):
                strain += joints[j, m] * xi[0, m].real
            forces[j] = strain * abs(strain)
        under_way = held if places[COUNT] == 0 else queue_um[places[FIRST]]
        _answer(xi, shapes_out, gains, static, under_way, out[n])
    return True
