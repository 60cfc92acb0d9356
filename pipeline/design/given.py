"""What a Design is handed: one where several go is taken for several, None for left out; anything else of a wrong kind is refused.

A design's function is plain Python, so a comma left out of `setups=(Setup(...))` or a Workplane where a value goes comes this far.
"""

from pydantic import ValidationError

from cuspline.values.errors import DesignError
from cuspline.values.models import complaints, shortened


def several(value, kind, what):
    """A tuple of values of a kind.

    >>> several(None, int, "sizes"), several(3, int, "sizes"), several([3, 4], int, "sizes")
    ((), (3,), (3, 4))

    Raises:
        DesignError: something in it is of another kind.
    """
    if value is None or isinstance(value, kind):
        return () if value is None else (value,)
    given = value if isinstance(value, (list, tuple)) else [value]
    for item in given:
        one(item, kind, what)
    return tuple(given)


def one(value, kind, what, needs=None):
    """The value, of a kind; a dict is taken for the keys of a Model.

    Args:
        kind: class, or several of them.   needs: what to hand over, in words; left out: the class by its name.
    Raises:
        DesignError: it is of another kind.
    """
    if isinstance(value, dict) and hasattr(kind, "model_validate"):
        try:
            return kind.model_validate(value)
        except ValidationError as error:
            raise DesignError(f"{what}: {complaints(error, kind)}") from None
    if not isinstance(value, kind):
        raise DesignError(f"{what}: it must be {needs or kind.__name__ + '(...)'}, it is {_in_words(value)}")
    return value


def _in_words(value):
    """A value for a message: short, with what it is."""
    return "None" if value is None else f"{shortened(value)} ({type(value).__name__})"
