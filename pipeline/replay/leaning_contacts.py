"""Where parts of a tool that must not cut come into stock, for tools whose axis leans or turns.  WCS, mm.

Every place of the stock is asked two things: when is it cut away, and when does a part of the tool first come there?  It
is a contact if the part comes first.  The stock is taken in cells, cubes of 2 h:

    U   the first sub-step in which the part comes nearer to the cell's middle than the cell's radius and what is wanted
    no U, or a sub-step before U in which some cutter swallows the whole cell, or no stock at the beginning: it is clear
    else its middle is asked itself; where that shows no contact, the cell is parted into eight

down to FLOOR_MM.  So all stock is covered, and all of every move: nothing is sampled.  What the floor leaves open is told
by row.  A place that a part has run through once stands in no later move's way.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.stock.timed import NEVER, first_within, is_within, nearest_before

FLOOR_MM = 0.002          # half the side of a cell that is not parted
ROOTS = 6                 # cells along the longest side of the stock, to begin with
DIAGONAL = np.sqrt(3.0) * (1 + 1e-9)
CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
BESIDE_MM = 0.25          # where a move is known to be in contact, its cells are not parted below this
AMOUNT_MM = 0.005         # but for those where it is deepest: down to this,
FOLLOWED = 200            # so many of a size
MOST_CELLS = 600_000      # of one kind of part: more of them lie along stock that a part rubs on


@dataclass(frozen=True, eq=False, kw_only=True)
class History:
    """What a program cuts, and what was there before it."""

    cut: tuple                  # timed forest of all cutters
    rows: np.ndarray            # (k,) row of PostedMoves of each number
    low_mm: np.ndarray          # (3,) corners of a box that holds all stock
    high_mm: np.ndarray
    is_free_within: object      # function of places (n, 3) and a radius: no stock so near before the first move, surely
    is_stock: object            # function of places (n, 3): stock before the first move

    def stands(self, points_mm, before):
        """(n,) bool: stock, and not cut by any sub-step before a number (n,)."""
        found = self.is_stock(points_mm)
        found[found] = ~is_within(points_mm[found], np.zeros(found.sum()), self.cut, before[found])
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class Contacts:
    """What is found of one kind of part."""

    row: np.ndarray             # (c,) of PostedMoves
    amount_mm: np.ndarray       # (c,) at least so much nearer than wanted
    place_mm: np.ndarray        # (c, 3)
    unsure: np.ndarray          # rows of moves of which a contact is not excluded
    cells: int                  # looked at


def contacts(part, wanted_mm, touch_mm, history, cuts=False):
    """Contacts of one kind of part with stock.

    Args:
        part: timed forest of its moves, numbered as the history's.
        wanted_mm: distance that it is to keep.   touch_mm: what may be missing of it.
        history: History.
        cuts: whether the part cuts too: what it meets is deep in all of its move.
    Returns:
        Contacts.
    """
    cells, half = _roots(history)
    reach, looked, found, unsure = wanted_mm - touch_mm, 0, [], [np.zeros(0, np.int64)]
    deepest = np.full(int(history.rows.max(initial=-1)) + 1, -np.inf)           # of each row, as far as it is known
    while len(cells):
        looked += len(cells)
        radius = DIAGONAL * half
        first = first_within(cells, np.full(len(cells), reach + radius), part, np.full(len(cells), NEVER))
        open_ = first != NEVER
        open_[open_] = ~is_within(cells[open_], np.full(open_.sum(), -radius), history.cut, first[open_])
        open_[open_] = ~history.is_free_within(cells[open_], radius)
        cells, first = cells[open_], first[open_]
        meets, amount, row = _at_middles(cells, part, reach, wanted_mm, history, found, cuts)
        np.maximum.at(deepest, row[meets], amount[meets])
        is_told = (half <= BESIDE_MM) & (deepest[history.rows[first]] > 0)
        goes_on = np.where(meets, half > BESIDE_MM, ~is_told)
        if AMOUNT_MM < half <= BESIDE_MM:
            deeper = np.flatnonzero(meets & (amount + radius > deepest[row] + AMOUNT_MM))
            goes_on[deeper[np.argsort(-amount[deeper], kind="stable")[:FOLLOWED]]] = True
        if half <= FLOOR_MM or looked + 8 * goes_on.sum() > MOST_CELLS:
            unsure.append(history.rows[first[~meets & ~is_told]])
            break
        half /= 2
        cells = (cells[goes_on, None] + half * CORNERS).reshape(-1, 3)
    row, amount, place = (np.concatenate(column) for column in zip(
        (np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))), *found))
    return Contacts(row=row, amount_mm=amount, place_mm=place, unsure=np.unique(np.concatenate(unsure)), cells=looked)


def _roots(history):
    """(n, 3) middles of cubes that fill the stock's box, and half their side."""
    size = history.high_mm - history.low_mm
    half = float(size.max()) / ROOTS / 2
    steps = [low + half * (2 * np.arange(max(int(np.ceil(s / half / 2)), 1)) + 1) for low, s in zip(history.low_mm, size)]
    return np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3), half


def _at_middles(cells, part, reach, wanted_mm, history, found, cuts):
    """(n,) bool: a contact at a cell's middle; its amount, and the row of the move where it is deepest."""
    none = np.full(len(cells), NEVER)
    first = first_within(cells, np.full(len(cells), reach), part, none)
    meets, amount, row = first != NEVER, np.zeros(len(cells)), np.zeros(len(cells), np.int64)
    meets[meets] = history.stands(cells[meets], first[meets])
    if not meets.any():
        return meets, amount, row
    where, first = cells[meets], first[meets]
    cut = first_within(where, np.zeros(len(where)), history.cut, none[meets])
    last = np.searchsorted(history.rows, history.rows[first], side="right") if cuts else np.maximum(cut, first + 1)
    nearest, number = nearest_before(where, part, last)
    begins = nearest_before(where, part, first + 1)[0]
    amount[meets], row[meets] = wanted_mm - nearest, history.rows[number]
    for numbers, d in ((first, begins), (number, nearest)):
        found.append((history.rows[numbers], wanted_mm - d, where))
    return meets, amount, row
