"""Fanuc text cut into blocks: words, variable settings, O-numbers, calls and comments, without their meaning.

A length or feed without a decimal point is refused: whether X10 is ten millimetres or ten micrometres is a
parameter of the control (3401 bit 0), not of the text.
"""

import re

from cuspline.posts.readers.plain_words import POINTLESS, without_brackets
from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refuse_block_delete
from cuspline.posts.readers.rs274_expressions import Complaint, Scanner, value_at

LONGEST_LINE = 252
PROGRAM = re.compile(r"(?:o|:)(\d{1,4})")
CALL = re.compile(r"(?:n\d+)?(g65|m98)(?=p)(.*)")
RETURN = re.compile(r"(?:n\d+)?m99")
POINTED_DWELL = re.compile(r"g0?4(?!\d).*p\d*\.")
FLOW = re.compile(r"(?:n\d+)?(if|while|goto|do|end|g66|g67)")
NEEDS_POINT = frozenset("xyzabcijkrfq")
WHOLE = frozenset("gmtshpd")
LETTERS = NEEDS_POINT | WHOLE
# G65, argument list I: letter -> variable
ARGUMENTS = {"a": 1, "b": 2, "c": 3, "i": 4, "j": 5, "k": 6, "d": 7, "e": 8, "f": 9, "h": 11, "m": 13, "q": 17, "r": 18,
             "s": 19, "t": 20, "u": 21, "v": 22, "w": 23, "x": 24, "y": 25, "z": 26}


def blocks_of(text):
    """All lines of the text as blocks; `flow` is "program", "G65", "M98", "M99" or "%".

    Raises:
        ReadError: a line that cannot be cut into words.
    """
    return lines_cut(text, _block, LONGEST_LINE)


def _block(number, line):
    if "\r" in line.rstrip("\r"):
        raise Complaint("a carriage return inside a line: it may end the block, or mean nothing",
                        "end every block with a line feed")
    code, comments = without_brackets(line)          # a ; is no comment: it ends a block, and another may follow
    block = Block(number, line, comments=comments)
    if code == "%":
        return block._replace(flow="%")
    refuse_block_delete(code)
    if FLOW.match(code):
        raise Complaint("control flow that this reader does not follow", "known are G65, M98 and M99")
    return _flow_block(block, code) or _plain_block(block, code)


def _flow_block(block, code):
    """A program's number, a call, a return; None for any other block."""
    program, call = PROGRAM.fullmatch(code), CALL.fullmatch(code)
    if program:
        return block._replace(flow="program", label=program[1].lstrip("0"))
    if RETURN.fullmatch(code):
        return block._replace(flow="M99")
    if call:
        words = _words(Scanner(call[2]), set(ARGUMENTS) | {"p", "l"})
        given = dict(words)
        if "l" in given:
            raise Complaint("a repeat count L", "write the call as often as it is made")
        if call[1] == "m98" and given.keys() != {"p"}:
            raise Complaint("M98 with arguments", "M98 takes P alone; G65 takes arguments")
        if len(given) != len(words):
            raise Complaint("a letter twice in one call", "argument list II is not read; give every letter once")
        label = given.pop("p")
        if callable(label) or label != int(label):
            raise Complaint("a call by a computed number", "write the number behind P")
        return block._replace(flow=call[1].upper(), label=str(int(label)),
                              arguments=tuple((ARGUMENTS[letter], value) for letter, value in given.items()))
    return None


def _plain_block(block, code):
    scanner, settings = Scanner(re.sub(r"^n\d+", "", code)), []
    if scanner.take("#"):
        index = value_at(scanner)
        scanner.expect("=")
        settings.append((index, value_at(scanner)))
        if scanner.next:
            raise Complaint(f'"{scanner.code[scanner.at:]}" behind a setting', "give it a block of its own")
    if POINTED_DWELL.search(code):
        raise Complaint("G4 with a decimal point in P, which counts milliseconds", "write P without a point, or X and seconds")
    return block._replace(words=tuple(_words(scanner, LETTERS)), settings=tuple(settings))


def _words(scanner, letters):
    words = []
    while scanner.next:
        letter = scanner.next
        if letter not in letters:
            raise Complaint(f'unknown word "{letter.upper()}"', "known here are " + " ".join(sorted(letters)).upper())
        scanner.at += 1
        begin = scanner.at
        value = value_at(scanner)
        text = scanner.code[begin:scanner.at]
        is_whole = letter in WHOLE and letters is LETTERS or letter == "p"
        if not is_whole and POINTLESS.fullmatch(text):
            raise Complaint(f"{letter.upper()}{text} without a decimal point may be millimetres or thousandths",
                            f"write {letter.upper()}{text}.")
        words.append((letter, value))
    return words
