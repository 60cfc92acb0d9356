"""Values in RS-274 text: numbers, #parameters, + - * / in brackets, and SQRT[...].

A value read here is a float, or a function of the parameters that are set when its block is executed.
"""

import math
import operator
import re

from cuspline.values.errors import ReadError

NUMBER = re.compile(r"\d+\.?\d*|\.\d+")
SUMS = {"+": operator.add, "-": operator.sub}
PRODUCTS = {"*": operator.mul, "/": operator.truediv}


class Complaint(ReadError):
    """What is wrong and how to mend it; the reader adds the line and its text."""

    def __init__(self, what, mend):
        super().__init__(f"{what}; {mend}")


class Scanner:
    """A place in a block whose blanks are gone and whose letters are lower case."""

    def __init__(self, code):
        self.code, self.at = code, 0

    @property
    def next(self):
        """The character that comes next; "" at the end."""
        return self.code[self.at:self.at + 1]

    def take(self, character):
        """Step over that character, if it comes next."""
        found = self.next == character
        self.at += found
        return found

    def expect(self, character):
        """Step over that character; anything else is a complaint."""
        if not self.take(character):
            raise Complaint(f'"{character}" expected, "{self.code[self.at:]}" found', "write it there")

    def number(self):
        """Step over a number without sign."""
        found = NUMBER.match(self.code, self.at)
        if not found:
            raise Complaint(f'a number expected, "{self.code[self.at:]}" found',
                            "write digits, #parameter, an expression of + - * / in brackets, or SQRT[...]")
        self.at = found.end()
        return float(found[0])


def value_at(scanner):
    """The number, #parameter, signed value or [expression] that comes next."""
    if scanner.take("-"):
        return _joined(operator.sub, 0.0, value_at(scanner))
    if scanner.take("+"):
        return value_at(scanner)
    if scanner.take("#"):
        return _parameter(value_at(scanner))
    if scanner.code.startswith("sqrt[", scanner.at):
        scanner.at += len("sqrt")
        return _root(value_at(scanner))
    if scanner.take("["):
        inside = _sum_at(scanner)
        scanner.expect("]")
        return inside
    return scanner.number()


def _sum_at(scanner):
    return _chain_at(scanner, SUMS, lambda: _chain_at(scanner, PRODUCTS, lambda: value_at(scanner)))


def _chain_at(scanner, operators, part):
    value = part()
    while scanner.next in operators:
        operate = operators[scanner.next]
        scanner.at += 1
        value = _joined(operate, value, part())
    return value


def _joined(operate, left, right):
    def value(parameters):
        try:
            return operate(evaluated(left, parameters), evaluated(right, parameters))
        except ZeroDivisionError:
            raise Complaint("a division by zero", "check the parameters of this call") from None
    return value


def _root(inside):
    def value(parameters):
        number = evaluated(inside, parameters)
        if number < 0:
            raise Complaint(f"the square root of {number:g}", "check the parameters of this call")
        return math.sqrt(number)
    return value


def _parameter(number):
    def value(parameters):
        index = parameter_index(evaluated(number, parameters))
        try:
            return parameters[index]
        except KeyError:
            raise Complaint(f"#{index} is read before it is set", "set it first, or pass it to the call") from None
    return value


def parameter_index(number):
    """The number of a parameter that a program may use freely: 1 to 5000.

    Above that LinuxCNC keeps offsets and positions, which this reader does not offer.
    """
    if number != int(number) or not 1 <= number <= 5000:
        raise Complaint(f"#{number:g} is no parameter of a program's own", "use #1 to #5000")
    return int(number)


def evaluated(value, parameters):
    """The value as a float, with the parameters as they stand."""
    return value(parameters) if callable(value) else value
