"""Where compiled kernels are kept: beside the sources of a checkout, else in the user's cache, which all environments share."""

import os
import sys
import tempfile
from functools import cache
from pathlib import Path

from numba.core import config
from numba.core.caching import _CacheLocator

PACKAGE = Path(__file__).resolve().parents[1]
OF_ITS_OWN, SHARED = 1, 4       # how many states of a kernel's sources stay compiled: those of a checkout, those of environments


class KernelLocator(_CacheLocator):
    """What numba asks for a folder; the names of the files say the rest."""

    def __init__(self, folder):
        self.folder = folder

    @classmethod
    def from_function(cls, py_func, py_file):
        """None where nothing can be kept."""
        folder, _ = folder_of(py_func.__module__, py_file)
        return None if folder is None else cls(str(folder))

    def get_cache_path(self):
        return self.folder

    def get_source_stamp(self):
        return ""

    def get_disambiguator(self):
        return ""


def folder_of(module, file):
    """Where kernels of a module are kept.

    Args:
        module: its dotted name.   file: its path.
    Returns:
        folder (None: nowhere can be written), and how many states of a kernel's sources may stay there.
    """
    if config.CACHE_DIR:
        return _written(Path(config.CACHE_DIR) / module), SHARED
    beside = Path(file).resolve().parent / "__pycache__"
    if not (is_installed() and beside.is_relative_to(PACKAGE)) and _written(beside):
        return beside, OF_ITS_OWN
    return _written(user_cache() / "kernels" / module), SHARED


def is_installed():
    """Whether the package was installed from a wheel: no project file stands beside its folder."""
    return not (PACKAGE.parent / "pyproject.toml").is_file()


def user_cache():
    """cuspline's folder in the user's cache."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "cuspline"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "cuspline"


@cache
def _written(folder):
    """The folder, made where it is missing; None: nothing can be written into it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    return folder
