"""Blocks in the order a Fanuc control executes them: programs by number, macro calls, variables.

    O0001            the first program is the main program
    G65 P8001 A1.    arguments become #1 .. #26 of the call; #1 to #33 are each call's own
    M98 P8002        a plain call: the caller's variables
    M30
    O8001 ... M99    back to the caller
"""

from typing import NamedTuple

from cuspline.posts.readers.rs274_blocks import refusal, refuse_endless_calls
from cuspline.posts.readers.rs274_expressions import Complaint, evaluated

DEEPEST_CALL = 4        # what the oldest controls with macro B take, newer ones ten; our posts nest one deep
LOCALS = range(1, 34)
COMMON = (range(100, 200), range(500, 1000))


def executed(blocks):
    """Yield (block, words) in the order of execution, every word's value a float.

    O-number, call, return and % blocks are not yielded.
    Raises:
        ReadError: a call of what is not there, calls nested too deep or without end, a variable never set, text
        without its % or O-number.
    """
    flow, called = _Flow(blocks), 0
    while flow.at < len(blocks):
        block = blocks[flow.at]
        flow.at += 1
        if flow.calls:
            block, called = block._replace(call_line=flow.calls[0].line), called + 1
            refuse_endless_calls(called, block)
        try:
            if block.flow:
                flow.follow(block)
                continue
            words = flow.resolved(block)
        except Complaint as complaint:
            raise refusal(complaint, block) from None
        yield block, words


class _Call(NamedTuple):
    """A sub-program under way."""

    line: int       # of the call
    back: int       # index to return to
    own: dict       # the caller's variables
    kind: str       # "G65" or "M98"


class _Flow:
    """Where execution stands, and the variables as they stand there."""

    def __init__(self, blocks):
        said = [b for b in blocks if not b.is_blank]
        if len(said) < 2 or not said[0].flow == said[-1].flow == "%":
            raise refusal(Complaint("the text does not stand between two % lines", "begin and end it with %"),
                          blocks[0])
        if said[1].flow != "program":
            raise refusal(Complaint("text before the first O-number", "write O0001 behind the %"), said[1])
        self.programs = {}          # number, or label of a block -> index of its first block; None: there are two
        for k, block in enumerate(blocks):
            if block.label and not block.flow:
                self.programs[block.label] = None if block.label in self.programs else k
            if block.flow == "program":
                if block.label in self.programs:
                    raise refusal(Complaint(f"{_named(block.label)} twice", "number every program once"), block)
                self.programs[block.label] = k + 1
        self.at = self.programs[said[1].label]
        self.main, self.common, self.own, self.calls = said[1].label, {}, {}, []

    def resolved(self, block):
        """The block's words as floats; a setting takes effect."""
        variables = self.own | self.common if block.settings or any(callable(v) for _, v in block.words) else {}
        words = [(letter, evaluated(value, variables)) for letter, value in block.words]
        for index, value in block.settings:
            self._set(evaluated(index, variables), evaluated(value, variables))
        return words

    def _set(self, index, value):
        if index in LOCALS:
            self.own = {**self.own, int(index): value}
        elif any(index in part for part in COMMON):
            self.common[int(index)] = value
        else:
            raise Complaint(f"#{index:g} is no variable of a program's own",
                            "use #1 to #33, #100 to #199, #500 to #999")

    def follow(self, block):
        """Go where the block leads."""
        {"G65": self.call, "M98": self.call, "M97": self.call, "M99": self.leave, "program": self.fall_through,
         "%": self.fall_through}[block.flow](block)

    def call(self, block):
        if self.programs.get(block.label) is None or block.label == self.main:
            raise Complaint(f"{_named(block.label)} is called, but the text holds no such sub-program, or two",
                            "add it behind M30")
        if len(self.calls) >= DEEPEST_CALL:
            raise Complaint(f"calls nested deeper than {DEEPEST_CALL}",
                            "some controls stop there: write the inner sub-program's blocks out")
        self.calls.append(_Call(block.number, self.at, self.own, block.flow))
        if block.flow == "G65":
            variables = self.own | self.common
            self.own = {index: evaluated(value, variables) for index, value in block.arguments}
        self.at = self.programs[block.label]

    def leave(self, block):
        if not self.calls:
            raise Complaint("M99 in the main program: it would run for ever", "end it with M30")
        call = self.calls.pop()
        self.at = call.back
        if call.kind == "G65":
            self.own = call.own

    def fall_through(self, block):
        raise Complaint("a program runs into the next one or the %", "end it with M99, the main program with M30")


def _named(label):
    """A program's number as it is written; labels of Haas text have their letter."""
    return f"O{label}" if label[:1].isdigit() else label.upper()
