"""What the `cuspline` command runs first: Ctrl-C is listened for before anything that takes time is imported."""

import gc
import importlib
import importlib.util
import os
import sys
import types
from contextlib import suppress

from cuspline.values import interruption

SELDOM = 100_000        # new objects between two looks for cycles: imports make a million that stay, our arrays make no cycles


def main():
    """The command line; ends the process."""
    interruption.listen()
    gc.set_threshold(SELDOM, 20, 20)
    _LateModule.put("vtk")
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


class _LateModule(types.ModuleType):
    """A module that is loaded when something of it is asked for.

    CadQuery's kernel imports all of VTK, a sixth of the time of a start, for pictures that nobody here draws.
    """

    @classmethod
    def put(cls, name):
        """Let `name` stand for itself where it is installed and not loaded yet."""
        if name not in sys.modules and (spec := importlib.util.find_spec(name)):
            sys.modules[name] = cls(name)
            sys.modules[name].__spec__ = spec

    def __getattr__(self, name):
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
            self.__dict__.update(vars(importlib.import_module(self.__name__)))
        return getattr(sys.modules[self.__name__], name)
