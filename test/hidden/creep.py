"""Power-law creep of the truth: the fractional integral as one exact convolution, done by FFT."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import gamma

# From here on the second difference loses more digits to cancellation than its series to truncation.
_SERIES_FROM = 200


def hat_weights(order: float, n_samples: int) -> np.ndarray:
    """Return the response, lag by lag, of the fractional integral to one unit hat on a unit grid.

    The integral of order a of a piecewise linear y is exactly the sum over its nodes of y_j w_{k-j} h^a with
    w_0 = 1/Gamma(a+2) and w_l = ((l+1)^(a+1) - 2 l^(a+1) + (l-1)^(a+1))/Gamma(a+2).
    """
    power = order + 1.0
    lag = np.arange(n_samples, dtype=np.float64)
    weights = np.empty(n_samples)
    weights[0] = 1.0
    near = lag[1 : min(_SERIES_FROM, n_samples)]
    weights[1 : 1 + near.size] = (near + 1.0) ** power - 2.0 * near**power + (near - 1.0) ** power
    far = lag[1 + near.size :]
    second = power * (power - 1.0)
    fourth = second * (power - 2.0) * (power - 3.0)
    weights[1 + near.size :] = far ** (power - 2.0) * (second + fourth / (12.0 * far**2))
    return weights / gamma(order + 2.0)


def fractional_integral(values: np.ndarray, order: float, step_s: float) -> np.ndarray:
    """Integrate a signal that starts at zero, linear between its nodes, to a fractional order."""
    if abs(values[0]) > 1e-12:
        raise ValueError(f"the signal must start at zero, got {values[0]!r}")
    n = values.size
    length = next_fast_len(2 * n - 1, real=True)
    spectrum = rfft(values, length) * rfft(hat_weights(order, n), length)
    return irfft(spectrum, length)[:n] * step_s**order
