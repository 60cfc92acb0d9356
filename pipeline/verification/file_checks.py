"""Findings about files: programs that do not fit the control, its tool table, files that are not those published."""

import re
from functools import partial
from pathlib import Path

from cuspline.design.job import digest_of, job_line
from cuspline.program.sub_blocks import sub_blocks_of
from cuspline.values.errors import InputError
from cuspline.values.findings import Finding
from cuspline.values.input_files import refuse_irregular, sha256_of

_finding = partial(Finding, amount_mm=0.0, place_mm=None, operation="", line=0, setup="")
JOB_LINE = re.compile(rb"(JOB SHA-256 [0-9a-f]+)")


def program_findings(name, text, setup, machine):
    """A program larger than the control's store, or with lines longer than it takes.

    Args:
        name: of the file.   text: as read.   setup: its name.   machine: machines.Machine.
    """
    size, room = len(text.encode()), machine.control.program_store_bytes
    if size > room:
        yield _finding(kind="program_too_long",
                       advice=f"{name} has {size} bytes, the program memory of {machine.name} holds {room}: raise "
                       "the scallop height, or feed it through the control's buffer", setup=setup)
    lines, most = text.split("\n"), machine.control.program_store_sub_blocks
    if most is not None and (count := sub_blocks_of(lines)) > most:
        yield _finding(kind="program_too_long",
                       advice=f"{name} has up to {count} sub-blocks, the program memory of {machine.name} holds {most}: raise "
                       "the scallop height, or feed it through the control's buffer", setup=setup)
    longest = max(range(len(lines)), key=lambda k: len(lines[k]))
    if len(lines[longest]) > machine.control.line_length:
        yield _finding(kind="line_too_long",
                       advice=f"{name}: {machine.name} takes {machine.control.line_length} characters a line: "
                       "split the block", setup=setup, line=longest + 1, block=lines[longest][:60],
                       amount=float(len(lines[longest])), unit="characters")


def tool_table_findings(folder, tools, name, read):
    """Tools that the table which the control loads has otherwise than tools.json, or not at all.

    Args:
        folder: with the table.   tools: {number: cutters.Tool} that the programs are judged with.
        name: of the table's file; None: the control loads none, the operator keys in what tools.json says.
        read: function (text) -> [posted.PostedTool].
    """
    if name is None:
        return
    path = Path(folder) / name
    refuse_irregular(path, "tool table")
    if not path.exists():
        yield _finding(kind="wrong_tool_table",
                       advice=f"{name} is missing: the control would cut with the lengths of another job; "
                       "put it back, or build again")
        return
    try:
        rows = read(path.read_bytes().decode("ascii", "replace"))
    except InputError as error:
        yield _finding(kind="wrong_tool_table", advice=f"{name}: {error}", line=int(error.rows[0]))
        return
    for number, tool in sorted(tools.items()):
        wanted = {**dict(zip("XYZ", tool.offset_mm)), "D": tool.cutter.diameter_mm}
        mine = [row for row in rows if row.number == number]
        if not mine:
            yield _finding(kind="wrong_tool_table", advice=f"{name} has no T{number}, which the programs are judged with: add it, "
                           "or build again")
        for row in mine:
            yield from _differing(row, number, wanted, name)


def _differing(row, number, wanted, name):
    """The first value of a table's row that is not the tool's."""
    for letter in ("Z", "D", *sorted(row.values_mm.keys() | {"X", "Y"})):
        there, right = row.values_mm.get(letter, 0.0), wanted.get(letter, 0.0)
        if abs(there - right) > row.step_mm:
            yield _finding(kind="wrong_tool_table", advice=f"{name} gives T{number} {letter} {there:.6g} mm, tools.json "
                           f"{right:.6g} mm: measure the tool, correct the one that is wrong, and build again",
                           line=row.line, block=f"{name}: {row.text}", amount_mm=round(abs(there - right), 6))
            return


def changed_files(folder, published):
    """One finding each file that is missing, or is not what its SHA-256 says.

    Args:
        published: job.Published.
    """
    for name, wanted in sorted(published.files.items()):
        path = Path(folder) / name
        if not path.is_file():
            yield _finding(kind="changed_file", advice=f"{name} was published and is missing: put it back, or build again")
        elif (now := sha256_of(path)) != wanted:
            yield _finding(kind="changed_file", advice=f"{name} is not the file that was published: its SHA-256 begins {now[:12]}, "
                           f"the manifest has {wanted[:12]}; put it back, build again, or accept changed_file by name")


def changed_job(folder, job, published):
    """One finding each field of the manifest's job that is not what was published, or one for the job as a whole.

    Args:
        job: Job, whose programs are looked at.
        published: job.Published.
    """
    mend = "put manifest.json back, build again, or accept changed_file by name"
    wrong = [name for name in sorted(published.job_fields.keys() | published.job.keys())
             if name in published.job_fields.keys() ^ published.job.keys()
             or digest_of(published.job[name]) != published.job_fields[name]]
    if published.job_fields and wrong:
        for name in wrong:
            yield _finding(kind="changed_file", advice=f"manifest.json: what its job says of {name} is not what was published: "
                           f"{mend}")
        return
    wanted = job_line(digest_of(published.job)).encode()
    for name in job.program_names:
        path = Path(folder) / name
        said = JOB_LINE.search(path.read_bytes()) if path.is_file() else None
        if said[1] != wanted if said else path.is_file() and published.job_fields:
            yield _finding(kind="changed_file", advice=f"manifest.json: its job is not the one that {name} was posted for, by the "
                           f"program's header: {mend}")


def own_acceptances(folder, job, published):
    """Kinds of finding that the job itself accepts; none where it is not the job that was published."""
    return () if any(changed_job(folder, job, published)) else job.accepted
