"""Softened masks."""

import numpy as np
from scipy.ndimage import correlate1d

from cuspline.values import fixed_math as fixed

REACH = 4           # standard deviations


def blurred(mask, sigma, mode="reflect"):
    """(...,) mask averaged by a Gaussian of `sigma` nodes; `mode` says what lies outside, as in scipy.ndimage."""
    reach = int(REACH * sigma + 0.5)
    weights = fixed.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights = weights / weights.sum()
    out = np.asarray(mask, float)
    for axis in range(out.ndim):
        out = correlate1d(out, weights, axis=axis, mode=mode)
    return out
