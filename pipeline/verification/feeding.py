"""Programs that are sent while they run: does the control wait for blocks while a cutter is in the cut?"""

import numpy as np

from cuspline.process.feeding import waits_s
from cuspline.program.program import Kind
from cuspline.replay.replay_loads import lengths_mm
from cuspline.values.amounts import counted
from cuspline.values.findings import Finding

LEAST_S = 1e-3            # a shorter wait is within what drives take to speed up


def feeding_findings(posted, texts, machine, setup):
    """Waits in the cut; one Finding an operation, at its longest.

    A block lasts as long as its moves at their full feeds: corners, where machines are slower, leave more time.

    Args:
        posted: PostedMoves of all files of a program.   texts: of these files.   machine: machines.Machine.
        setup: name of the setup.
    Returns:
        tuple of Finding; none where the machine's file says nothing of `feeding`.
    """
    feeding = machine.control.feeding
    if feeding is None:
        return ()
    seconds, found, first = _seconds(posted, machine), [], 0
    for text in texts:                          # each is begun by the operator, its memory full
        lines = text.split("\n")[:-1]
        rows = np.flatnonzero((posted.line > first) & (posted.line <= first + len(lines)))
        number = posted.line[rows] - 1 - first
        wait = waits_s(np.bincount(number, seconds[rows], len(lines)), np.array([len(line) + 1 for line in lines]), feeding)
        found += _in_the_cut(posted, rows, (number, seconds[rows], wait), setup)
        first += len(lines)
    return tuple(found)


def _seconds(posted, machine):
    """(n,) the least that each move may take."""
    rapid = np.array([axis.rapid_mm_per_min for axis in machine.axes])
    across = (np.abs(np.nan_to_num(posted.end_mm - posted.start_mm)) / rapid).max(axis=1)
    by_feed = lengths_mm(posted) / np.maximum(posted.feed_mm_per_min, 1e-9)
    return 60.0 * np.where(posted.kind == Kind.RAPID, across, by_feed)


def _in_the_cut(posted, rows, fed, setup):
    """Findings of one file: waits before blocks whose last move before was no rapid.

    Args:
        rows: (k,) moves of the file.
        fed: (k,) the line of each, from 0; (k,) the least s that each takes; (lines,) s that the control waits before each.
    """
    number, _, wait = fed
    before = np.searchsorted(number, np.arange(len(wait)), side="left") - 1         # the move made last
    cut = np.flatnonzero((wait > LEAST_S) & (before >= 0))
    cut = cut[posted.kind[rows[before[cut]]] != Kind.RAPID]
    if not len(cut):
        return
    row = rows[before[cut]]
    for operation in np.unique(posted.operation[row]).tolist():
        mine = np.flatnonzero(posted.operation[row] == operation)
        worst = mine[wait[cut[mine]].argmax()]
        feed = float(posted.feed_mm_per_min[row[worst]])
        kept = feed * _share(fed, cut[mine])
        yield Finding(kind="late_blocks", amount_mm=0.0, amount=round(float(wait[cut[mine]].sum()), 3), unit="s", place_mm=None,
                      operation=posted.operation_name(int(row[worst])), line=int(posted.line[row[worst]]), setup=setup,
                      row=int(row[worst]),
                      advice=f"the control waits {counted(len(mine), 'time')} in the cut for blocks, at most "
                             f"{wait[cut[worst]]:.3g} s: about F{kept:.0f} keeps the line ahead; or write fewer blocks, or take "
                             "a faster line (`bytes_per_s`)")


def _share(fed, late):
    """Of the feed at which the line keeps up over the stretch of late blocks: running time over running and waiting."""
    number, seconds, wait = fed
    runs = float(seconds[(number >= late[0]) & (number <= late[-1])].sum())
    return runs / (runs + float(wait[late[0]:late[-1] + 1].sum()))
