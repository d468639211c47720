"""The figure of the mirror benchmark: displacement, what the model leaves of it, and noise, over frequency."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEASURED, _LEFT, _NOISE = "#9aa5b1", "#d1495b", "#1f6f8b"
_SMOOTH = 9  # lines of which the root mean square is drawn


def mirror_figure(rate_hz: float, spectra: dict[int, tuple[Array, Array, Array]]) -> Figure:
    """Return amplitudes over frequency, a column for each level and a row for each output.

    Args:
        rate_hz: sample rate [Hz].
        spectra: by level [mV], amplitudes [um] of displacement, error and noise, each (n_lines, n_outputs).
    """
    n_out = next(iter(spectra.values()))[0].shape[1]
    figure = Figure(figsize=(4.2 * len(spectra), 2.3 * n_out), layout="constrained")
    grid = figure.subplots(n_out, len(spectra), sharex=True, sharey=True, squeeze=False)
    for column, (level, amplitudes) in enumerate(spectra.items()):
        for o in range(n_out):
            axes = grid[o, column]
            for values, colour, label in zip(
                amplitudes, (_MEASURED, _LEFT, _NOISE), ("displacement", "model's error", "noise"), strict=True
            ):
                smooth = np.sqrt(np.convolve(values[1:, o] ** 2, np.ones(_SMOOTH) / _SMOOTH, mode="same"))
                hz = np.arange(1, values.shape[0]) * (0.5 * rate_hz / (values.shape[0] - 1))
                axes.semilogy(hz, smooth, color=colour, linewidth=0.9, label=label)
            axes.set_xlim(0.0, 3000.0)
            axes.grid(alpha=0.3)
            if o == 0:
                axes.set_title(f"{level} mV")
            if column == 0:
                axes.set_ylabel(f"output {o + 1} [um]")
            if o == n_out - 1:
                axes.set_xlabel("frequency [Hz]")
    low = max(grid[0, 0].get_ylim()[0], 1e-6)
    grid[0, 0].set_ylim(bottom=low)
    grid[0, 0].legend(loc="upper right", fontsize=7)
    return figure
