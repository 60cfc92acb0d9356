"""Rows shared out among threads, block by block: a kernel that fills in rows first..last-1 needs no parallel twin.

Which rows make a block is fixed, so what comes out does not depend on how many threads there are.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numba

from cuspline.values import progress


class _Threads:
    """How many work at a time, the caller among them (None: as many as numba counts processors), and the others."""

    count = None
    others = None


def in_blocks(kernel, rows, block, *arguments, serial_rows=0):
    """Call kernel(*arguments, first, last) for rows 0..rows-1, a block of them at a time, from several threads.

    Args:
        kernel: of `compiled.njit`: it lets other threads run.
        rows, block: how many rows there are, and in a block.
        serial_rows: up to so many rows are one block.
    """
    if rows <= max(serial_rows, block):
        kernel(*arguments, 0, rows)
        return
    starts = iter(range(0, rows, block))
    progress.begin(rows)
    helpers = min(thread_count(), -(-rows // block)) - 1
    others = [_pool().submit(_work, kernel, arguments, starts, rows, block) for _ in range(helpers)]
    try:
        _work(kernel, arguments, starts, rows, block)
    finally:
        for _ in starts:            # after an error or Ctrl-C: nobody begins another block
            pass
        for other in others:
            other.result()


def _work(kernel, arguments, starts, rows, block):
    for first in starts:
        kernel(*arguments, first, min(rows, first + block))
        progress.advance(block)


def thread_count():
    """Threads that `in_blocks` uses."""
    return _Threads.count or numba.config.NUMBA_NUM_THREADS


def set_thread_count(count):
    """From now on `in_blocks` uses so many threads."""
    _Threads.count = count


def _pool():
    if _Threads.others is None:
        _Threads.others = ThreadPoolExecutor(max(1, numba.config.NUMBA_NUM_THREADS - 1), "block")
    return _Threads.others


def _forget():
    _Threads.others = None          # a forked process has none of its parent's threads


os.register_at_fork(after_in_child=_forget)
