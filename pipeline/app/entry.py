"""What the `cuspline` command runs first: Ctrl-C is listened for before anything that takes time is imported."""

import gc
import os
import sys
from contextlib import suppress

from cuspline.values import interruption

SELDOM = 100_000        # new objects between two looks for cycles: imports make a million that stay, our arrays make no cycles


def main():
    """The command line; ends the process."""
    interruption.listen()
    gc.set_threshold(SELDOM, 20, 20)
    try:
        from cuspline.app.cli import main as command
    except BaseException:
        if not interruption.is_asked():
            raise
        print("cuspline: interrupted, nothing half-written is left", file=sys.stderr)
        sys.exit(130)
    try:
        command()
    except SystemExit as end:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(end.code)      # Python would take the CAD library down piece by piece, as long as a small command takes
