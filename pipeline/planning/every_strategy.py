"""Imports every strategy, which registers it: design.operations.registered."""

from importlib import import_module
from pkgutil import iter_modules

from cuspline.planning import strategies

for _module in iter_modules(strategies.__path__):
    import_module(f"{strategies.__name__}.{_module.name}")
