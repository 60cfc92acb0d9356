"""Sparse Cholesky factors of matrices over the nodes of a grid, the same to the last bit everywhere.

SciPy's solver hands its dense blocks to whatever BLAS the processor has; this one sums in one stated order.
Nodes are eliminated by nested dissection: each half of the region first, the line between them last, so that little
fills in.

Source: A. George, SIAM J. Numer. Anal. 10 (1973) 345 (nested dissection); T. Davis, Direct Methods for Sparse Linear
Systems (SIAM 2006), chapter 4 (elimination tree, row by row).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cuspline.values.compiled import njit
from cuspline.values.rows import put

SMALLEST = 12       # nodes that are not parted any more


@dataclass(frozen=True, eq=False, kw_only=True)
class Factors:
    """A = P^T L L^T P."""

    order: np.ndarray       # (n,) node eliminated k-th
    first: np.ndarray       # (n + 1,) where each column of L begins; its diagonal first
    row: np.ndarray         # (m,)
    value: np.ndarray       # (m,)

    @classmethod
    def of(cls, matrix, at):
        """Factors of a matrix.

        Args:
            matrix: (n, n) sparse, symmetric, positive definite; nodes are joined to their eight neighbours at most.
            at: (n, 2) whole grid positions.
        Raises:
            ZeroDivisionError: it is not positive definite.
        """
        order = dissected(at)
        upper = sparse.triu(matrix.tocsr()[order][:, order], format="csc")
        upper.sort_indices()
        first, row, value = _factorized(upper.indptr.astype(np.int64), upper.indices.astype(np.int64), upper.data)
        return cls(order=order, first=first, row=row, value=value)

    def solve(self, right):
        """(n,) x of A x = right."""
        out = np.empty(len(right))
        out[self.order] = _substituted(self.first, self.row, self.value, right[self.order])
        return out


def dissected(at):
    """(n,) nodes in the order of nested dissection, by their grid positions (n, 2)."""
    out, todo = [], [np.arange(len(at))]
    while todo:                                 # the last part first: the whole order is turned round at the end
        part = todo.pop()
        spots = at[part]
        axis = int(np.ptp(spots[:, 1]) > np.ptp(spots[:, 0])) if len(part) else 0
        along = spots[:, axis]
        if len(part) <= SMALLEST or along.min() == along.max():
            out.append(part[::-1])
            continue
        middle = np.sort(along)[len(part) // 2]
        out.append(part[along == middle][::-1])
        todo += [part[along < middle], part[along > middle]]
    return np.concatenate(out)[::-1].copy()


@njit
def _elimination_tree(first, row):
    """(n,) parent of each column; -1 none."""
    n = len(first) - 1
    parent, ancestor = np.full(n, -1), np.full(n, -1)
    for k in range(n):
        for p in range(first[k], first[k + 1]):
            i = row[p]
            while i != -1 and i < k:
                above = ancestor[i]
                ancestor[i] = k
                if above == -1:
                    parent[i] = k
                i = above
    return parent


@njit
def _column_starts(first, row, parent):
    n = len(first) - 1
    counts, mark = np.ones(n, np.int64), np.full(n, -1)
    for k in range(n):
        mark[k] = k
        for p in range(first[k], first[k + 1]):
            i = row[p]
            while i < k and mark[i] != k:
                counts[i] += 1
                mark[i] = k
                i = parent[i]
    starts = np.zeros(n + 1, np.int64)
    put(starts[1:], np.cumsum(counts))
    return starts


@njit
def _factorized(first, row, value):
    """L column by column from the upper triangle, row k of L from the columns before it."""
    n = len(first) - 1
    parent = _elimination_tree(first, row)
    starts = _column_starts(first, row, parent)
    filled = starts[:-1].copy()
    l_row, l_value = np.empty(starts[n], np.int64), np.empty(starts[n])
    mark, stack, x = np.full(n, -1), np.empty(n, np.int64), np.zeros(n)
    path = np.empty(n, np.int64)
    for k in range(n):
        top = n
        mark[k] = k
        for p in range(first[k], first[k + 1]):
            i, count = row[p], 0
            x[i] = value[p]
            while i < k and mark[i] != k:
                path[count] = i
                count += 1
                mark[i] = k
                i = parent[i]
            while count > 0:
                count -= 1
                top -= 1
                stack[top] = path[count]
        pivot = x[k]
        x[k] = 0.0
        for t in range(top, n):
            i = stack[t]
            entry = x[i] / l_value[starts[i]]
            x[i] = 0.0
            for p in range(starts[i] + 1, filled[i]):
                x[l_row[p]] -= l_value[p] * entry
            pivot -= entry * entry
            l_row[filled[i]], l_value[filled[i]] = k, entry
            filled[i] += 1
        if not pivot > 0.0:
            raise ZeroDivisionError("not positive definite")
        l_row[filled[k]], l_value[filled[k]] = k, math.sqrt(pivot)
        filled[k] += 1
    return starts, l_row, l_value


@njit
def _substituted(first, row, value, right):
    x, n = right.copy(), len(right)
    for k in range(n):
        x[k] /= value[first[k]]
        for p in range(first[k] + 1, first[k + 1]):
            x[row[p]] -= value[p] * x[k]
    for k in range(n - 1, -1, -1):
        rest = x[k]
        for p in range(first[k] + 1, first[k + 1]):
            rest -= value[p] * x[row[p]]
        x[k] = rest / value[first[k]]
    return x
