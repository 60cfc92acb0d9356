"""What every record out of a file or from the command line is checked by: finite numbers, known keys, names of files."""

import difflib
import re
import typing
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, ValidationError, model_serializer

FAR_MM = 1e6                # no machine, stock or fixture reaches so far
SHOWN = 60                  # characters of a value, and
KIND = "~"                  # before the name of one of several models that a place may hold: it is no key of the file
MOST_SHOWN = 12             # faults of a file, that a message repeats
NAME = r"^[A-Za-z0-9_]([A-Za-z0-9_+=. -]{0,62}[A-Za-z0-9_+=-])?$"
NAME_IN_WORDS = ("what names a file has at most 64 characters out of A-Z a-z 0-9 _ + = - with dots and spaces between "
                 "them, and begins with a letter, a digit or _")

FileName = Annotated[str, Field(pattern=NAME)]              # of a design, a setup, a companion
WrittenName = Annotated[str, Field(pattern=NAME.replace("62", "160"))]      # of a file that such a name has become
Coordinate = Annotated[float, Field(ge=-FAR_MM, le=FAR_MM)]
Point = tuple[Coordinate, Coordinate, Coordinate]


class Model(BaseModel):
    """Frozen; an unknown key is an error, and so is a number that is not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def as_several(value):
    """One value where several may stand, as several.

    >>> as_several("walls"), as_several(["walls", "floor"])
    (('walls',), ['walls', 'floor'])
    """
    return (value,) if isinstance(value, (str, dict, Model)) else value


SEVERAL = BeforeValidator(as_several)
Names = Annotated[tuple[str, ...], Field(min_length=1), SEVERAL]


class Sparse(Model):
    """What a file leaves out is left out where the value is written out again: keys that came later change no older file."""

    LEFT_OUT: typing.ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _without_what_is_usual(self, dump):
        usual = {name: type(self).model_fields[name].default for name in self.LEFT_OUT}
        return {k: v for k, v in dump(self).items() if k not in usual or getattr(self, k) != usual[k]}


def one_of(*models):
    """The type of a place that holds one of several models: the first of which the file has the key `TOLD_BY`, else the first.

    >>> class Ball(Model):
    ...     TOLD_BY: typing.ClassVar[str] = "diameter_mm"
    ...     diameter_mm: float
    >>> class Cube(Model):
    ...     TOLD_BY: typing.ClassVar[str] = "side_mm"
    ...     side_mm: float
    >>> class Toy(Model):
    ...     body: one_of(Ball, Cube)
    >>> Toy(body={"side_mm": 3}).body
    Cube(side_mm=3.0)
    """
    def kind(value):
        if isinstance(value, BaseModel):
            return KIND + type(value).__name__
        told = [m for m in models if isinstance(value, dict) and m.TOLD_BY in value]
        return KIND + (told or models)[0].__name__

    return Annotated[typing.Union[tuple(Annotated[m, Tag(KIND + m.__name__)] for m in models)], Discriminator(kind)]


def by_kind(value, registered, what):
    """A value out of a job file's table, by its `kind`; anything but a table stays what it is.

    Args:
        registered: {kind: Model}.   what: that they are, for messages.
    Raises:
        ValueError: there is no such kind, or something in it is wrong.
    """
    if not isinstance(value, dict):
        return value
    kind = value.get("kind")
    if kind not in registered:
        raise ValueError(f"there is no {what} of kind {kind!r}; there are {', '.join(sorted(registered))}")
    try:
        return registered[kind](**{key: v for key, v in value.items() if key != "kind"})
    except ValidationError as error:
        raise ValueError(f"{kind}: {complaints(error, registered[kind])}") from None


def name_fault(name):
    """Why a name cannot be a file's, "" where it can.

    >>> name_fault("setup-1"), name_fault("../setup-1")[:31]
    ('', "'../setup-1' cannot name a file")
    """
    return "" if re.fullmatch(NAME[1:-1], str(name)) else f"{shortened(name)} cannot name a file: {NAME_IN_WORDS}"


def complaints(error, model=None):
    """All that is wrong in one line: where, what, the value given; beside an unknown key the nearest one.

    Args:
        error: pydantic's ValidationError, or any other exception.
        model: the Model that was asked, whose keys are looked up.
    """
    if not isinstance(error, ValidationError):
        return " ".join(str(error).split()) or type(error).__name__
    found = [_complaint(e, model) for e in _causes(error.errors())]
    more = f"; and {len(found) - MOST_SHOWN} more" if len(found) > MOST_SHOWN else ""
    return "; ".join(found[:MOST_SHOWN]) + more


def _causes(errors):
    """Errors of pydantic's without those that a list is too short, where it is only because its items are wrong."""
    within = lambda short: any(len(e["loc"]) > len(short) and e["loc"][:len(short)] == short for e in errors)
    return [e for e in errors if e["type"] != "too_short" or not within(e["loc"])]


def no_such(name, names):
    """What a message says of a name that is not among those that there are.

    >>> no_such("gauge", ("gouge", "excess"))
    'there is no such name; did you mean gouge?'
    """
    close = difflib.get_close_matches(str(name), names, 1)
    return "there is no such name; " + (f"did you mean {close[0]}?" if close else f"there are {', '.join(names)}")


def shortened(value):
    """A value as a message shows it."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):        # nested too deep, or an integer of too many digits
        text = f"{type(value).__name__} too large to show"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _complaint(found, model):
    keys = [str(step) for step in found["loc"] if not str(step).startswith(KIND)]
    where, kind = ".".join(key[:SHOWN] for key in keys), found["type"]
    if kind == "extra_forbidden":
        return f"{where}: there is no such key{_nearest(str(found['loc'][-1]), _model_at(model, found['loc'][:-1]))}"
    if kind == "missing":
        return f"{where}: it is missing"
    words = found["msg"].removeprefix("Value error, ")
    if kind == "string_pattern_mismatch" and found["ctx"]["pattern"].startswith(NAME[:20]):
        words = NAME_IN_WORDS
    given = "" if isinstance(found["input"], (dict, BaseModel)) else f" (given: {shortened(found['input'])})"
    return f"{where}: {words}{given}" if where else words


def _nearest(key, model):
    if model is None:
        return ""
    close = difflib.get_close_matches(key, model.model_fields, 1)
    return f"; did you mean {close[0]}?" if close else f"; there are {', '.join(model.model_fields)}"


def _model_at(model, place):
    """The Model that a place in a document is checked by; None where that is not one alone."""
    found = [model]
    for step in place:
        if isinstance(step, str) and step.startswith(KIND):
            found = [m for m in found if m.__name__ == step[len(KIND):]]
        elif isinstance(step, str):
            fields = [m.model_fields for m in found if m is not None]
            found = _models_in(fields[0][step].annotation) if len(fields) == 1 and step in fields[0] else []
    return found[0] if len(found) == 1 else None


def _models_in(annotation):
    """The Models in a type such as tuple[Tool, ...] | None."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for inner in typing.get_args(annotation) for m in _models_in(inner)]
