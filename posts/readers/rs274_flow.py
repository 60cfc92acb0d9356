"""Blocks in the order a controller executes them: % lines, sub-programs, parameters.

    o100 sub            defined before it is called, skipped when met
      G1 X#1 Y#2        #1 to #30 are the call's own
    o100 endsub
    o100 call [10] [#31+5]
"""

from itertools import islice
from typing import NamedTuple

from cuspline.posts.readers.rs274_blocks import refusal, refuse_endless_calls
from cuspline.posts.readers.rs274_expressions import Complaint, evaluated, parameter_index

DEEPEST_CALL = 9        # LinuxCNC keeps ten levels, the program itself is one
LOCALS = range(1, 31)


def executed(blocks):
    """Yield (block, words) in the order of execution, every word's value a float.

    The O-word and % blocks themselves are not yielded.
    Raises:
        ReadError: a call of what is not defined, calls nested too deep or without end, a parameter never set, misplaced
            O-words.
    """
    flow, called = _Flow(blocks), 0
    while flow.at < len(blocks):
        block = blocks[flow.at]
        flow.at += 1
        if flow.calls:
            block, called = block._replace(call_line=flow.calls[0].line), called + 1
            refuse_endless_calls(called, block)
        try:
            words = block.words
            if block.flow:
                flow.follow(block)
            elif block.settings or any(callable(value) for _, value in words):
                words = flow.resolved(block)
        except Complaint as complaint:
            raise refusal(complaint, block) from None
        if not block.flow:
            yield block, words


class _Call(NamedTuple):
    """A sub-program under way."""

    line: int       # of the call
    back: int       # index to return to
    own: dict       # the caller's own #1 to #30


class _Flow:
    """Where execution stands, and the parameters as they stand there."""

    def __init__(self, blocks):
        self.blocks = blocks
        self.at = 0
        self.parameters = {}
        self.subs = {}          # label -> index of its first block
        self.calls = []         # of _Call, the main program's first

    def resolved(self, block):
        """The block's words as floats; its settings take effect after all of them are read."""
        words = [(letter, evaluated(value, self.parameters)) for letter, value in block.words]
        settings = [(parameter_index(evaluated(index, self.parameters)), evaluated(value, self.parameters))
                    for index, value in block.settings]
        self.parameters.update(settings)
        return words

    def follow(self, block):
        """Go where an O-word leads."""
        {"sub": self.define, "call": self.call, "endsub": self.leave, "return": self.leave,
         "%": self.close}[block.flow](block)

    def define(self, block):
        if self.calls:
            raise Complaint("a sub inside a sub", "define each at the top level")
        end = next((b for b in islice(self.blocks, self.at, None) if b.flow in ("sub", "endsub")), block)
        if (end.flow, end.label) != ("endsub", block.label):
            raise Complaint(f"o{block.label} sub has no endsub of its own", f"close it with o{block.label} endsub")
        self.subs[block.label] = self.at
        self.at = end.number

    def call(self, block):
        if block.label not in self.subs:
            raise Complaint(f"o{block.label} is called but not defined above", "define it before its first call")
        if len(self.calls) >= DEEPEST_CALL:
            raise Complaint(f"calls nested deeper than {DEEPEST_CALL}",
                            "LinuxCNC stops there: write the inner sub's blocks out")
        if len(block.arguments) > len(LOCALS):
            raise Complaint(f"{len(block.arguments)} arguments", f"a call takes {len(LOCALS)}")
        given = dict(enumerate((evaluated(a, self.parameters) for a in block.arguments), 1))
        self.calls.append(_Call(block.number, self.at, {i: v for i, v in self.parameters.items() if i in LOCALS}))
        self._set_locals(given)
        self.at = self.subs[block.label]

    def leave(self, block):
        if not self.calls:
            raise Complaint(f"{block.flow} outside of any sub", "remove it")
        call = self.calls.pop()
        self.at = call.back
        self._set_locals(call.own)

    def close(self, block):
        """A % opens the text or ends it; nothing may follow the second."""
        is_opening = all(b.is_blank for b in islice(self.blocks, block.number - 1))
        if not is_opening:
            refuse_text_after(self.blocks, block)
            self.at = len(self.blocks)

    def _set_locals(self, own):
        self.parameters = {i: v for i, v in self.parameters.items() if i not in LOCALS} | own


def is_closed_by_percent(blocks):
    """The text stands between two % lines, which end it even without M2."""
    said = [b for b in blocks if not b.is_blank]
    return len(said) > 1 and said[0].flow == said[-1].flow == "%"


def refuse_text_after(blocks, end):
    """Complain about anything but comments and a % after the block that ends the program."""
    for block in blocks[end.number:]:
        if not block.is_blank and block.flow != "%":
            raise refusal(Complaint(f"text after the program end in line {end.number}",
                                    "remove it, or move the end behind it"), block)
