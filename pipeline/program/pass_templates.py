"""Repeated passes told once: sub-programs with arguments, and the calls that make a path of them.

    template "clockwise"(y, z, c)          passes
      let radius = sqrt(y y + (z-c)(z-c))    restart 1: x = 0
      go z = clear                           call clockwise(4.1, 20.3, 19.9)
      go x, y = -y - r ...                   call clockwise(4.1, 20.2, 19.8)
      arc ...                                restart 2: x = 25
      let x = x + step                       ...

Like all of the Program this knows no controller: a post writes templates as its control spells sub-programs, or
writes the moves that they come to.  Letters stand for arguments (of one call), registers (of the whole program; some
count on, like x above) and locals (of one call, computed).  Lengths come in by arguments and registers only, so the
numbers in a template are pure and a template is the same in mm and inch.
"""

import math
import operator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cuspline.program.program import Kind, MoveWriter, Plane
from cuspline.values.errors import ToolpathError

OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


class Term:
    """A number that a controller can compute; + - * / build larger ones."""

    def __add__(self, other):
        return Formula("+", self, term(other))

    def __sub__(self, other):
        return Formula("-", self, term(other))

    def __mul__(self, other):
        return Formula("*", self, term(other))

    def __truediv__(self, other):
        return Formula("/", self, term(other))

    def __neg__(self):
        return Formula("-", Number(0.0), self)


@dataclass(frozen=True)
class Number(Term):
    """A pure number."""

    value: float


@dataclass(frozen=True)
class Named(Term):
    """What an argument, a register or a local holds."""

    name: str


@dataclass(frozen=True)
class Formula(Term):
    """Two terms and one of + - * /."""

    sign: str
    left: Term
    right: Term


@dataclass(frozen=True)
class Root(Term):
    """A square root."""

    of: Term


def term(value):
    """A Term of a Term, a name, or a number."""
    if isinstance(value, Term):
        return value
    return Named(value) if isinstance(value, str) else Number(float(value))


def terms(names):
    """One Named a word, to write formulas with.

    >>> y, c = terms("y c"); value_of(y * 2 - c, {"y": 3.0, "c": 1.0})
    5.0
    """
    return tuple(Named(n) for n in names.split())


def value_of(a_term, values):
    """The term's number, with the letters as they stand in `values`."""
    if isinstance(a_term, Number):
        return a_term.value
    if isinstance(a_term, Named):
        return values[a_term.name]
    if isinstance(a_term, Root):
        return math.sqrt(value_of(a_term.of, values))
    return OPERATORS[a_term.sign](value_of(a_term.left, values), value_of(a_term.right, values))


def names_in(a_term):
    """Letters that a term asks for."""
    if isinstance(a_term, Named):
        return {a_term.name}
    if isinstance(a_term, Root):
        return names_in(a_term.of)
    return names_in(a_term.left) | names_in(a_term.right) if isinstance(a_term, Formula) else set()


@dataclass(frozen=True)
class Let:
    """Gives a register or a local its value."""

    name: str
    value: Term


@dataclass(frozen=True)
class Go:
    """One move; an axis left out stays.  The tip, in the setup's WCS."""

    kind: Kind
    x: Term | None = None
    y: Term | None = None
    z: Term | None = None
    center: tuple[Term, Term] | None = None     # of an arc, in its plane's first and second axis
    plane: Plane = Plane.XY
    feed: Term | None = None                    # None on rapids

    @property
    def ends(self):
        """(x, y, z) terms, None where the axis stays."""
        return self.x, self.y, self.z


@dataclass(frozen=True)
class Quantity:
    """What an argument or a register is."""

    name: str
    unit: Literal["mm", "mm/min", ""] = "mm"
    axis: int | None = None         # a coordinate along that axis, which goes with the zero; None: a length or number
    meaning: str = ""               # in words, for the program's comments


@dataclass(frozen=True)
class PassTemplate:
    """A sub-program: its first move is a rapid straight up or a move that names all axes its arcs start from."""

    name: str                               # "finish clockwise"
    arguments: tuple[Quantity, ...]
    body: tuple[Let | Go, ...]

    @property
    def locals(self):
        """Names given in the body, in order; registers among them are the program's to know."""
        return tuple(dict.fromkeys(s.name for s in self.body if isinstance(s, Let)))


@dataclass(frozen=True)
class Register:
    """A value that the whole program sees, as it stands at the start."""

    quantity: Quantity
    value: float

    @property
    def name(self):
        return self.quantity.name


@dataclass(frozen=True)
class Restart:
    """A place in the main program where cutting may begin anew: it says all registers that count on."""

    number: int                                     # from 1
    values: tuple[tuple[str, float], ...]           # (register, value)


@dataclass(frozen=True)
class Call:
    """A template with numbers for its arguments."""

    template: str
    arguments: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class TemplatedPasses:
    """All passes of one operation as templates, registers and calls.

    The first item is a Restart.  What follows a Restart begins with a rapid to the height of `start_mm` or above, so
    that the tool may come from anywhere.

    Raises:
        ToolpathError: a letter that nothing gives, a call of what is not there, a Restart that cannot be begun at.
    """

    start_mm: tuple[float, float, float]            # above the work
    registers: tuple[Register, ...]
    templates: tuple[PassTemplate, ...]
    items: tuple[Restart | Call, ...]

    def __post_init__(self):
        known = {t.name: t for t in self.templates}
        registers = {r.name for r in self.registers}
        for t in self.templates:
            _check_letters(t, registers)
        if not self.items or not isinstance(self.items[0], Restart):
            raise ToolpathError("templated passes begin with a restart point")
        for item in self.items:
            wrong = isinstance(item, Call) and (item.template not in known or
                                                len(item.arguments) != len(known[item.template].arguments))
            if wrong:
                raise ToolpathError(f"call of {item.template!r} with {len(item.arguments)} arguments: templates are "
                                    + ", ".join(f"{t.name!r} with {len(t.arguments)}" for t in self.templates))
        counting = {name for t in self.templates for name in t.locals} & registers
        for item, following in zip(self.items, [*self.items[1:], None]):
            if isinstance(item, Restart):
                said = {name for name, _ in item.values}
                if not counting <= said <= registers:
                    raise ToolpathError(f"restart point {item.number} gives {sorted(said)}; registers that count on "
                                        f"are {sorted(counting)}, and all there are {sorted(registers)}")
                self._check_restart(item, following, known)

    def _check_restart(self, item, following, known):
        first = next((s for s in known[following.template].body if isinstance(s, Go)), None) \
            if isinstance(following, Call) else None
        lifts = first is not None and first.kind == Kind.RAPID and first.z is not None and first.x is first.y is None
        if not lifts:
            raise ToolpathError(f"restart point {item.number}: the pass after it must begin with a rapid straight up")

    @property
    def restarts(self):
        """Index of every Restart in the items."""
        return [k for k, item in enumerate(self.items) if isinstance(item, Restart)]

    def register(self, name):
        """The Register of that name."""
        return next(r for r in self.registers if r.name == name)

    def with_registers(self, **values):
        """The same with other values in some registers."""
        return replace(self, registers=tuple(replace(r, value=float(values.get(r.name, r.value)))
                                             for r in self.registers))

    def shifted(self, by_mm):
        """The same passes seen from a zero that lies elsewhere: every coordinate grows by (3,) `by_mm`."""
        return self._with_numbers([a + b for a, b in zip(self.start_mm, by_mm)], lambda value, quantity: (
            value if quantity.axis is None else value + by_mm[quantity.axis]))

    def rounded(self, rounding):
        """The same with every number as a text gives it: `rounding(value, unit)`."""
        return self._with_numbers([rounding(v, "mm") for v in self.start_mm],
                                  lambda value, quantity: rounding(value, quantity.unit))

    def _with_numbers(self, start_mm, change):
        """The same from another start, with `change(value, quantity)` for every register, restart and argument."""
        arguments = {t.name: t.arguments for t in self.templates}
        quantity = {r.name: r.quantity for r in self.registers}

        def changed(item):
            if isinstance(item, Restart):
                return replace(item, values=tuple((n, float(change(v, quantity[n]))) for n, v in item.values))
            return replace(item, arguments=tuple(
                float(change(v, q)) for q, v in zip(arguments[item.template], item.arguments)))

        return replace(self, start_mm=tuple(float(v) for v in start_mm), items=tuple(map(changed, self.items)),
                       registers=tuple(replace(r, value=float(change(r.value, r.quantity))) for r in self.registers))

    def moves(self):
        """The moves that the calls come to, one after the other: the long-hand program."""
        return self.moves_and_items()[0]

    def moves_and_items(self):
        """(Moves, (n,) index of the item that made each, (n,) name of the register that gives its feed, "" none).

        Raises:
            ToolpathError: a formula has no value, such as the root of a negative number.
        """
        writer, made, feeds = MoveWriter(self.start_mm), [], []
        registers = {r.name: r.value for r in self.registers}
        known = {t.name: t for t in self.templates}
        for k, item in enumerate(self.items):
            if isinstance(item, Restart):
                registers |= dict(item.values)
                continue
            try:
                fed = _expand(writer, known[item.template], item.arguments, registers)
            except (ValueError, ZeroDivisionError) as error:
                raise ToolpathError(f"call {k} of {item.template!r} with {item.arguments}: {error}", rows=[k]) from None
            made += [k] * len(fed)
            feeds += fed
        return writer.moves(), np.array(made, int), np.array(feeds, object)


def _check_letters(template, registers):
    """Every letter is given before it is asked for."""
    known = registers | {a.name for a in template.arguments}
    if len(known) != len(registers) + len(template.arguments):
        raise ToolpathError(f"template {template.name!r}: an argument and a register share a name")
    for step in template.body:
        asked = [step.value] if isinstance(step, Let) else [*step.ends, *(step.center or ()), step.feed]
        unknown = set().union(*(names_in(t) for t in asked if t is not None)) - known
        if unknown:
            raise ToolpathError(f"template {template.name!r} uses {sorted(unknown)}, which nothing gives")
        if isinstance(step, Let):
            known = known | {step.name}
        elif (step.kind == Kind.RAPID) != (step.feed is None):
            raise ToolpathError(f"template {template.name!r}: a cutting move needs a feed, a rapid has none")


def _expand(writer, template, arguments, registers):
    """Write the moves of one call; registers given in it stay given.  Returns the feed register of each move."""
    values, fed = registers | dict(zip((a.name for a in template.arguments), arguments)), []
    for step in template.body:
        if isinstance(step, Let):
            values[step.name] = value_of(step.value, values)
            if step.name in registers:
                registers[step.name] = values[step.name]
            continue
        before = len(writer)
        end = [value_of(t, values) if t is not None else here for t, here in zip(step.ends, writer.here_mm)]
        if step.kind == Kind.RAPID:
            writer.rapid(end)
        elif step.kind == Kind.FEED:
            writer.feed(end, value_of(step.feed, values))
        else:
            a, b, _ = step.plane.axes
            center = np.array(end)
            center[[a, b]] = [value_of(t, values) for t in step.center]
            writer.arc(end, center, step.plane, step.kind == Kind.ARC_CW, value_of(step.feed, values))
        name = step.feed.name if isinstance(step.feed, Named) else ""
        fed += [name] * (len(writer) - before)
    return fed
