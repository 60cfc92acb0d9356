"""Checks the environment for the things that break silently."""

import importlib.metadata
import shutil


def complaints():
    """[(what is wrong, how to mend it)]; empty when all is well."""
    found = []
    installed = [n for n in ("cadquery-ocp", "cadquery-ocp-novtk") if _is_installed(n)]
    if installed != ["cadquery-ocp"]:
        found.append((f"the OCP bindings come from {installed or 'nowhere'}, they must come from cadquery-ocp alone",
                      "remove .venv and run make: two distributions install the same package and the wrong one wins"))
    try:
        from OCP.IVtkOCC import IVtkOCC_Shape  # noqa: F401  (the symbol that the wrong one lacks)
    except ImportError as error:
        found.append((f"OCP lacks IVtkOCC_Shape ({error})", "remove .venv and run make"))
    for name, wanted, is_needed in (("build123d", "0.12", False), ("cadquery", "2.8", True)):
        if not (importlib.metadata.version(name).startswith(wanted) if _is_installed(name) else not is_needed):
            found.append((f"{name} {wanted} is not installed", "remove .venv and run make"))
    return found


def notes():
    """What is missing without doing harm."""
    missing = []
    if not _is_installed("build123d"):
        missing.append("build123d is not installed: parts in CadQuery and STEP parts only")
    if not _is_installed("pymeshlab"):
        missing.append("pymeshlab is not installed: no Hausdorff distance, no coloured mesh")
    if shutil.which("chromium") is None:
        missing.append("chromium is not installed: the report's browser tests are skipped")
    if shutil.which("rs274") is None:
        missing.append("LinuxCNC's interpreter is not installed: its tests are skipped")
    return missing


def _is_installed(name):
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
