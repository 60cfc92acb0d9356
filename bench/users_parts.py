"""Parts as users bring them, by `Auto` alone: a plate, a flange, a mould insert; in CadQuery, in build123d, as STEP with a job.

    python bench/users_parts.py [PART [FORM]]
"""

import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/parts")]

from built_parts import ran  # noqa: E402

from cuspline.app import catalogue  # noqa: E402
from cuspline.kernel import brep  # noqa: E402

HERE = Path(__file__).parent / "users_parts"
PARTS, FORMS = ("plate", "flange", "insert"), ("cadquery", "build123d", "job")
HEAD = ("| part | form | verdict, rounds of mending | setups | program, min | gouge, highest place, mm | operations | CPU s |",
        "|---|---|---|---|---|---|---|---|")


def source_of(part, form, folder):
    """Arguments of `cuspline build` for a part; of a job file its STEP is written beside it, out of build123d's solid."""
    if form != "job":
        return HERE / f"{part}.py", "-p", f"library={form}"
    made = catalogue.make_design(catalogue.find_design(str(HERE / f"{part}.py")), {"library": "build123d"})
    brep.write_step(brep.the_solid(made.solid, part), folder / f"{part}.step", part)
    return (shutil.copy(HERE / f"{part}.toml", folder),)


def row(part, form):
    """One line of the table."""
    with tempfile.TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        source = source_of(part, form, scratch)
        begin = time.process_time()
        done = ran("build", *source, "--out", scratch / "out", "--stage", "verify")
        return told(part, form, done, scratch / "out", time.process_time() - begin)


def told(part, form, done, out, spent):
    """The line of a build.   done: what the command came to.   out: its folder, where it was published.   spent: CPU s."""
    folder = out if out.exists() else out.with_name(f"{out.name}-rejected")
    if not (folder / "verify.json").exists():
        return f"| {part} | {form} | {done.stderr.strip().splitlines()[-1]} | | | | | {spent:.0f} |"
    verdict, plan = (json.loads((folder / name).read_text()) for name in ("verify.json", "plan.json"))
    kinds = sorted({f["kind"] for s in verdict["setups"] for f in s["findings"]} | {f["kind"] for f in verdict["findings"]})
    made = [o for s in plan["setups"] for o in s["operations"]]
    said = "VERIFIED" if done.returncode == 0 and verdict["ok"] else f"REJECTED: {', '.join(kinds)}"
    rounds = sum(len(s.get("mending", ())) for s in plan["setups"])
    return (f"| {part} | {form} | {said}, {rounds} | {len(plan['setups'])} | {sum(o['time_s'] for o in made) / 60:.1f} | "
            f"{verdict['gouge_max_mm']:.4f}, {verdict['excess_max_mm']:.4f} | {', '.join(o['name'] for o in made)} | {spent:.0f} |")


def main(parts=PARTS, forms=FORMS):
    print("\n".join(HEAD), flush=True)
    for part in parts:
        for form in forms:
            print(row(part, form), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:2] or PARTS, sys.argv[2:3] or FORMS)
