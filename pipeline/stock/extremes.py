"""Which of several places beside one another stands highest over all that was cut, or lies deepest in it.

Whoever climbs wants to know which of them is higher than where he stands.  A place is as high as the nearest piece of path
leaves it, so it is out of the running as soon as any piece comes nearer than that: mostly one that was nearest a place
before.  Deepest is the other way round: only what cuts deeper is looked for.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.stock import tree
from cuspline.stock.swept import forest_of, kept_world, upright_paths
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z, put
from cuspline.values.threads import in_blocks

HINTS = 4                 # pieces that were nearest before, kept for each start
CHUNK = 16                # starts looked at one after the other
NEWEST = 0                # of the hints
FEW = 64                  # so many in one block are not worth a thread


@dataclass(frozen=True, eq=False, kw_only=True)
class AnyHeight:
    """Places by a function of points (n, 3) to heights (n,)."""

    height_of: object

    def highest(self, points_mm, offered, least_mm, hints):
        """Height (n,) and number (n,) of the highest of places (n, k, 3) that are offered (n, k); -inf: none is.

        Where none is higher than `least_mm` (n,), the one that may come nearest to it, and about how high it is.
        `hints` (n, HINTS), at first `no_hints`, are what was nearest to these starts before, and take what is now.
        """
        height = np.full(offered.shape, -np.inf)
        height[offered] = self.height_of(points_mm[offered])
        which = height.argmax(axis=1)
        return height[np.arange(len(which)), which], which


@dataclass(frozen=True, eq=False, kw_only=True)
class CutHeight:
    """Places by their signed distance to what upright cutters have cut in several setups, or by how deep they lie in it."""

    cuts: tuple             # workpiece.Cut
    forest: tuple           # of all of them, see tree.py
    setup: np.ndarray       # (t,) which of them each tree belongs to
    sign: float             # 1: material left above them; -1: their depth in what was cut

    def highest(self, points_mm, offered, least_mm, hints):
        """As AnyHeight's."""
        n, k = offered.shape
        order = tree.morton_order(points_mm[:, 0])
        flat = np.ascontiguousarray(points_mm[order].reshape(-1, 3))
        at = np.array([cut.frame.into(flat) for cut in self.cuts]).reshape(len(self.cuts), n, k, 3)
        found, number, near = np.empty(n), np.empty(n, np.int64), hints[order]
        in_blocks(_highest, n, CHUNK, at, offered[order], least_mm[order], self.sign, self.forest, self.setup, near, found,
                  number, serial_rows=FEW)
        height, which = np.empty(n), np.empty(n, np.int64)
        height[order], which[order], hints[order] = found, number, near
        return height, which


def no_hints(count):
    """(count, HINTS) for `highest`."""
    return np.full((count, HINTS), -1)


def forest_of_cuts(cuts):
    """(forest of all paths of workpiece.Cut values, see tree.py; (t,) number of the cut that each tree is of).

    None where a tool leans or is no ball, bull nose or flat cutter.
    """
    if any(len(upright_paths(cut.paths)) < len(cut.paths) for cut in cuts):
        return None
    setup = np.repeat(np.arange(len(cuts)), [len(cut.paths) for cut in cuts])
    return kept_world(cuts[0].paths)[1] if len(cuts) == 1 else forest_of([p for cut in cuts for p in cut.paths]), setup


@njit
def _highest(at, offered, least, sign, forest, setup, hints, height, which, first, last):
    """Fills in heights and numbers of rows first..last-1, see AnyHeight."""
    stack, bounds = tree.work()
    for i in range(first, last):
        if hints[i, NEWEST] < 0 and i > first:
            put(hints[i], hints[i - 1])
        best, guess, found, guessed = least[i], -math.inf, -1, 0
        for j in range(offered.shape[1]):
            if not offered[i, j]:
                continue
            enough, limit = (best, math.inf) if sign > 0.0 else (-math.inf, -best)
            d, piece, hinted = _nearest(at[:, i, j], forest, setup, hints[i], enough, limit, stack, bounds)
            if piece >= 0 and sign * d > best:
                best, found = sign * d, j
            elif sign * hinted > guess:
                guess, guessed = sign * hinted, j
            _remember(piece, hints[i])
        height[i], which[i] = (best, found) if found >= 0 else (min(guess, least[i]), guessed)


@njit
def _remember(piece, hints):
    """Puts a piece first among the hints."""
    if piece < 0:
        return
    k = 0
    while k < HINTS - 1 and hints[k] != piece:
        k += 1
    while k > NEWEST:
        hints[k] = hints[k - 1]
        k -= 1
    hints[NEWEST] = piece


@njit
def _nearest(at, forest, setup, hints, enough, best, stack, bounds):
    """Least signed distance of a place, seen from each setup (c, 3), below `best`, its piece (-1: none is), least to a hint.

    One that is no more than `enough` ends the search, whatever is nearer.
    """
    _, _, trees, _ = forest
    found, hinted, none = -1, math.inf, trees[:0]
    for hint in hints:
        k = tree.tree_of(hint, trees)
        if k >= 0:
            place = at[setup[k]]
            d = tree.one_piece_distance(place[X], place[Y], place[Z], hint, forest)
            hinted = min(hinted, d)
            if d < best:
                best, found = d, hint
    for k in range(len(trees)):
        if best <= enough:
            break
        place = at[setup[k]]
        best, t = tree.nearest_in(k, place[X], place[Y], place[Z], forest, none, 0, enough, best, stack, bounds)
        found = t if t >= 0 else found
    return best, found, hinted
