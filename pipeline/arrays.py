"""Arrays on the way into a value: float64 copies, shape-checked and read-only."""

import numpy as np


def frozen(array, shape, name, dtype=np.float64):
    """A read-only copy of the wanted dtype.

    Args:
        array: anything numpy can read.
        shape: expected shape; None stands for any length.
        name: used in the error.
    Raises:
        ValueError: the shape is another one.
    """
    copy = np.array(array, dtype=dtype)
    if copy.ndim != len(shape) or any(w is not None and w != g for w, g in zip(shape, copy.shape)):
        raise ValueError(f"{name}: expected shape {shape}, got {copy.shape}")
    copy.setflags(write=False)
    return copy
