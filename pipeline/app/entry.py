"""What the `cuspline` command runs first: Ctrl-C is listened for before anything that takes time is imported."""

import sys

from cuspline.values import interruption


def main():
    """The command line; ends the process."""
    interruption.listen()
    try:
        from cuspline.app.cli import main as command
    except BaseException:
        if not interruption.is_asked():
            raise
        print("cuspline: interrupted, nothing half-written is left", file=sys.stderr)
        sys.exit(130)
    command()
