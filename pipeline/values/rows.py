"""Rows inside kernels: what their columns are called where many speak of them, and how they are filled.

An array assigned to a part of another, `row[:] = values`, compiles a message about shapes along with it: two thousand
lines for the compiler, again in every kernel that calls this one.  Element by element it is ten.
"""

from cuspline.values.compiled import njit

X, Y, Z, W = range(4)                                       # of a point; the weight of a homogeneous one
A, B, C = range(3)                                          # corners of a triangle
LOW_X, LOW_Y, LOW_Z, HIGH_X, HIGH_Y, HIGH_Z = range(6)      # of a box: its low corner, then its high one
X_LOW, X_HIGH, Y_LOW, Y_HIGH, Z_LOW, Z_HIGH = range(6)      # of a box: direction by direction
FROM, TO = range(2)                                         # of a stretch


@njit(inline="always")
def put(row, values):
    """Write values (n,) to the first n elements of a row."""
    for k in range(len(values)):
        row[k] = values[k]
