"""Answers that take long, kept in a folder, so that a run that was interrupted goes on where it stopped.

An answer is known by a SHA-256 over all that decides it: the question, every argument down to the last bit, and the
code that answers.  A file that is damaged, or stands under another's name, is no answer: it is made anew.
"""

import hashlib
import importlib.metadata
import io
import os
import shutil
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
from pydantic import BaseModel

LARGEST_BYTES = 1 << 30       # of all files together; the oldest go first
PIECE_BYTES = 1 << 20
ANSWERING = ("numba", "numpy", "scipy", "manifold3d")
SEAL_BYTES = 32               # behind the arrays of each file: a SHA-256 over its name and them


class Kept:
    """Answers in one folder.  What cannot be written is not kept."""

    def __init__(self, folder, largest_bytes=LARGEST_BYTES):
        self.folder, self.largest_bytes = Path(folder), largest_bytes

    def of(self, function):
        """The same function; its answers, an array or a tuple of arrays, are kept."""
        def ask(*arguments):
            key = told((function.__module__, function.__qualname__, code_sha256(), arguments)).hexdigest()
            answer = self._read(key)
            if answer is None:
                answer = function(*arguments)
                self._write(key, answer)
            return answer
        return ask

    def _read(self, key):
        """The answer under a key, or None."""
        path = self._path(key)
        try:
            content = memoryview(path.read_bytes())
        except OSError:
            return None
        arrays, seal = content[:-SEAL_BYTES], content[-SEAL_BYTES:]
        if _seal(key, [arrays]) != seal:
            path.unlink(missing_ok=True)
            return None
        with np.load(io.BytesIO(arrays), allow_pickle=False) as held:
            answer = tuple(held[f"array_{k}"] for k in range(len(held.files) - 1))
            return answer if held["is_tuple"] else answer[0]

    def _write(self, key, answer):
        """Put an answer under its key, in one step."""
        arrays = answer if isinstance(answer, tuple) else (answer,)
        part = self.folder / f"{key}.{os.getpid()}.part"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with part.open("w+b") as file:          # never whole in memory: it may be hundreds of megabytes
                np.savez(file, is_tuple=isinstance(answer, tuple), **{f"array_{k}": a for k, a in enumerate(arrays)})
                file.seek(0)
                file.write(_seal(key, iter(lambda: file.read(PIECE_BYTES), b"")))
            os.replace(part, self._path(key))
            self._make_room()
        except OSError:
            with suppress(OSError):
                part.unlink()

    def _path(self, key):
        return self.folder / f"{key}.npz"

    def _make_room(self):
        """Remove the oldest files until all together are small enough."""
        files = sorted((p.stat().st_mtime_ns, p.name, p.stat().st_size) for p in self.folder.iterdir())
        size = sum(f[2] for f in files)
        for _, name, own in files:
            if size <= self.largest_bytes:
                return
            (self.folder / name).unlink(missing_ok=True)
            size -= own

    def remove(self):
        """Forget all."""
        shutil.rmtree(self.folder, ignore_errors=True)


class _Nothing:
    """Keeps nothing."""

    def of(self, function):
        return function


NOTHING = _Nothing()


def kept_beside(out):
    """The store of an output folder, beside it."""
    out = Path(out).resolve()
    return Kept(out.parent / f".{out.name}.kept")


@contextmanager
def kept_until_done(out):
    """The store of an output folder; it goes when what it is for has come to its end, and stays where that was broken off."""
    kept = kept_beside(out)
    yield kept
    kept.remove()


def _seal(key, pieces):
    """SHA-256 over a key and bytes that come in pieces."""
    seal = hashlib.sha256(key.encode())
    for piece in pieces:
        seal.update(piece)
    return seal.digest()


@cache
def code_sha256():
    """Over the package's sources, and the versions of what it reckons with."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(" ".join(importlib.metadata.version(name) for name in ANSWERING).encode())
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def told(value, digest=None):
    """SHA-256 of a value: numbers, texts, arrays, and tuples, dataclasses and models of these.

    Raises:
        TypeError: a value of which not all is known.
    """
    digest = hashlib.sha256() if digest is None else digest
    if value is None or isinstance(value, (bool, int, float, str, np.generic)):
        _named(digest, type(value).__name__, repr(value).encode())
    elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
        _named(digest, f"array {value.dtype.str} {value.shape}", np.ascontiguousarray(value).tobytes())
    elif isinstance(value, (tuple, list)):
        _named(digest, f"{len(value)} values", b"")
        for item in value:
            told(item, digest)
    elif isinstance(value, BaseModel):
        _named(digest, type(value).__qualname__, value.model_dump_json().encode())
    elif is_dataclass(value):
        _named(digest, type(value).__qualname__, b"")
        told([(f.name, getattr(value, f.name)) for f in fields(value)], digest)
    else:
        raise TypeError(f"{type(value).__name__} has no bytes that hold all of it")
    return digest


def _named(digest, kind, content):
    """Content behind its kind and length, so that no two values run into each other."""
    digest.update(f"{kind} {len(content)}\n".encode())
    digest.update(content)
