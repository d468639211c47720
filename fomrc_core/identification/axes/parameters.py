"""What is fitted: the parameters of several axes as one vector, any of them free or held."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Fields of any stage, with hysteresis or without, of one level or several.
BASE = ("log_frequency", "log_damping", "output_re", "output_im", "input_re", "input_im", "static", "delay_s")


@dataclass(frozen=True, eq=False)
class AxesParameters:
    """Everything a fit of several axes may move, M modes, I inputs, O outputs, P plays on each input, J joints.

    Attributes:
        log_frequency: of the modes in rad/s, (M,).
        log_damping: (M,).
        output_re, output_im: output shapes, (M, O).
        input_re, input_im: input shapes, (M, I).
        softening, softening_squared, damping_change, gain_change: see ``AxesModes``, (M,).
        static: direct coupling [um/um], (O, I).
        static_change: its relative change with the level, (1,).
        exponent: of the level law, (1,).
        delay_s: (1,).
        play_weights: weights of the plays on each input, (P, I); the slope beside them is 1. The last two rows are of
            the relay of the rate, now and a step later, where there is one.
        joint: shapes of the joints, (J, M).
    """

    log_frequency: Array
    log_damping: Array
    output_re: Array
    output_im: Array
    input_re: Array
    input_im: Array
    softening: Array
    softening_squared: Array
    damping_change: Array
    gain_change: Array
    static: Array
    static_change: Array
    exponent: Array
    delay_s: Array
    play_weights: Array
    joint: Array

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return int(self.log_frequency.size)

    @property
    def output_shape(self) -> NDArray[np.complex128]:
        """Complex output shapes, (M, O)."""
        return np.asarray(self.output_re + 1j * self.output_im)

    @property
    def input_shape(self) -> NDArray[np.complex128]:
        """Complex input shapes, (M, I)."""
        return np.asarray(self.input_re + 1j * self.input_im)

    def vector(self) -> Array:
        """Return all as one vector."""
        return np.concatenate([getattr(self, field.name).ravel() for field in fields(self)])

    def moved_to(self, vector: Array) -> AxesParameters:
        """Return the parameters of a vector."""
        found, at = {}, 0
        for field in fields(self):
            old = getattr(self, field.name)
            found[field.name] = vector[at : at + old.size].reshape(old.shape)
            at += old.size
        return replace(self, **found)

    def places(self) -> dict[str, NDArray[np.int64]]:
        """Return where each field is in the vector, shaped like the field."""
        found, at = {}, 0
        for field in fields(self):
            old = getattr(self, field.name)
            found[field.name] = np.arange(at, at + old.size).reshape(old.shape)
            at += old.size
        return found

    def mask(self, *names: str) -> Mask:
        """Return which entries of the vector belong to the named fields."""
        free = np.zeros(self.vector().size, dtype=bool)
        places = self.places()
        for name in names:
            free[places[name].ravel()] = True
        return free

    def in_one_gauge(self) -> AxesParameters:
        """Return the same model with each mode's largest input shape 1: what a scale between shapes leaves free."""
        b, c = self.input_shape, self.output_shape
        largest = b[np.arange(b.shape[0]), np.argmax(np.abs(b), axis=1)][:, None]
        b, c = b / largest, c * largest
        return replace(self, input_re=b.real, input_im=b.imag, output_re=c.real, output_im=c.imag)
