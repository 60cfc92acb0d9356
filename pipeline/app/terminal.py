"""What is being done, on standard error: one line a stage; on a terminal the last of them counts its time."""

import sys
import threading
import time

from cuspline.values import interruption
from cuspline.values.progress import share_done

EVERY_S = 0.5           # how often the last line is written anew
LONG_S = 2.0            # how long a stage may take before its time is worth a word
ERASE = "\r\x1b[K"


class Stages:
    """A block within which stages are told, by `say`.

    On a terminal the stage that runs shows how long it has, how much of its present loop is done and how long that
    still takes; elsewhere each stage is one line as it begins.
    """

    def __init__(self, stream=None, clock=time.monotonic):
        self.stream, self.clock = stream or sys.stderr, clock
        self.is_terminal = self.stream.isatty()         # else every stage stays on a line of its own
        self.running, self.begun_s, self.is_passing = None, 0.0, False
        self.lock, self.ended = threading.Lock(), threading.Event()

    def __enter__(self):
        if self.is_terminal:
            threading.Thread(target=self._count, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.ended.set()
        with self.lock:
            self._close()

    def say(self, text):
        """Tell that a stage begins.

        Raises:
            KeyboardInterrupt: Ctrl-C has been pressed.
        """
        with self.lock:
            self._close()
            print(f"  {text}", file=self.stream, end="" if self.is_terminal else "\n", flush=True)
            self.running, self.begun_s = text, self.clock()
        interruption.stop_if_asked()

    def show(self, text):
        """What is being done before the first stage: on a terminal, and only as long as it takes."""
        with self.lock:
            self.running, self.begun_s, self.is_passing = text, self.clock(), True

    def line(self):
        """The stage that runs, with its time so far and the share of its loop that is done."""
        took_s, share = self.clock() - self.begun_s, share_done()
        words = f"  {self.running}" + (f"  {took_s:.0f} s" if took_s >= LONG_S else "")
        if share is not None and took_s >= LONG_S and share[1] < took_s:
            done, since_s = share
            words += f", {done:.0%} of this step, {since_s * (1 - done) / done:.0f} s left"
        return words

    def _close(self):
        """The running stage's line as it stays; the lock is held."""
        if self.is_terminal and self.running is not None:
            took_s = self.clock() - self.begun_s
            stays = "" if self.is_passing else f"  {self.running}" + (f"  {took_s:.0f} s" if took_s >= LONG_S else "") + "\n"
            self.stream.write(ERASE + stays)
            self.stream.flush()
        self.running, self.is_passing = None, False

    def _count(self):
        while not self.ended.wait(EVERY_S):
            with self.lock:
                if self.running is not None:
                    self.stream.write(ERASE + self.line())
                    self.stream.flush()
