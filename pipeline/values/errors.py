"""One family of errors: each says what, where, and how to mend."""

import numpy as np


class CamError(Exception):
    """Anything that cuspline refuses; the message is a whole sentence for a person.

    Args:
        message: what is wrong, where, and how to mend it.
        rows: indices of the offending points, faces or lines, where there are such.
    """

    def __init__(self, message, *, rows=()):
        super().__init__(message)
        self.rows = np.asarray(rows, dtype=int)


class InputError(CamError):
    """A file, a parameter or an option that cannot be used as given (exit code 2)."""


class DesignError(CamError):
    """A part that cannot be built from its parameters, or a selector that misses."""


class PlanError(CamError):
    """No cutter, no step, no setup can do what is asked."""


class CutterDoesNotFit(PlanError):
    """A hollow is tighter than the cutter; `.rows` lists where."""


class ToolpathError(CamError):
    """A pass that cannot be computed, or an operation that came out empty."""


class NotOnePass(ToolpathError):
    """A region over which one continuous pass cannot be led."""


class NothingToCut(ToolpathError):
    """An operation that finds nothing standing where it may cut."""


class PostError(CamError):
    """A program that the controller or the machine cannot take."""


class ReadError(CamError):
    """A posted text that the reader does not understand; `.rows` holds the line number."""


class SimulationError(CamError):
    """A program whose cut cannot be simulated."""
