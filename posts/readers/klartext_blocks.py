"""Klartext cut into statements, without their meaning: words with values, one statement a block.

A block may go on over lines that end with ~.  Decimal points and commas are alike.
"""

import re
from typing import NamedTuple

from cuspline.posts.readers.rs274_blocks import Block, refusal, refuse_foreign
from cuspline.posts.readers.rs274_expressions import Complaint

LONGEST_LINE = 255
UNSIGNED = r"(?:\d+(?:[.,]\d*)?|[.,]\d+)"
NUMBER = rf"[+-]?{UNSIGNED}"
COORDINATE = re.compile(rf"(I?[XYZ]|IPA|[ABC])({NUMBER})")
STATEMENTS = ("BEGIN PGM", "END PGM", "BLK FORM 0.1", "BLK FORM 0.2", "TOOL CALL", "TOOL DEF", "CYCL DEF", "CYCL CALL", "STOP",
              "FUNCTION TCPM", "FUNCTION RESET TCPM", "PLANE SPATIAL", "PLANE RESET", "CC", "CP", "CR", "C", "L", "M")


class Statement(NamedTuple):
    """One block."""

    kind: str                   # of STATEMENTS
    rest: tuple = ()            # words behind it, as written


class Words(NamedTuple):
    """What a path block says."""

    places: dict                # X, IX, IPA ... -> number
    sense: str = ""             # DR+, DR-
    radius: str = ""            # R0, RL, RR
    arc_radius: float = 0.0     # of CR
    feed: float | None = None
    is_rapid: bool = False
    functions: tuple = ()       # numbers of M functions


def blocks_of(text):
    """All lines of the text as Blocks whose `words` are one Statement each; END PGM has the flow "%".

    Raises:
        ReadError: a line that is no statement.
    """
    lines, blocks, at = text.split("\n"), [], 0
    while at < len(lines):
        first, parts = at, []
        try:
            while True:
                refuse_foreign(lines[at])
                code, said = _split(lines[at])
                parts.append(code.removesuffix("~"))
                at += 1
                if not code.endswith("~") or at == len(lines):
                    break
            blocks.append(_block(Block(first + 1, lines[first]), parts, said))
        except Complaint as complaint:
            raise refusal(complaint, Block(first + 1, lines[first])) from None
        blocks += [Block(k + 1, lines[k]) for k in range(first + 1, at)]
    return blocks


def _split(line):
    """(code, comment) at the first semicolon."""
    if len(line) > LONGEST_LINE:
        raise Complaint(f"{len(line)} characters", f"write at most {LONGEST_LINE} a line")
    code, _, comment = line.partition(";")
    code = code.strip().upper()
    if code and comment.rstrip().endswith("~"):         # what a word means stands between it and the ~
        return code + "~", ""
    return code, comment


def _block(block, parts, comment):
    code = re.sub(r"^\d+(?=\s|$)", "", " ".join(parts)).strip()
    block = block._replace(comments=(comment,) if comment else ())
    if code.startswith("/"):
        raise Complaint("a block that is skipped or not: what is cut would depend on a switch of the control",
                        "remove the block, or its /")
    if not code or code.startswith("*"):
        return block
    kind = next((s for s in STATEMENTS if re.match(rf"{re.escape(s)}(?![A-Z])", code)), None)
    if kind is None:
        raise Complaint(f'"{code}" is no statement that this reader knows', f"known are {', '.join(STATEMENTS)}")
    rest = code if kind == "M" else code[len(kind):]
    statement = Statement(kind, tuple(rest.split()))
    return block._replace(words=(statement,), flow="%" if kind == "END PGM" else "")


def number(text):
    """A number with point or comma."""
    return float(text.replace(",", "."))


def path_words(rest):
    """Words of a statement that moves, or of M functions alone.

    Raises:
        Complaint: a word that is not known, or one twice.

    >>> path_words(("X+10,5", "IZ-2", "R0", "F500", "M3"))[:1]
    ({'X': 10.5, 'IZ': -2.0},)
    """
    said, functions = {"places": {}}, []
    for word in rest:
        if found := COORDINATE.fullmatch(word):
            _once(said["places"], found[1], number(found[2]), word)
        elif word in ("DR+", "DR-"):
            _once(said, "sense", word, word)
        elif word in ("R0", "RL", "RR"):
            _once(said, "radius", word, word)
        elif word == "FMAX":
            _once(said, "is_rapid", True, word)
        elif found := re.fullmatch(rf"F({UNSIGNED})", word):
            _once(said, "feed", number(found[1]), word)
        elif found := re.fullmatch(rf"R({NUMBER})", word):
            _once(said, "arc_radius", number(found[1]), word)
        elif found := re.fullmatch(r"M(\d+)", word):
            functions.append(int(found[1]))
        else:
            raise Complaint(f'unknown word "{word}"', "known are X Y Z, the same with I, A B C, IPA, DR+ DR-, R0, R with a "
                            "radius, F, FMAX and M")
    return Words(functions=tuple(functions), **said)


def _once(into, name, value, word):
    if name in into:
        raise Complaint(f"{word} beside another of its kind", "leave one of them")
    into[name] = value
