"""Files that people write, on their way in: bounded, in a known encoding, every fault told in a sentence."""

import csv
import hashlib
import json
import os
import stat
import tomllib
from pathlib import Path

from pydantic import ValidationError

from cuspline.values.errors import InputError
from cuspline.values.models import complaints

LARGEST_BYTES = 32 << 20        # of a job, a machine, a library, a table
LARGEST_PROGRAM_BYTES = 1 << 30
UTF_16 = (b"\xff\xfe", b"\xfe\xff")


def sha256_of(path):
    """SHA-256 of a file's bytes, hexadecimal."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def refuse_irregular(path, what):
    """Refuse a pipe or a device before it is opened: to read it may block for ever, or never end.

    Args:
        path: of a file that may also be missing, or a folder: whoever opens it tells that.
        what: what it should be, in words: "job file".
    Raises:
        InputError: it is neither a regular file nor a folder.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):           # ValueError: a name with a null character in it
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{what} {path} is a pipe or a device, not a regular file: write what it gives into a file, and "
                         "name that")


def text_of(path, what, *, encoding="utf-8-sig", largest_bytes=LARGEST_BYTES, may_be_empty=False):
    """The text of a file; a byte order mark of UTF-8 is no part of it.

    Args:
        path: the file.
        what: what it should be, in words: "job file".
    Raises:
        InputError: it is missing, a folder, a pipe, empty, too large, cannot be read, or is in another encoding.
    """
    refuse_irregular(path, what)
    try:
        with open(path, "rb") as file:
            content = file.read(largest_bytes + 1)
    except FileNotFoundError:
        raise InputError(f"{what} {path} does not exist") from None
    except IsADirectoryError:
        raise InputError(f"{what} {path} is a folder: name a file") from None
    except (OSError, ValueError) as error:          # ValueError: a name with a null character in it
        raise InputError(f"{what} {path} cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(content) > largest_bytes:
        raise InputError(f"{what} {path} is larger than {largest_bytes >> 20} MiB: it is no {what}")
    if not content.strip() and not may_be_empty:
        raise InputError(f"{what} {path} is empty")
    return _decoded(content, f"{what} {path}", encoding)


def _decoded(content, name, encoding):
    words = "ASCII" if encoding == "ascii" else "UTF-8"
    if content.startswith(UTF_16):
        raise InputError(f"{name} is written in UTF-16: save it as {words}")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[:error.start].count(b"\n") + 1
        raise InputError(f"{name}, line {line}: byte 0x{content[error.start]:02x} is no {words} text: "
                         f"save it as {words}") from None
    if "\0" in text:
        raise InputError(f"{name}, line {text[:text.index(chr(0))].count(chr(10)) + 1}: it holds null characters: "
                         "it is no text")
    return text


def csv_rows(text, name):
    """[(line number, [field, ...])] of a CSV's lines that are neither blank nor comments (#).

    Raises:
        InputError: a line that is no CSV.
    """
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                rows.append((number, next(csv.reader([line]))))
            except csv.Error as error:
                raise InputError(f"{name}, line {number}: {error}") from None
    return rows


def toml_of(path, what):
    """The document in a TOML file.

    Raises:
        InputError: no such file, or no TOML.
    """
    text = text_of(path, what)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{what} {path} is not valid TOML: {_words(error)}") from None


def json_of(path, what):
    """The document in a JSON file.

    Raises:
        InputError: no such file, or no JSON.
    """
    return parsed_json(text_of(path, what), f"{what} {path}")


def parsed_json(text, name):
    """The document in a text; `name` stands in the message.

    Raises:
        InputError: it is no JSON.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{name} is not valid JSON: {_words(error)}") from None


def checked(model, document, name):
    """A Model's value out of a document.

    Args:
        model: a class of models.Model.
        document: what was read.
        name: of the file, as the message begins.
    Raises:
        InputError: names every key that is wrong, with the value.
    """
    try:
        return model.model_validate(document)
    except (ValidationError, ValueError, RecursionError) as error:
        raise InputError(f"{name}: {complaints(error, model)}") from None


def _words(error):
    return "it is nested too deep" if isinstance(error, RecursionError) else " ".join(str(error).split())
