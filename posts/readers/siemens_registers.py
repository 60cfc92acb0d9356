"""R-parameters of a Sinumerik program: what blocks assign to them, and values computed from them.

Without jumps and loops, which the reader refuses, blocks run in the order in which they stand.
"""

import re

from cuspline.posts.readers.rs274_expressions import Complaint

TOKEN = re.compile(r"\s*(?:(\d+\.?\d*|\.\d+)|R(\d+)|([-+*/()]))")
ASSIGNED = re.compile(r"R(\d+)\s*=\s*((?:(?!R\d+\s*=)[-+*/(). R\d])+)")


class Registers:
    """R-parameters that the text has assigned so far."""

    def __init__(self):
        self.values = {}

    def assign(self, code):
        """Take a block that is assignments alone; False: it is none.

        Raises:
            Complaint: it assigns and says something else, too.
        """
        if not re.match(r"R\d+\s*=", code):
            if re.search(r"(?<![A-Z])R\d+\s*=", code):
                raise Complaint("an R-parameter assigned beside other words", "give it a block of its own")
            return False
        at = 0
        while at < len(code):
            found = ASSIGNED.match(code, at)
            if not found:
                raise Complaint(f'"{code[at:]}" beside an R-parameter', "give assignments a block of their own: R1=5 R2=R1*2")
            self.values[int(found[1])] = self.value(found[2])
            at = found.end()
        return True

    def value(self, text):
        """Of numbers, R-parameters, + - * / and brackets.

        >>> registers = Registers()
        >>> registers.assign("R1=4 R2=R1*(R1-1)"), registers.value("-R2/3 + .5")
        (True, -3.5)
        """
        tokens, at = [], 0
        text = text.strip()
        while at < len(text):
            found = TOKEN.match(text, at)
            if not found:
                raise Complaint(f'"{text}" cannot be computed', "write numbers, R-parameters, + - * / and ( )")
            tokens.append(found[3] or (float(found[1]) if found[1] else self._held(int(found[2]))))
            at = found.end()
        result = _sum(tokens, text)
        if tokens:
            raise _unreadable(text)
        return result

    def _held(self, number):
        if number not in self.values:
            raise Complaint(f"R{number} has no value from this program: nobody knows what another one left in it",
                            f"assign it before: R{number}=0")
        return self.values[number]


def _unreadable(text):
    return Complaint(f'"{text}" cannot be computed', "close brackets, and put one sign between two numbers")


def _sum(tokens, text):
    total = _product(tokens, text)
    while tokens and tokens[0] in ("+", "-"):
        sign = 1.0 if tokens.pop(0) == "+" else -1.0
        total += sign * _product(tokens, text)
    return total


def _product(tokens, text):
    total = _single(tokens, text)
    while tokens and tokens[0] in ("*", "/"):
        operator, factor = tokens.pop(0), _single(tokens, text)
        if operator == "/" and factor == 0.0:
            raise Complaint(f'"{text}" divides by nothing', "correct the R-parameter")
        total = total * factor if operator == "*" else total / factor
    return total


def _single(tokens, text):
    """A number, one with a sign, or what is in brackets."""
    if not tokens:
        raise _unreadable(text)
    token = tokens.pop(0)
    if token in ("+", "-"):
        return _single(tokens, text) * (1.0 if token == "+" else -1.0)
    if token == "(":
        value = _sum(tokens, text)
        if not tokens or tokens.pop(0) != ")":
            raise _unreadable(text)
        return value
    if isinstance(token, str):
        raise _unreadable(text)
    return token
