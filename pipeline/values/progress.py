"""How far a long loop has come, for those who look on.

Threads count without waiting for each other: this is for showing, nothing else may ask it.
"""

import time


class _Loop:
    """The last loop that was begun: its rows, those done, when it began (s)."""

    rows, done, begun_s = 0, 0, 0.0


def begin(rows):
    """A loop over so many rows begins."""
    _Loop.rows, _Loop.done, _Loop.begun_s = rows, 0, time.monotonic()


def advance(rows):
    """So many of its rows are done."""
    _Loop.done += rows


def share_done():
    """(share of the running loop that is done, seconds since it began); None where nothing is known of one.

    >>> begin(8); advance(2); share_done()[0]
    0.25
    >>> advance(6); share_done() is None
    True
    """
    done, rows = _Loop.done, _Loop.rows
    return (done / rows, time.monotonic() - _Loop.begun_s) if 0 < done < rows else None
