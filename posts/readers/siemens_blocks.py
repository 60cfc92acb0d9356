"""Sinumerik text cut into blocks: words, names with values, keywords and comments, without their meaning."""

import re
from typing import NamedTuple

from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refuse_block_delete
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.siemens_registers import Registers

LONGEST_LINE = 512
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
HEADER = re.compile(r"%_N_\w+_(MPF|SPF)|%")
MESSAGE = re.compile(r'MSG\s*\(\s*("[^"]*")?\s*\)')
SWIVEL = re.compile(r'CYCLE800\s*\(([^()]*)\)')
DRILLING = re.compile(r"(CYCLE8[1235])\s*\(([^()]*)\)")
NAMED = re.compile(rf'([A-Z]+\d*)\s*=\s*(?:({NUMBER})|"([^"]*)")(?![\w.(])')
COMPUTED = re.compile(r"([A-Z]+\d*)\s*=\s*([-+*/(). R\d]*R\d[-+*/(). R\d]*)")
WORD = re.compile(rf"([A-Z])\s*({NUMBER})(?!\s*=)")
KEYWORD = re.compile(r"([A-Z]{2,})(?![\w=(])")
KEYWORDS = ("SUPA", "CIP", "TRANS", "RTLION", "TRAORI", "TRAFOOF", "ORIAXES", "NORM", "CFTCP")
NAMES = ("T", "X", "Y", "Z", "A", "B", "C", "I", "J", "K", "F", "S", "D", "TURN", "CR", "CTOL", "ADIS", "I1", "J1", "K1", "SPOS")
LETTERS = frozenset("XYZABCIJKFSTDGM")


class Said(NamedTuple):
    """What one block says."""

    codes: tuple = ()           # ("G", 642.0), ("M", 6.0)
    values: dict = {}           # letter or name -> number
    keywords: tuple = ()
    swivel: tuple = ()          # what stands in the brackets of CYCLE800, a keyword
    drilling: tuple = ()        # (name, numbers in its brackets, None where one is left out) of CYCLE81, 82, 83, 85


def blocks_of(text):
    """All lines of the text as Blocks, whose `words` are one Said each, none where nothing is said.

    Raises:
        ReadError: a line that cannot be cut into words.
    """
    registers = Registers()
    return lines_cut(text, lambda number, line: _block(number, line, registers), LONGEST_LINE)


def _block(number, line, registers):
    code, comment = _split(line)
    block = Block(number, line, comments=(comment,) if comment else ())
    code = code.upper().strip()
    if HEADER.fullmatch(code):
        return block
    refuse_block_delete(code)
    code = re.sub(r"^N\d+\s*", "", code)
    if registers.assign(code):
        return block
    said = _said(code, registers)
    return block._replace(words=(said,)) if any(said) else block


def _split(line):
    """(code, comment) at the first semicolon outside quotes."""
    parts = re.match(r'((?:[^;"]|"[^"]*")*)(?:;(.*))?$', line)
    if not parts:
        raise Complaint('a " without its fellow', "close the text that it begins")
    return parts[1], parts[2]


def _said(code, registers):
    codes, values, keywords, swivel, drilling, at = [], {}, [], (), (), 0
    while at < len(code):
        if code[at].isspace():
            at += 1
            continue
        if found := MESSAGE.match(code, at):
            pass
        elif found := SWIVEL.match(code, at):
            keywords.append("CYCLE800")
            swivel = tuple(part.strip() for part in found[1].split(",")) if found[1].strip() else ()
        elif found := DRILLING.match(code, at):
            drilling = found[1], tuple(registers.value(t) if t.strip() else None for t in found[2].split(","))
        elif found := COMPUTED.match(code, at):
            _put(values, found[1], registers.value(found[2]))
        elif found := NAMED.match(code, at):
            _put(values, found[1], _value(*found.groups()))
        elif found := WORD.match(code, at):
            letter, value = found[1], float(found[2])
            if letter not in LETTERS:
                raise Complaint(f'unknown word "{letter}"', "known here are N " + " ".join(sorted(LETTERS)))
            if letter in "GM":
                codes.append((letter, value))
            else:
                _put(values, letter, value)
        elif (found := KEYWORD.match(code, at)) and found[1] in KEYWORDS:
            keywords.append(found[1])
        else:
            raise Complaint(f'"{code[at:]}" is no word that this reader knows',
                            f"known are letters with numbers, {', '.join(KEYWORDS)}, CYCLE800, MSG, and with = {', '.join(NAMES)}")
        at = found.end()
    if "CYCLE800" in keywords and (codes or values or len(keywords) > 1):
        raise Complaint("CYCLE800 beside other words", "give it a block of its own")
    if drilling and (codes or values or keywords):
        raise Complaint(f"{drilling[0]} beside other words", "give it a block of its own, without MCALL")
    return Said(tuple(codes), values, tuple(keywords), swivel, drilling)


def _put(values, name, value):
    if name not in NAMES:
        raise Complaint(f'unknown name "{name}"', f"known are {', '.join(NAMES)}")
    if name in values:
        raise Complaint(f"two {name} words", "leave one of them")
    values[name] = value


def _value(name, number, text):
    """A number; a tool's name that is one."""
    if number is not None:
        return float(number)
    if name == "T" and text.isdigit():
        return float(text)
    raise Complaint(f'{name}="{text}"', "tools are known by their numbers: write T=\"3\" or T3")
