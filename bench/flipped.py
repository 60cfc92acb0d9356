"""A flipped propeller whose second clamping is off: cut as its dimples were measured, and as if nobody had measured them.

`python bench/flipped.py name=value ...` builds with other parameters.  `python bench/flipped.py FOLDER MEASURED` takes what stands
built: as designed, and with `--measured FOLDER-measured.csv`, which `python bench/flipped.py FOLDER` writes.
`python bench/flipped.py motion name=value ...` builds nothing: where the second side comes to by the fit of its dimples alone,
touched a hundred times.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from blade import SMALL

from cuspline.app.build import DRAFT_OPTIONS
from cuspline.app.catalogue import find_design, make_design
from cuspline.app.judge import begun
from cuspline.design.job import read_job
from cuspline.design.setup_alignment import COLUMNS, refixtured
from cuspline.designs.propellers import cutting
from cuspline.kernel import brep
from cuspline.surfaces.curvature import sample_faces
from cuspline.values.errors import InputError
from cuspline.values.frames import Frame
from cuspline.verification.setup_mismatch import joints

SHIFT_MM, TURN_RAD = (0.3, -0.2, 0.15), np.radians([0.05, -0.03, 0.1])      # of the part, on the machine
FINISHED_MM = 0.5, 0.03             # what stands higher: skin; what one side has cut in part for the other
LEAST_MM2 = 1.0
NOISE_MM, SEED = 0.002, 17          # of a coordinate that is touched, root mean square
TOUCHED = 100                       # times
MISTYPED_MM = 1.0


def measure(parameters=(*SMALL, "profile_tolerance_mm=0.0025", "sides=flipped")):
    """[(what, number, unit)]."""
    with tempfile.TemporaryDirectory() as folder:
        designed, measured = Path(folder) / "designed", Path(folder) / "measured"
        words = [word for p in parameters for word in ("-p", p)]
        _built(designed, words)
        _built(measured, [*words, "--measured", written(designed)])
        return figures(designed, measured)


def motion(parameters):
    """[(what, number, unit)] of how far the second side's cuts are off on blade 1, by the rigid motion alone."""
    cutting._ways = lambda design, p, balls, clampings: [[np.array(c.z)] for c in clampings]       # directions take a minute
    design = make_design(find_design("dtmb_4119"), [*parameters, "blades_cut=one", "sides=flipped"])
    setup = next(s for s in design.setups if s.markers)
    faces = brep.faces_of(brep.the_solid(design.solid, "propeller"))
    mine = brep.indices_of(faces, brep.named_faces(faces, design.predicates, setup.faces))
    places, lies = sample_faces(faces, mine, across_axis=2).point_mm, _touched_setup(setup, 0.0)
    real = Frame(rotation=_turned(TURN_RAD), origin_mm=SHIFT_MM)
    off = lambda as_set: float(np.linalg.norm(setup.clamped_frame.out(real.into(as_set.clamped_frame.into(places))) - places,
                                              axis=1).max())
    found, refused = [], 0
    for seed in range(TOUCHED):
        try:
            found.append(off(refixtured(setup, _touched_setup(setup, NOISE_MM, seed), places)))
        except InputError:
            refused += 1
    names = list(lies)
    wrong = sum(_names_it(setup, lies, name, axis) for name in names for axis in range(3))
    return [("as if nobody had measured: the farthest place of blade 1 is off by", 1e3 * off(setup), "um"),
            ("as its dimples are measured exactly", 1e3 * off(refixtured(setup, lies)), "um"),
            (f"as they are measured within {1e3 * NOISE_MM:g} um a coordinate, on average", 1e3 * np.mean(found), "um"),
            ("the worst of them", 1e3 * np.max(found), "um"), (f"refused of {TOUCHED}", refused, ""),
            (f"dimples mistyped by {MISTYPED_MM:g} mm that are refused by their name, of {3 * len(names)}", wrong, "")]


def _names_it(setup, lies, name, axis):
    """Whether one marker mistyped along an axis is refused, and named."""
    wrong = {n: tuple(x + MISTYPED_MM * (n == name and k == axis) for k, x in enumerate(p)) for n, p in lies.items()}
    try:
        refixtured(setup, wrong)
    except InputError as error:
        return f"marker {name} is" in str(error)
    return False


def _built(out, words):
    command = Path(sys.executable).with_name("cuspline")
    subprocess.run([command, "build", "dtmb_4119", "--out", out, *words], check=True, stdout=subprocess.DEVNULL)


def written(folder):
    """The CSV of markers as they are touched on the part as it lies, with NOISE_MM; beside the folder."""
    path = folder.with_name(f"{folder.name}-measured.csv")
    rows = [(*key, *place) for key, place in _touched(read_job(folder), NOISE_MM).items()]
    path.write_text("\n".join([",".join(COLUMNS), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def figures(designed, measured):
    """What first looks at both folders' programs find on the part as it really lies."""
    lies = {}
    for (setup, marker), place in _touched(read_job(designed), 0.0).items():
        lies.setdefault(setup, {})[marker] = place
    far = max(s.setup.refixturing.far_error_mm for s in read_job(measured).posted if s.setup.refixturing)
    rows = [("farthest place of the blade known to, as the fit tells", far * 1e3, "um")]
    for what, folder in (("as its dimples were measured", measured), ("as if nobody had measured", designed)):
        look = begun(folder, read_job(folder).placed(lies), options=DRAFT_OPTIONS)
        rows += [row for within_mm in FINISHED_MM
                 for row in _mismatch(f"{what}, both sides within {within_mm:g} mm", look.first, within_mm)]
        findings = look.drafted().findings
        deepest = {kind: max(f.amount_mm for f in findings if f.kind == kind) for kind in sorted({f.kind for f in findings})}
        kinds = ", ".join(f"{kind} {amount:.4f} mm" for kind, amount in deepest.items())
        rows.append((f"{what}: findings" + (f" ({kinds})" if kinds else ""), len(findings), ""))
    return rows


def _mismatch(what, first, finished_mm):
    """Rows of the steps between the two sides, where each alone leaves no more than so much."""
    steps = joints([c.name for c in first.clampings], [own for _, own in first.residuals],
                   [len(found.samples) for found, _ in first.residuals], finished_mm=finished_mm,
                   fade_mm=float(np.sqrt(2.0 * first.part.largest_radius_mm * finished_mm)))
    between = [s for found in steps for s in found if s["setup"].split("-")[0] != s["with"].split("-")[0]]
    area = sum(s["area_mm2"] for s in between)
    mean = sum(abs(s["step_mean_mm"]) * s["area_mm2"] for s in between) / area if between else np.nan
    most = max((abs(s["step_max_mm"]) for s in between if s["area_mm2"] >= LEAST_MM2), default=np.nan)
    return [(f"{what}: mean step over {area:.3g} mm2", 1e3 * mean, "um"),
            (f"{what}: most between lowest points, {LEAST_MM2:g} mm2 or more shared", 1e3 * most, "um")]


def _touched(job, noise_mm):
    """{(setup, marker): place in the WCS} of the part as it really lies."""
    first = next(p.setup for p in job.posted if p.setup.markers)
    return {(first.name, name): place for name, place in _touched_setup(first, noise_mm).items()}


def _touched_setup(setup, noise_mm, seed=SEED):
    """{marker: place in the WCS} of one setup, as the part really lies."""
    rng, lies = np.random.default_rng(seed), Frame(rotation=_turned(TURN_RAD), origin_mm=SHIFT_MM)
    places = lies.out(setup.clamped_frame.into(np.array([m.at_mm for m in setup.markers])))
    return {m.name: tuple((place + noise_mm * rng.normal(size=3)).tolist()) for m, place in zip(setup.markers, places)}


def _turned(rad):
    """(3, 3) about X, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rad), np.sin(rad)
    return (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ [[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]
            @ [[1, 0, 0], [0, cx, -sx], [0, sx, cx]])


if __name__ == "__main__":
    folders = [Path(a) for a in sys.argv[1:] if Path(a).is_dir()]
    if len(folders) == 1:
        print(written(folders[0]))
        sys.exit()
    if sys.argv[1:2] == ["motion"]:
        rows = motion(sys.argv[2:])
    else:
        rows = figures(*folders) if folders else measure(*([tuple(sys.argv[1:])] if sys.argv[1:] else []))
    for what, number, unit in rows:
        print(f"{what}: {number:.5g} {unit}", flush=True)
