"""Values of operations from the command line: `-p operation.spindle_rpm=5000`, `-p operation.finish.coolant=off`."""

from dataclasses import replace

from cuspline.planning.strategies.auto import Auto
from cuspline.values.errors import InputError
from cuspline.values.input_files import checked

PREFIX = "operation."


def with_values(design, given):
    """A Design whose operations have other values.

    Args:
        design: design.Design.
        given: [("spindle_rpm" or "<operation's title>.spindle_rpm", text)]; without a title of every operation that knows the
            value; a setup without operations has `Auto`.
    Raises:
        InputError: no operation of that title, or none that knows the value; a value that cannot be meant.
    """
    if not given:
        return design
    setups = [s if s.operations else s.model_copy(update={"operations": (Auto(),)}) for s in design.setups]
    titles = dict.fromkeys(o.title for s in setups for o in s.operations)
    for name, text in given:
        title, _, value = name.rpartition(".")
        if title and title not in titles:
            raise InputError(f"-p {PREFIX}{name}: no operation is called {title!r}; there are {', '.join(titles) or 'none'}")
        known = {k for s in setups for o in s.operations if title in ("", o.title) for k in type(o).model_fields}
        if value not in known - {"kind", "name", "faces"}:
            raise InputError(f"-p {PREFIX}{name}: operations know no {value!r}; they know "
                             f"{', '.join(sorted(known - {'kind', 'name', 'faces'}))}")
        setups = [s.model_copy(update={"operations": tuple(
            _changed(o, value, text) if title in ("", o.title) and value in type(o).model_fields else o for o in s.operations)})
            for s in setups]
    return replace(design, setups=tuple(setups))


def _changed(operation, name, text):
    """The operation with one value, checked as a file's would be."""
    said = {key: value for key, value in operation.model_dump().items() if key != "kind"}
    return checked(type(operation), {**said, name: text}, f"-p {PREFIX}{name}={text}")
