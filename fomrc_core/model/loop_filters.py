"""The filters of a live loop: those that undo the mechanics, the amplifier, and what bends between the samples."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.effects import Effect
from fomrc_core.model.hysteresis_bends import WIDE_FLAT, bend_taps
from fomrc_core.model.near_sample_rate import is_struck_within_samples
from fomrc_core.model.preview_filter import PreviewFilter, preview_filter

# So far ahead the hysteresis is stepped to undo the amplifier, at most half the preview: a difference over so many
# samples is right to 1e-4 up to a tenth of the sample rate.
_MOST_DRIVE_AHEAD = 6
# The same before a stage that rings: bends of so many samples to come leave as little ringing as those of more.
_MOST_STRUCK_AHEAD = 4
_NOTHING = PreviewFilter(np.ones(1), 0, math.inf, math.inf)


class LoopFilters(NamedTuple):
    """Taps on the target, on the voltage of the hysteresis, and on its bends (none where nothing rings)."""

    target: PreviewFilter
    drive: PreviewFilter
    bends: Array


@functools.lru_cache(maxsize=16)
def _filter_for(effects: tuple[Effect, ...], step_s: float, n_preview: int, is_straight: bool) -> PreviewFilter:
    """Return the filter that undoes effects, and what a voltage straight between samples lacks of a course."""

    def response(frequency_hz: Array) -> ComplexArray:
        return joint_response(effects, frequency_hz) * (_line(frequency_hz, step_s) if is_straight else 1.0)

    return preview_filter(response, step_s, n_preview)


@functools.lru_cache(maxsize=16)
def _drive_filters(amplifier: tuple[Effect, ...], step_s: float, n_ahead: int) -> tuple[PreviewFilter, Array]:
    """Return the filters that undo an amplifier before a stage that rings, of samples and of what lies between them.

    What the stage sees is to be the straight line from sample to sample of the hysteresis voltage, and its bends.
    """
    is_held = any(effect.holds for effect in amplifier)

    def of_line(frequency_hz: Array) -> ComplexArray:
        gain = joint_response(amplifier, frequency_hz)
        return np.asarray(gain / _line(frequency_hz, step_s)) if is_held else gain

    def of_bends(frequency_hz: Array) -> ComplexArray:
        return np.asarray(of_line(frequency_hz) * _line(frequency_hz, step_s))

    if not amplifier:
        of_samples = PreviewFilter(np.append(1.0, np.zeros(n_ahead)), n_ahead, math.inf, math.inf)
        return of_samples, bend_taps(of_bends, step_s, WIDE_FLAT / step_s, n_ahead)
    of_samples = preview_filter(of_line, step_s, n_ahead, WIDE_FLAT)
    return of_samples, bend_taps(of_bends, step_s, of_samples.reaches_hz, of_samples.n_ahead)


def _line(frequency_hz: Array, step_s: float) -> Array:
    """Return what is left of a course in a straight line from sample to sample [1], at frequencies [Hz]."""
    return np.asarray(np.sinc(frequency_hz * step_s) ** 2)


def joint_response(effects: tuple[Effect, ...], frequency_hz: Array) -> ComplexArray:
    """Return the complex gain [1] of linear effects one behind the other at frequencies [Hz], of one shape."""
    gain = np.ones(frequency_hz.shape, dtype=np.complex128)
    for effect in effects:
        own = effect.response(frequency_hz)
        if own is not None:
            gain = gain * own
    return gain


def loop_filters(
    mechanics: tuple[Effect, ...], amplifier: tuple[Effect, ...], step_s: float, n_preview: int
) -> LoopFilters:
    """Return the filters of a loop.

    Args:
        mechanics: linear effects behind the hysteresis.
        amplifier: linear effects before it.
        step_s: period [s].
        n_preview: periods of the future that are known.
    """
    is_struck = is_struck_within_samples(mechanics, step_s)
    most_ahead = _MOST_STRUCK_AHEAD if is_struck else _MOST_DRIVE_AHEAD
    n_drive = min(most_ahead, n_preview // 2) if amplifier or is_struck else 0
    if is_struck:
        target = _filter_for(mechanics, step_s, n_preview - n_drive, is_straight=True)
        return LoopFilters(target, *_drive_filters(amplifier, step_s, n_drive))
    is_straight = not any(effect.holds for effect in amplifier)
    return LoopFilters(
        _filter_for(mechanics, step_s, n_preview - n_drive, is_straight) if mechanics else _NOTHING,
        _filter_for(amplifier, step_s, n_drive, is_straight and not mechanics) if amplifier else _NOTHING,
        np.zeros((0, 0)),
    )
