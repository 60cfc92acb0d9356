"""cuspline: from a parametric design to a posted and verified program."""

__version__ = "0.1.0"
