"""Sabotages of small programs in every dialect: each told with its kind, line and amount; harmless edits stay green.

The faults and what must be said of them are in tests/parts/sabotages*.py, where more can be added.  LinuxCNC's
interpreter, where it is installed, reads every LinuxCNC text beside the reader.
"""

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(TESTS / "parts"), str(TESTS)]

import sabotages  # noqa: E402
from authorities.linuxcnc import comparison, interpreter  # noqa: E402
from sabotage_bases import bases  # noqa: E402

RESULT = ("said", "kind", "line", "amount")


def table():
    """The measured tables, as lines."""
    with tempfile.TemporaryDirectory() as folder:
        folder, begin = Path(folder), time.process_time()
        made = bases(folder / "bases")
        spoilt, edited = list(sabotages.cases(made)), list(sabotages.harmless_cases(made))
        lines = [*_by_kind(spoilt, folder), "", _asked(spoilt), "", *_harmless(edited, folder)]
        lines += ["", f"{len(made)} jobs, {sum(len(b.programs) for b in made.values())} programs; "
                  f"{time.process_time() - begin:.0f} CPU s."]
        return [*lines, "", *_beside_linuxcnc([*spoilt, *edited], folder)]


def _asked(cases):
    """Of how many a line, a call and an amount are asked at all."""
    lines = sum(c.expected.lines is not None for c in cases)
    calls = sum(bool(c.expected.calls and c.expected.calls[0]) for c in cases)
    amounts = sum(c.expected.amount is not None for c in cases)
    return (f"{len({c.what for c in cases})} kinds of sabotage. A line is asked of {lines} of {len(cases)}, the line of a "
            f"call too of {calls}, an amount of {amounts}: a refusal has none.")


def _judged(case, folder):
    with tempfile.TemporaryDirectory(dir=folder) as own:
        return sabotages.outcome(case, Path(own) / "case")


def _by_kind(cases, folder):
    tried, right = Counter(), Counter()
    for number, case in enumerate(cases, 1):
        kind, found = case.expected.kind, _judged(case, folder)
        tried[kind] += 1
        right.update((kind, name) for name, is_right in zip(
            RESULT, (found.is_found, found.is_kind, found.is_line, found.is_amount)) if is_right)
        if not found.is_right:
            print(f"NOT RIGHT: {case}: {case.expected}: {found.told}", flush=True)
        if number % 100 == 0:
            print(f"{number} of {len(cases)} sabotages", flush=True)
    rows = [f"| {kind.replace('_', ' ')} | {tried[kind]} | "
            + " | ".join(str(right[kind, name]) for name in RESULT) + " |" for kind in sorted(tried)]
    total = f"| all | {tried.total()} | " + " | ".join(str(sum(right[k, n] for k in tried)) for n in RESULT) + " |"
    return ["| what must be told | tried | something said | of this kind | in this line | this amount |",
            "|---|---|---|---|---|---|", *rows, total]


def _harmless(cases, folder):
    wrong = [(case, found.told) for case in cases if (found := _judged(case, folder)).is_found]
    for case, told in wrong:
        print(f"NOT GREEN: {case}: {told}", flush=True)
    kinds = len({case.what for case in cases})
    return [f"Harmless edits ({kinds} kinds): {len(cases)} tried, {len(cases) - len(wrong)} green."]


def _beside_linuxcnc(cases, folder):
    if interpreter.missing():
        return [f"Not compared with LinuxCNC: {interpreter.missing()}."]
    said = Counter()
    for case in filter(sabotages.is_linuxcnc_text, cases):
        word = sabotages.authority(case, folder, comparison)
        said[word if word in sabotages.AGREED else "otherwise"] += 1
        if word not in sabotages.AGREED:
            print(f"BESIDE LINUXCNC: {case}: {word}", flush=True)
    return [f"LinuxCNC's interpreter on all {said.total()} LinuxCNC texts among them: " + ", ".join(
        f"{word} {said[word]}" for word in (*sabotages.AGREED, "otherwise")) + "."]
