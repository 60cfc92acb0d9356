"""Blocks of controls that know letters and numbers alone: no variables, no expressions."""

import re

from cuspline.posts.readers.rs274_expressions import Complaint

WORD = re.compile(r"([a-z])([+-]?(?:\d+\.?\d*|\.\d+))")
POINTLESS = re.compile(r"[+-]?0*[1-9]\d*")


def words_of(code, letters, needs_point=frozenset()):
    """The words of a block whose blanks are gone and whose letters are lower case.

    Args:
        letters: that the control knows.   needs_point: those whose numbers mean another unit without a decimal point.
    Returns:
        tuple of (letter, value) in the order written.
    Raises:
        Complaint: something that is no word, a letter that is not known, a number without its point.

    >>> words_of("g1x-2.5f300.", "gxf", "xf")
    (('g', 1.0), ('x', -2.5), ('f', 300.0))
    """
    words, at = [], 0
    while at < len(code):
        found = WORD.match(code, at)
        if not found:
            raise Complaint(f'"{code[at:].upper()}" is no word', "write a letter and a number, with digits and one point")
        letter, number = found.groups()
        if letter not in letters:
            raise Complaint(f'unknown word "{letter.upper()}"', "known here are " + " ".join(sorted(letters)).upper())
        if letter in needs_point and POINTLESS.fullmatch(number):
            raise Complaint(f"{letter.upper()}{number} without a decimal point may be millimetres or thousandths",
                            f"write {letter.upper()}{number}.")
        words.append((letter, float(number)))
        at = found.end()
    return tuple(words)


def without_brackets(line, others=";"):
    """(code without blanks in lower case, comments) of a line whose comments stand in round brackets.

    Raises:
        Complaint: a bracket without its fellow, or a character that begins no comment here.
    """
    comments = re.findall(r"\(([^()]*)\)", line)
    code = re.sub(r"\([^()]*\)", " ", line)
    if any(c in code for c in "()" + others):
        raise Complaint("a comment that is not closed, one inside another, or a ;",
                        "every ( needs its own ), every block its own line")
    return "".join(code.split()).lower(), tuple(comments)
