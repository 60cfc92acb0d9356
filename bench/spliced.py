"""Faults spliced between two clear poses of a leaning program: seeded, and how many of them are found."""

import sys
import time

from peers import HERE

sys.path.append(str(HERE.parent / "tests" / "parts"))
import spliced_faults  # noqa: E402

EACH = 60           # of a kind
WORDS = {"deeper": "the tip 0.05 mm deeper somewhere in a block",
         "turned": "the axis turned by 20 degrees somewhere in a block",
         "longer": "the holder 2 mm longer in one block", "body": "a body in the holder's way only between two blocks' ends"}


def table():
    """The measured table, as lines."""
    lines, total = ["| spliced | faults | found | good blocks blamed | CPU s |", "|---|---|---|---|---|"], 0
    for kind in spliced_faults.KINDS:
        begin = time.process_time()
        made = spliced_faults.faults(kind, range(EACH))
        found, blamed = sum(f.is_found for f in made), sum(f.told_of_good_mm > 0 for f in made)
        total += found
        lines.append(f"| {WORDS[kind]} | {len(made)} | {found} | {blamed} | {time.process_time() - begin:.1f} |")
    return [*lines, "", f"{total} of {EACH * len(spliced_faults.KINDS)} found: gouges by no less than they are in closed form, the "
            f"others by no less than sampled, within {spliced_faults.SAMPLED_MM} mm."]
