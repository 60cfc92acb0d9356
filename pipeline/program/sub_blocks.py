"""How much of a program memory a text takes where the control counts sub-blocks: each axis word and each command is one.

A block such as X1.0 Y1.0 takes two (source 002, chapter 4: 252 kB or 42 000 of them).  What is not sure counts: every word that is
no comment.
"""


def sub_blocks_of(lines):
    """An upper bound of the sub-blocks of lines; comments, lines that begin with ( and what stands behind ;, take none.

    >>> sub_blocks_of(["LINEAR X1.0 Y1.0 F100 ; slow", "(A COMMENT)", "%"])
    5
    """
    return sum(len(line.partition(";")[0].split()) for line in lines if not line.startswith("("))
