"""A comparison of two folders of outputs in words: for a terminal, for a pull request, for other programs."""

from cuspline.app.comparison import SECTIONS
from cuspline.values.amounts import counted


def in_words(change):
    """A comparison.Change in a line."""
    if change.old is None or change.new is None:
        return f"{change.what}: " + (f"new, {_word(change.new)}" if change.old is None else f"gone, was {_word(change.old)}")
    return f"{change.what}: {_word(change.old)} -> {_word(change.new)}{_by(change.old, change.new)}"


def _word(value):
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (tuple, list)):
        return ", ".join(map(_word, value)) or "none"
    return "none" if value is None else str(value)


def _by(old, new):
    """How much more, of numbers."""
    is_number = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (old, new))
    return f" ({new - old:+.4g})" if is_number else ""


def lines_in_words(lines, files):
    """Lines of a program, of a set with the file that they begin in.

    >>> lines_in_words((12, 20), (("a.nc", 0),)), lines_in_words((112, 120), (("a-01.nc", 0), ("a-02.nc", 100)))
    ('lines 12 to 20', 'a-02.nc lines 12 to 20')
    """
    if lines is None:
        return ""
    name, before = next((name, before) for name, before in reversed(files) if lines[0] > before)
    first, last = lines[0] - before, lines[1] - before
    return (f"{name} " if len(files) > 1 else "") + (f"line {first}" if first == last else f"lines {first} to {last}")


def change_in_words(program, c):
    """A MoveChange in a sentence."""
    box = " ".join(f"{axis}{low:.3f}" if high - low < 5e-4 else f"{axis}{low:.3f} to {high:.3f}"
                   for axis, low, high in zip("XYZ", c.low_mm, c.high_mm))
    apart = "" if c.apart_mm is None else f", paths up to {c.apart_mm:.4f} mm apart"
    what = {"added": f"{counted(c.added, 'move')} added", "removed": f"{counted(c.removed, 'move')} removed",
            "moved": f"{counted(c.added, 'move')} moved{apart}",
            "replaced": f"{counted(c.removed, 'move')} replaced by {c.added}{apart}"}[c.kind]
    old, new = lines_in_words(c.old_lines, program.old_files), lines_in_words(c.new_lines, program.new_files)
    where = f"{new}, was {old}" if old and new and old != new else new or f"was {old}"
    return f"{c.operation or 'before the first operation'}: {what}, {box} ({where})"


def words(comparison, most=20):
    """{section: sentences} of what differs, in the order of SECTIONS; of a program at most so many places."""
    found = {name: [in_words(c) for c in comparison.of(name)] for name in SECTIONS}
    for p in comparison.programs:
        said = [change_in_words(p, c) for c in p.changes.changes[:most]]
        if (more := len(p.changes.changes) - most) > 0:
            gone, come = (sum(getattr(c, n) for c in p.changes.changes[most:]) for n in ("removed", "added"))
            said.append(f"and {counted(more, 'place')} more: {gone} moves gone, {come} new")
        said += [f"{name}: {counted(count, 'move')} with another feed or speed" + (f", by up to {by:g} mm/min" if by else "")
                 for name, (count, by) in p.changes.refed.items()]
        found["programs"] += [f"{p.setup}, {line}" for line in said]
    return {name: lines for name, lines in found.items() if lines}


def same_in_words(comparison):
    """What does not differ."""
    differing = words(comparison)
    return ", ".join(name for name in SECTIONS if name not in differing)


def text(comparison):
    """Lines for a terminal."""
    lines = [f"{comparison.old} -> {comparison.new}"]
    for name, said in words(comparison).items():
        lines += [f"{name}:", *(f"  {line}" for line in said)]
    same = same_in_words(comparison)
    return lines + ["the same" if comparison.is_same else f"the same: {same}"] if same else lines


def markdown(comparison, picture=None):
    """Lines for a pull request."""
    lines = [f"### {comparison.new.name}: {'the same' if comparison.is_same else 'what changed'}", ""]
    for name, said in words(comparison).items():
        lines += [f"**{name}**", "", *(f"- {line}" for line in said), ""]
    same = same_in_words(comparison)
    if picture is not None:
        lines += [f"![changed moves in plan]({picture})", ""]
    return lines + ([f"The same: {same}."] if same else [])


def as_document(comparison):
    """For --json."""
    return {"old": str(comparison.old), "new": str(comparison.new), "same": comparison.is_same,
            "changes": [{"section": c.section, "what": c.what, "old": c.old, "new": c.new} for c in comparison.changes],
            "programs": [{"setup": p.setup, "same": p.is_same, "moves": [len(p.old), len(p.new)],
                          "changes": [{"operation": c.operation, "kind": c.kind, "removed": c.removed, "added": c.added,
                                       "apart_mm": None if c.apart_mm is None else round(c.apart_mm, 6),
                                       "old_lines": c.old_lines, "new_lines": c.new_lines,
                                       "low_mm": [round(x, 6) for x in c.low_mm], "high_mm": [round(x, 6) for x in c.high_mm]}
                                      for c in p.changes.changes],
                          "other_feed_or_speed": {name: {"moves": count, "by_mm_per_min": by}
                                                  for name, (count, by) in p.changes.refed.items()}}
                         for p in comparison.programs]}
