"""Haas text cut into blocks: words, O- and N-numbers, calls and comments, without their meaning.

The P of a G4 counts seconds with a decimal point and milliseconds without: the block has it in seconds.
A length or feed without a decimal point is refused: setting 162 decides whether it counts whole units or thousandths.
"""

import re

from cuspline.posts.readers.plain_words import WORD, without_brackets, words_of
from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refuse_block_delete
from cuspline.posts.readers.rs274_expressions import Complaint

LONGEST_LINE = 255
PROGRAM = re.compile(r"o(\d{1,5})")
CALL = re.compile(r"(m97|m98)p(\d+)(l\d+)?")
NUMBER = re.compile(r"n(\d+)")
NEEDS_POINT = frozenset("xyzabcijkrfeq")
LETTERS = NEEDS_POINT | frozenset("gmtshpd")
POINTLESS_DWELL = re.compile(r"g0?4(?!\d)(?=.*p\d+(?![\d.]))")
FLOW = re.compile(r"(if|while|goto|do|end|g65|g66|g67|m96)")


def blocks_of(text):
    """All lines of the text as blocks; `flow` is "program", "M97", "M98", "M99" or "%".

    The `label` of a program is "o101", that of a numbered block "n101"; a call's is the one that it calls.
    Raises:
        ReadError: a line that cannot be cut into words.
    """
    return lines_cut(text, _block, LONGEST_LINE)


def _block(number, line):
    code, comments = without_brackets(line)
    block = Block(number, line, comments=comments)
    if code == "%":
        return block._replace(flow="%")
    refuse_block_delete(code)
    if program := PROGRAM.fullmatch(code):
        return block._replace(flow="program", label=f"o{int(program[1])}")
    if numbered := NUMBER.match(code):
        code = code[numbered.end():]
        block = block._replace(label=f"n{int(numbered[1])}")
    if FLOW.match(code) or "#" in code:
        raise Complaint("control flow or variables that this reader does not follow", "known are M97, M98 and M99")
    if code == "m99":
        return block._replace(flow="M99", label="")
    if call := CALL.fullmatch(code):
        if call[3]:
            raise Complaint("a repeat count L", "write the call as often as it is made")
        return block._replace(flow=call[1].upper(), label=("n" if call[1] == "m97" else "o") + str(int(call[2])))
    if any(letter == "m" and float(n) in (97, 98, 99) for letter, n in WORD.findall(code)):
        raise Complaint("a call or a return with other words beside it", "give M97 P, M98 P and M99 a block of their own")
    words = words_of(code, LETTERS, NEEDS_POINT)
    if POINTLESS_DWELL.search(code):
        words = tuple((letter, value / 1000.0 if letter == "p" else value) for letter, value in words)
    return block._replace(words=words)
