"""Seeded plates with pockets, planned, posted, read back and judged: no finding may be raised, nor a plate refused.

    python bench/pockets.py FIRST LAST
"""

import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/parts")]

from built_parts import ran  # noqa: E402

from cuspline.app.judge import judge  # noqa: E402
from cuspline.design.job import read_job  # noqa: E402
from cuspline.verification.verdict import Options  # noqa: E402

PART = ROOT / "tests/parts/seeded_pockets.py"
COARSE = Options(spacing_mm=1.0, solid_pitch_mm=1.0, replay_pitch_mm=0.4, tessellation_mm=0.01)


def outcome(seed):
    """"ok", or what was found or refused, in words."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "out"
        done = ran("build", PART, "-p", f"seed={seed}", "--out", folder, "--stage", "gcode")
        if done.returncode:
            return f"refused: {done.stderr.strip().splitlines()[-1]}"
        found = judge(folder, read_job(folder), options=COARSE).findings
    return "; ".join(f"{f.kind} {f.amount_mm:.3f} at {f.place_mm} in {f.operation}, line {f.line}" for f in found) or "ok"


def main(first, last):
    """One line a seed, then how many were ok."""
    good = 0
    for seed in range(first, last + 1):
        begin = time.process_time()
        said = outcome(seed)
        good += said == "ok"
        print(f"{seed}: {said} ({time.process_time() - begin:.1f} CPU s)", flush=True)
    print(f"{good} of {last - first + 1} without a finding")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
