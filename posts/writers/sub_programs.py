"""Pass templates as sub-programs, registers as variables, calls with numbers: spelled by a control's own rules."""

from dataclasses import dataclass

import numpy as np

from cuspline.posts.writers.words import MOTION_WORD, PLANE_WORD
from cuspline.program.pass_templates import Formula, Let, Named, Number, Restart, Root
from cuspline.program.program import Kind
from cuspline.values.errors import PostError

FIRST_REGISTER = 101            # common to all programs on the controls that we know
FIRST_SUB = 7001                # controls may protect programs from O8000 on against editing
RESTARTS_AN_OPERATION = 1000    # N2003: third restart point of the second operation
NUMBER_DECIMALS = 7             # of pure numbers
RANK = {"+": 1, "-": 1, "*": 2, "/": 2}


@dataclass(frozen=True, kw_only=True)
class Variables:
    """Which variables a control keeps for what."""

    arguments: tuple[int, ...]      # of a call, in order
    locals: tuple[int, ...]         # free within a sub-program
    deepest_brackets: int           # in one expression


class SubPrograms:
    """Labels of the templates and numbers of the registers of a whole program."""

    def __init__(self, program, variables):
        self.variables = variables
        told = [o.passes for o in program.operations if o.passes is not None]
        self.templates = list(dict.fromkeys(t for p in told for t in p.templates))
        names = list(dict.fromkeys(r.name for p in told for r in p.registers))
        self.registers = {name: FIRST_REGISTER + k for k, name in enumerate(names)}

    def label(self, template):
        """Number of a template's sub-program."""
        return FIRST_SUB + self.templates.index(template)

    def body(self, template, writer):
        """Blocks of a template's sub-program."""
        spelled = _Spelled(template, self.registers, self.variables, writer)
        return [spelled.block(step) for step in template.body]

    def comment(self, template):
        """What a template's sub-program is called and what it is given."""
        return f"{template.name}: " + ", ".join(f"#{n} {a.meaning or a.name}" for n, a in zip(
            self.variables.arguments, template.arguments))

    def settings(self, passes, writer):
        """(block, comment) that gives each register its value."""
        return [(f"#{self.registers[r.name]}={number_text(r.value, r.quantity.unit, writer)}",
                 r.quantity.meaning or r.name) for r in passes.registers]

    def restart(self, item, passes, operation_number, writer):
        """Blocks of a restart point, the first with its block number, alone where no register counts on."""
        unit = {r.name: r.quantity.unit for r in passes.registers}
        blocks = [f"#{self.registers[n]}={number_text(v, unit[n], writer)}" for n, v in item.values]
        return [" ".join([f"N{restart_number(operation_number, item.number)}", *blocks[:1]]), *blocks[1:]]


def restart_number(operation_number, number):
    """Block number of an operation's restart point; both count from 1.

    Raises:
        PostError: more restart points than there are block numbers.
    """
    if number >= RESTARTS_AN_OPERATION:
        raise PostError(f"{number} restart points in one operation: at most {RESTARTS_AN_OPERATION - 1} have a block "
                        "number of their own; put them farther apart")
    return RESTARTS_AN_OPERATION * operation_number + number


def number_text(value, unit, writer):
    """A number of that unit as the control reads it.

    Raises:
        PostError: a feed that rounds to nothing.
    """
    if unit == "mm":
        return writer.length(value)
    if unit == "mm/min":
        return writer.feed_text(value)
    return writer.number(value, NUMBER_DECIMALS)


def largest_rounding_mm(exact, passes, writer):
    """How far numbers rounded in the text move any end point of the passes, or the crown of an arc, mm.

    Args:
        exact: Moves that the passes come to.   passes: TemplatedPasses.   writer: Writer.
    Raises:
        PostError: rounding makes or takes away a move.
    """
    as_read = lambda value, unit: float(number_text(value, unit, writer)) / (writer.scale if unit else 1.0)
    posted = passes.rounded(as_read).moves()
    if len(exact) != len(posted):
        raise PostError("rounding to the control's decimals makes or takes away a move: the passes have steps "
                        "shorter than its last decimal")
    off = np.linalg.norm(exact.end_mm - posted.end_mm, axis=1)
    arcs = exact.kind >= Kind.ARC_CW
    (centers, radii), (posted_centers, posted_radii) = _arcs(exact, arcs), _arcs(posted, arcs)
    round_arcs = np.linalg.norm(centers - posted_centers, axis=1) + np.abs(radii - posted_radii)
    return float(max(off.max(initial=0.0), round_arcs.max(initial=0.0)))


def _arcs(moves, rows):
    """(n, 2) centres in their planes and (n,) radii of the arcs."""
    axes = np.array([(0, 1), (2, 0), (1, 2)])[moves.plane[rows]]
    at = np.arange(len(axes))[:, None]
    centers = moves.center_mm[rows][at, axes]
    return centers, np.linalg.norm(moves.end_mm[rows][at, axes] - centers, axis=1)


class _Spelled:
    """The steps of one template with variables for its letters."""

    def __init__(self, template, registers, variables, writer):
        self.template, self.variables, self.writer = template, variables, writer
        own = [n for n in template.locals if n not in registers]
        for what, wanted, room in (("arguments", template.arguments, variables.arguments),
                                   ("locals", own, variables.locals)):
            if len(wanted) > len(room):
                raise PostError(f"sub-program {template.name!r} needs {len(wanted)} {what}, "
                                f"the control has {len(room)}")
        self.number = {**registers, **{a.name: n for a, n in zip(template.arguments, variables.arguments)}}
        free = [n for n in variables.locals if n not in variables.arguments[:len(template.arguments)]]
        self.number |= dict(zip(own, free))
        self.ends = [None] * 3          # terms of where the tool stands, as far as this template said

    def block(self, step):
        """One block."""
        if isinstance(step, Let):
            return f"#{self.number[step.name]}={self._value(step.value)}"
        words = [MOTION_WORD[step.kind]]
        if step.kind >= Kind.ARC_CW:
            words.insert(0, PLANE_WORD[step.plane])
        words += ["XYZ"[k] + self._value(t) for k, t in enumerate(step.ends) if t is not None]
        if step.kind >= Kind.ARC_CW:
            words += self._center(step)
        if step.feed is not None:
            words.append("F" + self._value(step.feed))
        self.ends = [old if new is None else new for old, new in zip(self.ends, step.ends)]
        return " ".join(words)

    def _center(self, step):
        """Centre words: from where the arc begins."""
        words = []
        for axis, center in sorted(zip(step.plane.axes[:2], step.center)):
            if self.ends[axis] is None or step.ends[axis] is None:
                raise PostError(f"sub-program {self.template.name!r}: an arc begins or ends at a {'XYZ'[axis]} that "
                                "the sub-program does not say")
            words.append("IJK"[axis] + self._value(center - self.ends[axis]))
        return words

    def _value(self, term):
        """A term as the value of a word: a variable, a number, or an expression in brackets."""
        text = self._text(term)
        if _deepest(text) + 1 > self.variables.deepest_brackets:
            raise PostError(f"sub-program {self.template.name!r}: {text} nests brackets deeper than the "
                            f"{self.variables.deepest_brackets} that the control takes; give a part of it a name")
        return text if isinstance(term, Named) or (isinstance(term, Number) and term.value >= 0) else f"[{text}]"

    def _text(self, term, rank=0):
        """The inside of an expression, with brackets where the order of execution needs them."""
        if isinstance(term, Named):
            return f"#{self.number[term.name]}"
        if isinstance(term, Number):
            text = number_text(abs(term.value), "", self.writer)
            return text if term.value >= 0 else f"[0-{text}]"
        if isinstance(term, Root):
            return f"SQRT[{self._text(term.of)}]"
        assert isinstance(term, Formula)
        mine = RANK[term.sign]
        text = f"{self._text(term.left, mine)}{term.sign}{self._text(term.right, mine + 1)}"
        return f"[{text}]" if mine < rank else text


def _deepest(text):
    depth = deepest = 0
    for character in text:
        depth += (character == "[") - (character == "]")
        deepest = max(deepest, depth)
    return deepest


def calls_between(passes):
    """[(first item, end item)] of the passes from each restart point to the next."""
    starts = passes.restarts
    return list(zip(starts, [*starts[1:], len(passes.items)]))


def main_lines(passes, span, sub_programs, operation_number, spell_call, writer):
    """Blocks of the main program from one restart point to the next: data and calls."""
    templates = {t.name: t for t in passes.templates}
    lines = []
    for item in passes.items[span[0]:span[1]]:
        if isinstance(item, Restart):
            lines += sub_programs.restart(item, passes, operation_number, writer)
            continue
        template = templates[item.template]
        numbers = [number_text(v, q.unit, writer) for v, q in zip(item.arguments, template.arguments)]
        lines.append(spell_call(sub_programs.label(template), numbers))
    return lines
