"""Ctrl-C: remembered until the command has ended, held off while folders are exchanged.

Python raises KeyboardInterrupt wherever it happens to be.  A compiler, a binding or a destructor in between may swallow
that, or hand on another error in its place; so the signal itself is remembered, looked at between the stages, and asked
about when the command ends.
"""

import signal
import threading
from contextlib import contextmanager


class _Asked:
    """Whether somebody has pressed Ctrl-C, and how many blocks hold it off."""

    is_asked = False
    held_off = 0


def listen():
    """From now on a Ctrl-C is remembered; where the signal is ignored, as in a shell's background job, it stays so."""
    _Asked.is_asked, _Asked.held_off = False, 0
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, _remember)


def _remember(number, frame):
    is_first, _Asked.is_asked = not _Asked.is_asked, True
    if is_first and not _Asked.held_off:
        raise KeyboardInterrupt


def is_asked():
    """Whether Ctrl-C has been pressed since `listen`."""
    return _Asked.is_asked


def stop_if_asked():
    """
    Raises:
        KeyboardInterrupt: Ctrl-C has been pressed, whatever has become of its exception.
    """
    if _Asked.is_asked:
        raise KeyboardInterrupt


@contextmanager
def held_off():
    """A block that Ctrl-C does not break into; it is obeyed behind it."""
    _Asked.held_off += 1
    try:
        yield
    finally:
        _Asked.held_off -= 1
    if not _Asked.held_off:
        stop_if_asked()
