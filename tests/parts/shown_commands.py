"""The commands that README and docs/ show."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", "pipeline/app/repository/README.md",
         *sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))]
PREFIX, WORDS = r"(?:\.venv/bin/)?cuspline ", r"((?:--)?[a-z][^`{end}]*)"
COMMAND = re.compile(f"^    {PREFIX}{WORDS.format(end=chr(10))}$|`{PREFIX}{WORDS.format(end='')}`", re.M)
LEFT_TO_THE_READER = {"...": "x", "DIR": "x"}


def commands_shown(name):
    """(words behind `cuspline`, whether arguments are shown) of every command on a page; a name alone is a mention."""
    for on_a_line, in_text in COMMAND.findall((ROOT / name).read_text()):
        words = shlex.split((on_a_line or in_text).partition(" #")[0].replace("\\|", "|"))
        yield [LEFT_TO_THE_READER.get(w, w) for w in words], len(words) > 1
