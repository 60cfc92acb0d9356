"""Program numbers of controls that call their programs O0101: the setup's hundred and the number of the file."""

import re

from cuspline.posts.writers.sub_programs import FIRST_SUB
from cuspline.values.errors import PostError

FILES_A_SETUP = 100


def program_number(program, file_number):
    """The number of a file of a program's set.

    Args:
        program: program.Program, its setup named as "setup-2".   file_number: from 1.
    Raises:
        PostError: none is left below those of sub-programs.

    >>> from types import SimpleNamespace
    >>> program_number(SimpleNamespace(setup="setup-2"), 3)
    203
    """
    setup = re.search(r"(\d+)$", program.setup)
    number = FILES_A_SETUP * int(setup[1] if setup else 1) + file_number
    if file_number >= FILES_A_SETUP or number >= FIRST_SUB:
        raise PostError(f"{program.setup}: no program number below O{FIRST_SUB} is left for file {file_number}; "
                        "number setups below 70 and keep a set below 100 files")
    return number
