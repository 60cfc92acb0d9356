"""A posted program that begins at one of its restart points, in any dialect that the posts write.

    head                                kept
    (OPERATION 1 ...)                   left out, but for the sub-programs that it defines
    (OPERATION 2 ...) tool, registers   kept
    N2001 ... calls                     left out
    N2002 ... calls                     kept, to the end
"""

import re

from cuspline.values.errors import InputError

OPERATION = re.compile(r"\(OPERATION (\d+):")
SUB = re.compile(r"o\d+ sub")
POINT = re.compile(r"N(\d+)(?: #|$)")


def restart_points(text):
    """Block numbers of the restart points, in the order in which they stand.

    >>> restart_points("N1001 #107=0\\no8001 call [1]\\nN1002 #107=25\\n")
    [1001, 1002]
    """
    return [int(found[1]) for found in map(POINT.match, text.splitlines()) if found]


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
