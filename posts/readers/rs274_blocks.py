"""RS-274 text cut into blocks: words, parameter settings, O-words and comments, without their meaning."""

import re
from typing import NamedTuple

from cuspline.posts.readers.rs274_expressions import Complaint, Scanner, value_at
from cuspline.values.errors import ReadError

LONGEST_LINE = 252      # LinuxCNC refuses 253: "Command too long"; a CR before the line feed is one of them
FOREIGN = re.compile(r"[^\t\r -~]")    # neither ASCII text nor a blank
WORD = re.compile(r"([a-mp-z])([+-]?(?:\d+\.?\d*|\.\d+))")
PLAIN = re.compile(rf"(?:n[\d.]+)?((?:{WORD.pattern})*)")
COMMENT = re.compile(r"\(([^()]*)\)|;(.*)")
O_WORD = re.compile(r"(?:n[\d.]+)?o(\d+|<[^<>]+>)(sub|endsub|call|return|)(.*)")
LETTERS = frozenset("xyzabcijkrpqelhfstgm")
MOST_CALLED = 2_000_000     # blocks out of sub-programs: ten hours of them, at fifty a second


class Block(NamedTuple):
    """One line of text."""

    number: int                     # from 1
    text: str
    words: tuple = ()               # (letter, value) in the order written
    settings: tuple = ()            # (parameter number, value)
    label: str = ""                 # of an O-word
    flow: str = ""                  # "sub", "endsub", "call", "return", or "%"
    arguments: tuple = ()           # of a call
    comments: tuple = ()
    call_line: int = 0              # where the main program called the sub-program that it stands in; 0 main program

    @property
    def is_blank(self):
        """Says nothing to the controller."""
        return not (self.words or self.settings or self.flow)


def blocks_of(text):
    """All lines of the text as blocks.

    Raises:
        ReadError: a line that cannot be cut into words.
    """
    return lines_cut(text, _block)


def lines_cut(text, cut, longest=None):
    """All lines of the text as the Blocks that `cut(number, line)` makes of them; its complaints get their line.

    A line ends with a line feed, as for the control; `longest`: characters that it takes, None: `cut` looks itself.
    Raises:
        ReadError: a line that cannot be cut into words.
    """
    blocks = []
    for number, line in enumerate(text.split("\n"), 1):
        try:
            refuse_foreign(line)
            if longest is not None and len(line) > longest:
                raise Complaint(f"{len(line)} characters", f"write at most {longest} a line")
            blocks.append(cut(number, line))
        except Complaint as complaint:
            raise refusal(complaint, Block(number, line)) from None
    return blocks


def refuse_foreign(line):
    """
    Raises:
        Complaint: a character that is no text.
    """
    found = None if line.isprintable() and line.isascii() else FOREIGN.search(line)
    if found:
        raise Complaint(f"character {ord(found[0])} in column {found.start() + 1} is no text",
                        "remove it: some controls end the block there, others stop")


def refusal(complaint, block):
    """The complaint with the line it is about."""
    called = f", called in line {block.call_line}" if block.call_line else ""
    return ReadError(f"line {block.number}{called}: {block.text.strip()!r}: {complaint}", rows=[block.number])


def refuse_endless_calls(count, block):
    """Calls multiply: ten in each of nine levels are a thousand million blocks, and no control comes to their end.

    Args:
        count: of the blocks out of sub-programs so far.   block: the last of them.
    """
    if count > MOST_CALLED:
        raise refusal(Complaint(f"the sub-programs called come to more than {MOST_CALLED:,} blocks",
                                "call them less often, or split the program"), block)


def refuse_block_delete(code):
    """A code that begins with / depends on a switch of the controller, whichever it is."""
    if code.startswith("/"):
        raise Complaint("block delete: what is cut would depend on a switch of the controller",
                        "remove the block, or its /")


def _block(number, line):
    if len(line) > LONGEST_LINE:
        raise Complaint(f"{len(line)} characters", f"LinuxCNC takes {LONGEST_LINE} a line: split the block")
    code, comments = _without_comments(line) if "(" in line or ";" in line else (line, ())
    code = "".join(code.split()).lower()
    plain = PLAIN.fullmatch(code)
    if plain:
        words = tuple([(letter, float(value)) for letter, value in WORD.findall(plain[1])])
        return Block(number, line, words, comments=comments)
    return _unusual_block(Block(number, line, comments=comments), code)


def _without_comments(line):
    code = COMMENT.sub(" ", line)
    if "(" in code or ")" in code:
        raise Complaint("a comment inside a comment, or one that is not closed", "every ( needs its own )")
    return code, tuple(inside for inside, _ in COMMENT.findall(line))


def _unusual_block(block, code):
    """A block with an O-word, parameters, expressions, a % or a fault."""
    if code == "%":
        return block._replace(flow="%")
    refuse_block_delete(code)
    o_word = O_WORD.fullmatch(code)
    if o_word:
        label, flow, rest = o_word.groups()
        return block._replace(label=label.lstrip("0"), flow=flow, arguments=_arguments(flow, rest))
    words, settings = _items(Scanner(re.sub(r"^n[\d.]+", "", code)))
    return block._replace(words=words, settings=settings)


def _arguments(flow, rest):
    scanner, values = Scanner(rest), []
    while flow == "call" and scanner.next == "[":
        values.append(value_at(scanner))
    if scanner.next:
        raise Complaint(f'"{scanner.code[scanner.at:]}" after the O-word',
                        "known are sub, endsub, return, and call [value] [value]...")
    return tuple(values)


def _items(scanner):
    words, settings = [], []
    while scanner.next:
        if scanner.take("#"):
            index = value_at(scanner)
            scanner.expect("=")
            settings.append((index, value_at(scanner)))
        else:
            words.append((_letter_at(scanner), value_at(scanner)))
    return tuple(words), tuple(settings)


def _letter_at(scanner):
    letter = scanner.next
    if letter not in LETTERS:
        raise Complaint(f'unknown word "{letter.upper()}"', "known are N (first in its block) and "
                        + " ".join(sorted(LETTERS)).upper())
    scanner.at += 1
    return letter
