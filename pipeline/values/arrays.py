"""Arrays on the way into a value: float64 copies, shape-checked and read-only."""

import numpy as np


def frozen(array, shape, name, dtype=np.float64, is_handed_over=False):
    """A read-only copy of the wanted dtype.

    Args:
        array: anything numpy can read.
        shape: expected shape; None stands for any length.
        name: used in the error.
        is_handed_over: the array is nobody else's and too large to copy: it is made read-only itself where its dtype fits.
    Raises:
        ValueError: the shape is another one.

    >>> given = np.zeros(3)
    >>> frozen(given, (3,), "given") is given, frozen(given, (3,), "given", is_handed_over=True) is given
    (False, True)
    """
    copy = np.array(array, dtype=dtype, copy=None if is_handed_over else True)
    if copy.ndim != len(shape) or any(w is not None and w != g for w, g in zip(shape, copy.shape)):
        raise ValueError(f"{name}: expected shape {shape}, got {copy.shape}")
    copy.setflags(write=False)
    return copy
