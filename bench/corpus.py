"""The corpus: parts that nobody has tuned anything for, each built once with default settings.

Every case of `corpus_parts.FAMILIES` is written as a stranger would hand it in and built by the command line's own
function, in a process of its own with limits of time; what came of it is one line of a table, which goes on after a stop:

    python bench/corpus.py                    all cases that are not in bench/corpus.csv yet, then the table in RESULTS.md
    python bench/corpus.py family [number]    those cases, again
    python bench/corpus.py failures           what was not verified, again
    python bench/corpus.py keep CASE FOLDER   one case, its files and outputs kept in a folder, told as it goes
    python bench/corpus.py table              what is known so far into RESULTS.md
"""

import contextlib
import csv
import io
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import corpus_parts
from peers import HERE

KNOWN = Path(os.environ.get("CORPUS_CSV", HERE / "corpus.csv"))
A_FAMILY = 6                    # cases of each, at least one a strategy
REFUSALS = 2                    # of what holds no single solid
LONGEST_CPU_S, LONGEST_S = 900, 3600
VERIFIED, REFUSED, REJECTED, FAULT, HUNG = "verified", "refused", "rejected", "fault", "hung"
CLASSES = {0: VERIFIED, 1: REJECTED, 2: REFUSED}
TOLD = 500                      # characters of what was said
FALSE = re.compile(r"brute force: (\d+) of (\d+) false; ")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a case."""

    case: str
    family: str
    number: int
    strategy: str
    verdict: str
    rounds: str                 # of correction: by the planner's own check + by the verdict
    cpu_s: float
    peak_mb: float
    told: str                   # the sentence of a refusal, the findings of a rejection


def cases():
    """(family, number, strategy) of all cases, a family after the other in every round."""
    rows = []
    for name, (_, strategies) in corpus_parts.FAMILIES.items():
        count = REFUSALS if name in corpus_parts.WITHOUT_A_SOLID else max(A_FAMILY, len(strategies))
        rows += [(k, name, strategies[k % len(strategies)]) for k in range(count)]
    return [(name, number, strategy) for number, name, strategy in sorted(rows, key=lambda row: row[0])]


def outcome_of(family, number, strategy, folder):
    """Build one case in a process of its own; its Outcome.  Its files and outputs stay in the folder."""
    begin = time.monotonic()
    child = os.fork()
    if child == 0:
        _build(family, number, strategy, Path(folder))
    status, usage = _ended(child, begin + LONGEST_S)
    case, said = corpus_parts.case_name(family, number, strategy), _said(folder).replace(f"{folder}/", "")
    code = os.waitstatus_to_exitcode(status)
    verdict = CLASSES.get(code, HUNG if code in (-signal.SIGXCPU, -signal.SIGKILL) else FAULT)
    return Outcome(case=case, family=family, number=number, strategy=strategy or "default", verdict=verdict,
                   rounds=_rounds(Path(folder)), cpu_s=round(usage.ru_utime + usage.ru_stime, 1),
                   peak_mb=round(usage.ru_maxrss / 1024), told="" if verdict == VERIFIED else said[:TOLD])


def _build(family, number, strategy, folder):
    """In the child: write the case, build it, end."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_CPU_S, LONGEST_CPU_S))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name, stream in (("said.txt", 1), ("told.txt", 2)):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), stream)
    sys.stdout, sys.stderr = (io.TextIOWrapper(open(n, "wb", 0), write_through=True) for n in (1, 2))
    os.environ["CUSPLINE_DEBUG"] = "1"
    code = 3
    with contextlib.suppress(BaseException):
        from cuspline.app import cli
        path = corpus_parts.write_case(family, number, strategy, folder)
        code = cli.run(["build", str(path), "--out", str(folder / "out"), "--stage", "verify"])
    os._exit(code)


def _ended(child, until):
    """(status, resource usage) of a child that ends by itself or is ended with all it began."""
    while time.monotonic() < until:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return status, usage
        time.sleep(0.2)
    os.killpg(child, signal.SIGKILL)
    _, status, usage = os.wait4(child, 0)
    return status, usage


def _said(folder):
    """The sentence of a refusal or a fault; else the findings, how many of each kind and the first of each."""
    said, told = ((Path(folder) / name).read_text(errors="replace") for name in ("said.txt", "told.txt"))
    if "cuspline: " in told:
        return told[told.index("cuspline: ") + len("cuspline: "):].strip()
    path = next(Path(folder).glob("out-rejected/verify.json"), None)
    if path is None:
        return said.strip() or told.strip()[-TOLD:]
    findings = json.loads(path.read_text())["findings"]
    kinds, held = {}, _brute_force(path.parent)
    for f in findings:
        kinds.setdefault(f["kind"], []).append(f)
    told = "; ".join(f"{len(rows)} {kind} ({rows[0]['amount_mm']}): {rows[0]['advice']}" for kind, rows in kinds.items())
    return f"{held}{told}"[:TOLD]


def _brute_force(folder):
    """`brute force: 1 of 3 false; `, of the findings that it can judge; "" where there are none."""
    done = subprocess.run([sys.executable, HERE / "brute_force.py", folder], capture_output=True, text=True)
    words = [line.rsplit(": ", 1)[1] for line in done.stdout.splitlines()]
    if done.returncode:
        return f"brute force: {done.stderr.strip().splitlines()[-1]}; "
    return f"brute force: {words.count('false')} of {len(words)} false; " if words else ""


def _rounds(folder):
    path = next(folder.glob("out*/plan.json"), None)
    if path is None:
        return ""
    found = [m["found_by"] for s in json.loads(path.read_text())["setups"] for m in s["mending"]]
    judged = sum(by == "the verdict" for by in found)
    return f"{len(found) - judged}+{judged}"


def known():
    """{case: Outcome} of the table on disk; the last line of a case counts."""
    if not KNOWN.exists():
        return {}
    with open(KNOWN, newline="") as file:
        rows = list(csv.DictReader(file))
    kinds = {f.name: f.type for f in fields(Outcome)}
    return {r["case"]: Outcome(**{k: kinds[k](v) for k, v in r.items()}) for r in rows}


def noted(outcome):
    """Append a line to the table on disk."""
    is_new = not KNOWN.exists()
    with open(KNOWN, "a", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Outcome)])
        if is_new:
            writer.writeheader()
        writer.writerow(asdict(outcome))


def run(rows, say=print):
    """Build cases one after the other and note what came of them."""
    from cuspline.app import build, cli  # noqa: F401       what is imported here no child imports anew
    for family, number, strategy in rows:
        with tempfile.TemporaryDirectory(prefix="cuspline-corpus-") as folder:
            found = outcome_of(family, number, strategy, folder)
        noted(found)
        say(line_of(found))


def line_of(o):
    """One case in words."""
    told = re.sub(r"\s+", " ", o.told)
    return f"{o.case}: {o.verdict}, {o.rounds or '-'} rounds, {o.cpu_s:g} s, {o.peak_mb:g} MB{': ' if told else ''}{told}"


def table():
    """Lines for RESULTS.md."""
    found = known()
    rows = [found[name] for name in (corpus_parts.case_name(*c) for c in cases()) if name in found]
    parts = [r for r in rows if r.family not in corpus_parts.WITHOUT_A_SOLID]
    count = lambda verdict: sum(r.verdict == verdict for r in parts)
    share = 100 * count(VERIFIED) / max(len(parts), 1)
    everything = sum(name not in corpus_parts.WITHOUT_A_SOLID for name, _, _ in cases())
    lines = [f"{len(parts)} of {everything} cases, of {len({r.family for r in parts})} families: {count(VERIFIED)} verified at "
             "the first try "
             f"({share:.1f} %), {count(REFUSED)} refused, {count(REJECTED)} rejected, {count(FAULT)} faults, {count(HUNG)} "
             f"beyond {LONGEST_CPU_S} CPU s.  {_false_findings(rows)}Of {len(rows) - len(parts)} that hold no single solid "
             f"{sum(r.verdict == REFUSED for r in rows if r.family in corpus_parts.WITHOUT_A_SOLID)} were refused.  "
             "Rounds: of the planner's own check + of the verdict.", "",
             "| part | strategy | verdict | rounds | CPU s | MB | told |", "|---|---|---|---|---|---|---|"]
    tidy = lambda text: re.sub(r"\s+", " ", text).replace("|", "/")
    lines += [f"| {r.family} {r.number} | {r.strategy} | {r.verdict} | {r.rounds} | {r.cpu_s:.0f} | {r.peak_mb:.0f} | "
              f"{tidy(r.told)} |" for r in sorted(rows, key=lambda r: (r.family, r.number))]
    return lines


def _false_findings(rows):
    counts = [FALSE.match(r.told) for r in rows if r.verdict == REJECTED]
    false, judged = (sum(int(c[k]) for c in counts if c) for k in (1, 2))
    return f"Of {judged} findings of gouge or excess {false} are false by brute force (`bench/brute_force.py`).  "


def _write_results():
    from run import RESULTS, machine, own_versions, with_section
    head = ["## Corpus: parts that nothing was tuned for (`make corpus`)", "", f"Machine: {machine()}. {own_versions()}.", ""]
    RESULTS.write_text(with_section(RESULTS.read_text(), "corpus", head + table()))


def main(arguments):
    everything, done = cases(), known()
    if arguments == ["table"]:
        _write_results()
    elif arguments[:1] == ["keep"]:
        family, number, strategy = next(c for c in everything if corpus_parts.case_name(*c) == arguments[1])
        Path(arguments[2]).mkdir(parents=True, exist_ok=True)
        print(line_of(outcome_of(family, number, strategy, arguments[2])))
    elif arguments == ["failures"]:
        run([c for c in everything if (o := done.get(corpus_parts.case_name(*c))) and o.verdict != VERIFIED])
    elif arguments:
        number = int(arguments[1]) if arguments[1:] else None
        run([c for c in everything if c[0] == arguments[0] and number in (None, c[1])])
    else:
        run([c for c in everything if corpus_parts.case_name(*c) not in done])
        _write_results()


if __name__ == "__main__":
    main(sys.argv[1:])
