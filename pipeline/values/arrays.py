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


def covered(array, shape, name):
    """A read-only view of an array that is nobody else's and too large to copy; `lent` gives kernels what it covers.

    >>> given = np.zeros(3)
    >>> view = covered(given, (3,), "given")
    >>> view.flags.writeable, lent(view) is given
    (False, True)
    """
    return frozen(np.asarray(array, np.float64)[:], shape, name, is_handed_over=True)


def lent(array):
    """The array as kernels are handed it, see `for_kernel`: without a copy where it is `covered`."""
    base = array.base
    is_whole = isinstance(base, np.ndarray) and base.shape == array.shape and base.flags.writeable and base.flags.c_contiguous
    return base if is_whole and base.dtype == array.dtype else for_kernel(array)


def runs_of(mask):
    """[(first, behind the last)] of the runs of true values of (n,) bool.

    >>> runs_of(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]
    """
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int))).tolist()
    return list(zip(edges[::2], edges[1::2]))


def for_kernel(array, dtype=np.float64):
    """The array as kernels are handed it: contiguous and writable, a copy where it is not.

    Numba compiles a kernel once more for arrays that lie otherwise or are read-only.
    """
    return np.require(array, dtype, ("C", "W"))
