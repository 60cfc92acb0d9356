"""A posted program that begins at one of its operations or restart points, in any dialect that the posts write.

    head                                kept
    (OPERATION 1 ...)                   left out, but for the sub-programs that it defines
    (OPERATION 2 ...) tool, registers   kept
    N2001 ... calls                     left out
    N2002 ... calls                     kept, to the end
"""

import re

from cuspline.values.errors import InputError

OPERATION = re.compile(r"(?:\d+ )?(?:\(|; )OPERATION (\d+):")
CHANGE = re.compile(r"(?:N?\d+ )?(?:T\d+(?: M6)?|TOOL CALL \d+ .*)$")       # the tool comes in
SPEED = re.compile(r"(?:N?\d+ )?S\d+ M[34]")
SUB = re.compile(r"o\d+ sub")
POINT = re.compile(r"N(\d+)(?: #|$)")


def restart_points(text):
    """Block numbers of the restart points, in the order in which they stand.

    >>> restart_points("N1001 #107=0\\no8001 call [1]\\nN1002 #107=25\\n")
    [1001, 1002]
    """
    return [int(found[1]) for found in map(POINT.match, text.splitlines()) if found]


def operations_of(text):
    """Numbers of the operations that bring their own tool, so that a program can begin there.

    >>> operations_of("G21\\n(OPERATION 1: ROUGH, T3 FLAT)\\nT3 M6\\nS9 M3\\n(OPERATION 2: FINISH, T3 FLAT)\\nS9 M3\\nM2\\n")
    [1]
    """
    return [number for number, line, has_tool in _operations(text.splitlines()) if has_tool]


def operations_in_words(text):
    r"""{number: what its comment says} of the operations that a program can begin at.

    >>> operations_in_words("G21\n(OPERATION 1: ROUGH, T3 FLAT)\nT3 M6\nS9 M3\nM2\n")
    {1: 'ROUGH, T3 FLAT'}
    """
    lines = text.splitlines()
    return {number: lines[k].partition(f"OPERATION {number}: ")[2].removesuffix(")")
            for number, k, has_tool in _operations(lines) if has_tool}


def _operations(lines):
    """(number, index of its first line, whether its tool comes in before anything runs)."""
    begins = [(int(found[1]), k) for k, found in enumerate(map(OPERATION.match, lines)) if found]
    found = []
    for (number, k), (_, end) in zip(begins, [*begins[1:], (0, len(lines))]):
        before = next((n for n in range(k, end) if SPEED.match(lines[n])), end)
        found.append((number, k, any(CHANGE.match(line) for line in lines[k:before])))
    return found


def restarted_at_operation(text, number):
    """The program from an operation on, with everything that it needs before.

    Args:
        text: a posted program, or one file of a set.
        number: of the operation, as its comment counts.
    Raises:
        InputError: there is none, or it goes on with the tool of the one before; says where the program can begin.
    """
    lines = text.splitlines()
    operations = _operations(lines)
    begin = next((k for n, k, has_tool in operations if n == number and has_tool), None)
    if begin is None:
        known = ", ".join(f"OP{n}" for n in operations_of(text)) or "nowhere else"
        why = "goes on with the tool that is in" if number in {n for n, _, _ in operations} else "is not in this program"
        raise InputError(f"operation {number} {why}: it can begin at {known}")
    first = operations[0][1]
    return "\n".join([*lines[:first], *_sub_programs(lines[first:begin]), *lines[begin:]]) + "\n"


def restarted(text, point):
    """The program from a restart point on, with everything that it needs before.

    Args:
        text: a posted program, or one file of a set.
        point: block number, such as 2003.
    Returns:
        text.
    Raises:
        InputError: the program has no such restart point; says which it has.
    """
    lines = text.splitlines()
    begin = next((k for k, line in enumerate(lines) if (found := POINT.match(line)) and int(found[1]) == point), None)
    if begin is None:
        points = restart_points(text)
        raise InputError(f"restart point N{point} is not in this program; it has "
                         + (f"N{points[0]} to N{points[-1]}" if points else "none"))
    operations = [k for k, line in enumerate(lines) if OPERATION.match(line)]
    mine = max(k for k in operations if k < begin)
    first = next(k for k in range(mine, begin + 1) if POINT.match(lines[k]))
    return "\n".join([*lines[:operations[0]], *_sub_programs(lines[operations[0]:mine]), *lines[mine:first],
                      *lines[begin:]]) + "\n"


def _sub_programs(lines):
    """The lines from each o... sub to its endsub."""
    is_inside, kept = False, []
    for line in lines:
        is_inside |= SUB.match(line) is not None
        kept += [line] if is_inside else []
        is_inside &= not line.endswith("endsub")
    return kept
