"""Rows inside kernels.

An array assigned to a part of another, `row[:] = values`, compiles a message about shapes along with it: two thousand
lines for the compiler, again in every kernel that calls this one.  Element by element it is ten.
"""

from cuspline.values.compiled import njit


@njit(inline="always")
def put(row, values):
    """Write values (n,) to the first n elements of a row."""
    for k in range(len(values)):
        row[k] = values[k]
