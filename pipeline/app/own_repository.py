"""`cuspline new`: a repository of the user's own, with a part, a Makefile, a workflow and a lock; its `make` is green."""

import shutil
from pathlib import Path

from cuspline.values.errors import InputError
from cuspline.values.models import name_fault

TEMPLATE = Path(__file__).parent / "repository"
FILES = {       # as they are called here: as they are called there
    "Makefile": "Makefile", "README.md": "README.md", "gitignore": ".gitignore", "requirements.lock": "requirements.lock",
    "Containerfile": "Containerfile", "trough.py": "parts/trough.py", "build.yml": ".github/workflows/build.yml",
    "release.yml": ".github/workflows/release.yml"}


def write_repository(folder):
    """Write the files of a new repository.

    Args:
        folder: a path where nothing is, or an empty folder.
    Returns:
        the names of the files, relative to it.
    Raises:
        InputError: the folder holds something already, or cannot be called so.
    """
    folder = Path(folder)
    if fault := name_fault(folder.resolve().name):
        raise InputError(f"{folder}: {fault}; choose another name for the repository")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists and is not empty: nothing is overwritten; name a new folder")
    made = folder.resolve()
    work = made.parent / f".{made.name}.part"
    shutil.rmtree(work, ignore_errors=True)
    for source, name in FILES.items():
        target = work / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text((TEMPLATE / source).read_text().replace("{name}", made.name))
    work.replace(made)
    return tuple(FILES.values())
