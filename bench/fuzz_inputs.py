"""What is fuzzed: for each format a sound input, how it is spoilt, and the command it is handed to."""

import json
import zipfile
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Callable
from unittest import mock

from fuzz_mangling import NUMBERS, WORDS, mangled_bytes, mangled_document, mangled_text

MAIN_MM = (30.0, 16.0, 12.0)        # of the part that all jobs and programs are about
JOB = '''step = "box.step"
description = "a box"
material = "aluminium_6061"
stock = { min_mm = [0, 0, 0], max_mm = [30, 16, 13] }
finish = { scallop_mm = 0.05, profile_tolerance_mm = 0.004, gouge_mm = 0.006 }

[[faces]]
name = "top"
count = 1
normal = [0.0, 0.0, 1.0]
kinds = ["plane"]

[[setups]]
name = "setup-1"
faces = ["top"]
wcs_in_words = "corner of the block, Z0 on its base"
fixtures = [{ name = "jaw", min_mm = [0, -40, -30], max_mm = [30, 0, 4] }]
markers = [{ name = "a", at_mm = [0, 0, 0] }, { name = "b", at_mm = [30, 0, 0] }, { name = "c", at_mm = [0, 16, 0] }]

[[setups.operations]]
kind = "auto"
strategy = "parallel"
pass_angle_deg = 30.0
tool = "ball 6"
'''
GOLD = Path(__file__).parents[1] / "tests" / "gold"
PROGRAMS = {"linuxcnc": "small_program_mm.ngc", "haas": "small_program_haas.nc", "grbl": "small_program_grbl_1.nc",
            "siemens": "small_program_siemens.mpf", "heidenhain": "small_program_heidenhain.h", "pmac": "small_program_pmac.pmc"}
MARKERS = '''# touched with the probe
setup,marker,x_mm,y_mm,z_mm
setup-1,a,0.0012,-0.0007,0.0003
setup-1,b,30.0011,0.0004,0.0006
setup-1,c,0.0002,16.0009,-0.0004
'''
LINUXCNC = '''(BOX SETUP-1)
(VERDICT: NOT VERIFIED YET)
G21
G17 G90 G91.1 G94 G40 G49 G80 G92.1
G64 P0.001 Q0
G54
o101 sub
  G1 X[#1+1.5] Y#2 F#3
  G2 X[#1+3.5] Y#2 I1 J0
  #4=[#1*2]
o101 endsub
(OPERATION 1: ROUGH, T3 FLAT 10)
M5
G53 G0 Z0
T3 M6
G43 H3
S8000 M3
M8
G0 X4.5 Y5
G0 Z30
G1 Z12 F300
X20 F1200
G18
G2 X22 Z14 I1 K1
G17
G3 X22 Y5 I2 J0
#31=[12/4]
o101 call [#31] [SQRT[9]*2] [600]
G0 Z30
M5
M9
G53 G0 Z0
M2
'''
FANUC = '''%
O0001 (BOX SETUP-1)
G21
G17 G90 G94 G40 G49 G80
G54
G52 X0. Y0. Z0.
M5
G91 G28 Z0.
G90
T3 M6
G43 H3
S8000 M3
M8
G0 X4.5 Y5.
G0 Z30.
G1 Z12. F300.
X20. F1200.
G18
G2 X22. Z14. I1. K1.
G17
G3 X22. Y5. I2. J0.
#101=[12./4.]
G65 P8001 A3. B5. C600.
M98 P8002
G0 Z30.
M5
M9
G91 G28 Z0.
G90
M30
O8001
G1 X[#1+1.5] Y#2 F#3
G2 X[#1+3.5] Y#2 I1. J0.
M99
O8002
G1 X20.
M99
%
'''
CELLS = '''# a cut table
cell,V[kV],Wsyn[MeV],A10[-],Phi[deg],a[cm],m[-],B[-],L[cm],Z[cm],A0[-]
0,22,0.015,0,-90,31.4089,1,0.01,,,
1R,22,0.015,0,-90,4.1051,1,0.5854,1.8339,1.83,
2R,22,0.015,0,-90,1.6344,1,3.6931,1.8339,3.67,
3R,22,0.015,0,-90,1.0944,1,8.2373,1.8339,5.5,
4R,22,0.015,0,-90,0.9718,1,10.3675,1.8339,7.34,
5,22,0.015,0.00087,-89.92,0.9709,1.0019,10.3676,1.8347,9.17,0.9925
6,22,0.015,0.00173,-89.84,0.97,1.0038,10.3677,1.8347,11,0.9925
7,22,0.015,0.0026,-89.76,0.9691,1.0057,10.3678,1.8347,12.84,0.9925
8T,22,0.015,0,-74.35,0.9718,1,10.3688,1.2,14.04,0.9926
9F,22,,,0,,1,,1.4,15.44,
'''
PARMTEQM = '''Parmteqm 3.09, revision date 4-7-2009
IN4: a line of input
RFQ parameters for each cell
 Cell    V     Wsyn  Sig0T  Sig0L   A10     Phi     a      m       B       L        Z      A0     RFdef
   0  22  0.015  0.0 0.0 0 -90 31.4089 1 0.01
   1R 22  0.015  3.8  0  0  -90  4.1051  1  0.5854  1.8339  1.83
   2R 22  0.015  23.8  0  0  -90  1.6344  1  3.6931  1.8339  3.67
   3R 22  0.015  53.1  0  0  -90  1.0944  1  8.2373  1.8339  5.5
   4R 22  0.015  66.9  0  0  -90  0.9718  1  10.3675  1.8339  7.34
   5  22  0.015  66.8  4.5  0.00087  -89.92  0.9709  1.0019  10.3676  1.8347  9.17  0.9925  0.0008  0.0007  0.0105
   6  22  0.015  66.7  6.4  0.00173  -89.84  0.97  1.0038  10.3677  1.8347  11  0.9925  0.0017  0.0013  0.0105
   7F 22  0.1  0  1  1.4  12.4
 Cell    V     Wsyn  Sig0T  Sig0L   A10     Phi     a      m       B       L        Z      A0     RFdef
'''
RADII = '''# r_R and what belongs to it
r_R,c_D,P_D,skew_deg,rake_D,t0_D,f0_c
0.2,0.32,1.105,0,0,0.0658,0.0143
0.3,0.3625,1.102,1.5,0.001,0.0564,0.0232
0.4,0.4048,1.098,3,0.003,0.0478,0.023
0.5,0.4392,1.093,5,0.006,0.0396,0.0218
0.6,0.461,1.088,8,0.01,0.0321,0.0207
0.7,0.4622,1.084,11,0.014,0.025,0.02
0.8,0.4347,1.081,15,0.02,0.0183,0.0197
0.9,0.3613,1.079,20,0.027,0.012,0.0182
1.0,0,1.077,26,0.035,0.003,
'''
OFFSETS = "r_R,x_c,face_c,back_c\n" + "".join(
    f"{r},{x},{-0.2 * t * x * (1 - x):.6f},{t * 4 * x * (1 - x) + (0.002 if 0 < x < 1 else 0):.6f}\n"
    for r, t in ((0.2, 0.16), (0.5, 0.09), (0.8, 0.05), (1.0, 0.03)) for x in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0))
HUB = "x_D,r_D\n-0.2,0.1\n-0.1,0.105\n0,0.1\n0.1,0.095\n0.2,0.08\n"
FUSION_TOOL = {
    "type": "ball end mill", "unit": "millimeters", "description": "ball 6", "post-process": {"number": 4, "turret": 0},
    "geometry": {"DC": 6, "LCF": 12, "SFDM": 6, "OAL": 60, "NOF": 2, "LB": 35, "shoulder-length": 20,
                 "shoulder-diameter": 5.8},
    "shaft": {"segments": [{"height": 3, "lower-diameter": 5.8, "upper-diameter": 6}]},
    "holder": {"description": "ER16", "unit": "millimeters", "gaugeLength": 45, "type": "holder", "segments": [
        {"height": 30, "lower-diameter": 28, "upper-diameter": 28}, {"height": 20, "lower-diameter": 40,
                                                                     "upper-diameter": 40}]}}
FUSION = {"data": [FUSION_TOOL, {**FUSION_TOOL, "type": "tapered mill", "post-process": {"number": 5}, "geometry": {
    **FUSION_TOOL["geometry"], "RE": 1.0, "TA": 5}}, {"type": "holder", "description": "HSK", "unit": "inches",
                                                   "segments": FUSION_TOOL["holder"]["segments"]}], "version": 36}
BIT = {"version": 2, "name": "ball 6", "shape": "ballend.fcstd", "parameter": {
    "Diameter": "6.0 mm", "CuttingEdgeHeight": "12 mm", "ShankDiameter": "6 mm", "Length": "60 mm", "Flutes": 2,
    "TaperAngle": "10 °", "TaperDiameter": "8 mm", "CornerRadius": "1 mm", "FlatRadius": "2 mm"}, "attribute": {}}
SHAPES = ("endmill", "ballend", "bullnose", "torus", "taperedballnose", "dovetail", "drill")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One format."""

    name: str
    weight: float               # share of all inputs
    write: Callable             # (random.Random, empty folder) -> arguments behind `cuspline`
    has_real_step: bool = False     # STEP files are read anew for every input


@dataclass(frozen=True, kw_only=True)
class Files:
    """Sound files made once, texts by their name."""

    folder: Path
    machine: str
    fanuc_machine: str
    library: dict
    manifest: dict
    tools: dict
    step: bytes


@contextmanager
def sound_files():
    """Files, in a folder that goes at the end."""
    import cadquery as cq

    from cuspline.app import catalogue
    from cuspline.kernel import brep
    with TemporaryDirectory(prefix="cuspline-fuzz-") as name:
        folder = Path(name)
        brep.write_step(brep.the_solid(cq.Workplane().box(*MAIN_MM, centered=False).val()), folder / "box.step", "box")
        (folder / "box.toml").write_text(JOB)
        library = json.loads((catalogue.POSTS / "tools" / "tools.json").read_text())
        machines = [(catalogue.POSTS / "machines" / f"{n}.toml").read_text() for n in ("mill_3axis", "mill_fanuc")]
        tools = {"tools": [t for t in library["tools"] if t["number"] <= 3]}
        yield Files(folder=folder, machine=machines[0], fanuc_machine=machines[1], library=library, tools=tools,
                    manifest=_manifest(folder), step=(folder / "box.step").read_bytes())


def _manifest(folder):
    """manifest.json of a build of the box, the programs' texts put beside it by the case."""
    from cuspline.app import catalogue
    from cuspline.design.job import Job, PostedFile
    made = catalogue.make_design(catalogue.find_design(str(folder / "box.toml")), [])
    job = Job(design="box", step="box.step", material=made.material, predicates=made.predicates, stock=made.stock,
              finish=made.finish, machine=catalogue.find_machine("mill_3axis"), smallest_ball_radius_mm=1.0,
              posted=(PostedFile(setup=made.setups[0], program="setup-1.ngc"),))
    return {"design": "box", "stage": "gcode", "job": job.model_dump(mode="json")}


# the doors, and where stages stop -------------------------------------------------------------------------


@contextmanager
def doors(case):
    """Inside, stages stop where the reading ends; yields a list that is not empty once that has been reached."""
    import typer

    from cuspline.app import build, judge
    from cuspline.designs import propeller, rfq_vane
    from cuspline.designs.propellers.design import hub_of
    from cuspline.kernel import brep
    from cuspline.planning.preflight import refuse_impossible_setups
    from cuspline.values.errors import InputError
    reached = []

    def stop(*_, **__):
        reached.append(True)
        raise typer.Exit(0)

    class Read(InputError):
        """In place of what a design function would build."""

    def stop_in_a_design(*_, **__):
        reached.append(True)
        raise Read("read through")

    def stop_at_the_hub(name, description, p, table, hub_ratio):
        hub_of(p, table.diameter_mm, hub_ratio)
        stop_in_a_design()

    def stop_at_planning(order, say=None):
        solid = brep.the_solid(order.design.solid, f"design {order.design.name}")
        if order.design.setups:
            refuse_impossible_setups(order.design, solid, order.machine, order.library)
        stop()

    with ExitStack() as stack:
        put = lambda where, name, what: stack.enter_context(mock.patch.object(where, name, what))
        put(build, "build", stop_at_planning)
        put(judge, "first_look", stop)
        put(rfq_vane, "tip_of", stop_in_a_design)
        put(propeller, "propeller_design", stop_at_the_hub)
        if not case.has_real_step:
            put(brep, "read_step", _box)
            put(brep, "refuse_unreadable", _refuse_missing)
        yield reached


def _refuse_missing(path):
    """STEP files have a case of their own; here only a missing one is told."""
    from cuspline.values.errors import InputError
    if not _is_file(path):
        raise InputError(f"STEP file {path} does not exist")


def _is_file(path):
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def _box(path):
    _refuse_missing(path)
    return _the_box()


@lru_cache(1)
def _the_box():
    import cadquery as cq
    return cq.Workplane().box(*MAIN_MM, centered=False).val().wrapped


# cases ----------------------------------------------------------------------------------------------------


def cases(files):
    """Every Case."""
    box = files.folder / "box.toml"

    def put(folder, name, content):
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return folder / name

    def out(folder):
        return ("--out", folder / "out" / "part")

    def job(chance, folder):
        put(folder, "box.step", files.step)
        return ("build", put(folder, "job.toml", mangled_text(chance, JOB)), *out(folder))

    def machine(chance, folder):
        text = mangled_text(chance, chance.choice((files.machine, files.fanuc_machine)))
        return ("build", box, "--machine", put(folder, "m.toml", text), *out(folder))

    def library(chance, folder):
        some = {"tools": chance.sample(files.library["tools"], 3)}
        return ("cutters", put(folder, "l.json", mangled_document(chance, some)),
                *chance.choice(((), ("--json",), ("--to", folder / "t.json"), ("--to", folder / "t.tbl"))))

    def imported(path, folder):
        return ("cutters", "--import", path, "--to", folder / "mine.json", "--stick-out", "30", "--holder",
                "ER16 collet chuck", "--renumber")

    def fusion(chance, folder):
        content = mangled_document(chance, FUSION)
        if chance.random() < 0.7:
            return imported(put(folder, "f.json", content), folder)
        path = folder / "f.tools"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("tools.json", content)
        if chance.random() < 0.5:
            path.write_bytes(mangled_bytes(chance, path.read_bytes()))
        return imported(path, folder)

    def freecad(chance, folder):
        bit = {**BIT, "shape": f"{chance.choice(SHAPES)}.fcstd"}
        if chance.random() < 0.6:
            return imported(put(folder, "b.fctb", mangled_document(chance, bit)), folder)
        put(folder, "b.fctb", json.dumps(bit))
        listed = {"label": "mine", "tools": [{"nr": 1, "path": "b.fctb"}, {"nr": 2, "path": "b.fctb"}]}
        return imported(put(folder, "l.fctl", mangled_document(chance, listed)), folder)

    def markers(chance, folder):
        return ("build", box, "--measured", put(folder, "m.csv", mangled_text(chance, MARKERS)), *out(folder))

    def cells(chance, folder):
        return ("build", "rfq_vane", "-p", f"table={put(folder, 't.csv', mangled_text(chance, CELLS))}", *out(folder))

    def parmteqm(chance, folder):
        return ("build", "rfq_vane", "-p", f"table={put(folder, 't.txt', mangled_text(chance, PARMTEQM))}", *out(folder))

    def blades(chance, folder):
        which = chance.randrange(3)
        texts = [mangled_text(chance, t) if k == which else t for k, t in enumerate((RADII, OFFSETS, HUB))]
        paths = [put(folder, n, t) for n, t in zip(("radii.csv", "offsets.csv", "hub.csv"), texts)]
        named = [f"{p}={path}" for p, path in zip(("radii_csv", "offsets_csv", "hub_profile_csv"), paths)]
        wanted = [named[0], *(named[k] for k in (1, 2) if which == k)]
        return ("build", "propeller", *(w for n in wanted for w in ("-p", n)), *out(folder))

    def posted(folder, name, text, machine_text=None):
        manifest = json.loads(json.dumps(files.manifest))
        manifest["job"]["posted"][0]["program"] = name
        if machine_text is not None:
            import tomllib

            from cuspline.shop.machines import Machine
            manifest["job"]["machine"] = Machine.model_validate(tomllib.loads(machine_text)).model_dump(mode="json")
        put(folder, "manifest.json", json.dumps(manifest))
        put(folder, "tools.json", json.dumps(files.tools))
        put(folder, "box.step", files.step)
        put(folder, name, text)
        return ("verify", folder)

    letters = " XYZIJKRFGMTSHPO#[]=\t"

    def linuxcnc(chance, folder):
        return posted(folder, "setup-1.ngc", mangled_text(chance, LINUXCNC, letters))

    def fanuc(chance, folder):
        return posted(folder, "setup-1.nc", mangled_text(chance, FANUC, letters), files.fanuc_machine)

    def translate(chance, folder):
        post = chance.choice(sorted(PROGRAMS))
        text = mangled_text(chance, (GOLD / PROGRAMS[post]).read_text(), letters + "\"/;+")
        path, to = put(folder, "p.nc", text), chance.choice(sorted(PROGRAMS))
        return ("translate", path, "--from", post, "--to", to, "--out", folder / "o.nc")

    def restart(chance, folder):
        path = put(folder, "p.ngc", mangled_text(chance, LINUXCNC, letters))
        return ("restart", path, *chance.choice(((), ("N2003",), ("OP1",), ("N1",), (chance.choice(WORDS[1:]).replace("\0", ""),))))

    def manifest(chance, folder):
        posted(folder, "setup-1.ngc", LINUXCNC)
        put(folder, "manifest.json", mangled_document(chance, files.manifest))
        return ("verify", folder)

    def tools(chance, folder):
        posted(folder, "setup-1.ngc", LINUXCNC)
        put(folder, "tools.json", mangled_document(chance, files.tools))
        return ("verify", folder)

    def step(chance, folder):
        put(folder, "box.step", mangled_bytes(chance, files.step))
        return ("build", put(folder, "job.toml", JOB), *out(folder))

    def parameters(chance, folder):
        return ("build", *_parameters(chance), *out(folder))

    def options(chance, folder):
        return _options(chance, folder, box)

    # shares of the inputs: the dearer one is, the fewer
    rows = ((job, 12), (machine, 10), (library, 14), (fusion, 9), (freecad, 11), (markers, 9), (cells, 1.5), (parmteqm, 1.5),
            (blades, 1), (linuxcnc, 7), (fanuc, 8), (translate, 8), (restart, 5), (manifest, 8), (tools, 8), (step, 1),
            (parameters, 3), (options, 8))
    return [Case(name=f.__name__, weight=w, write=f, has_real_step=f is step) for f, w in rows]


@lru_cache(1)
def _models():
    """{design: names of its parameters}; solids that take long are left to the tests of their designs."""
    from cuspline.app import catalogue
    return {name: tuple(catalogue.find_design(name).parameters.model_fields) for name in ("rfq_vane", "propeller")}


def _parameters(chance):
    """A design and one to four assignments; values that pass are as good as any."""
    name = chance.choice(tuple(_models()))
    words = [name]
    for _ in range(chance.choice((1, 1, 2, 4))):
        key = chance.choice(_models()[name]) if chance.random() < 0.9 else chance.choice(WORDS)
        value = chance.choice((*NUMBERS, *NUMBERS, *WORDS, f"{chance.uniform(-5, 400):.3f}", str(chance.randrange(12))))
        given = f"{key}{chance.choice(('=', '=', '=', '=', '', '=='))}{value}".replace("\0", "")
        words += ["-p", given] if chance.random() < 0.8 else ["--params", given]
    return words


def _options(chance, folder, box):
    """Words of the command line in any order."""
    commands = ("build", "verify", "restart", "machines", "cutters", "posts", "designs", "--help", "bild", "")
    options = ("--out", "--machine", "--post", "--cutters", "--measured", "--stage", "--accept", "-p", "--params", "--json",
               "--import", "--to", "--holder", "--stick-out", "--renumber", "--", "-", "--no", "-h", "--stage=plan", "--out=")
    values = ("z_profile", str(box), "mill_3axis", "mill_fanuc", "linuxcnc", "step", "plan", "gouge", str(folder), "/dev/null",
              "/proc/self/mem", "/", ".", "N5", "nan", "1e9", "x=1", *WORDS)
    words = [chance.choice(commands)] if chance.random() < 0.95 else []
    if words[:1] == ["build"] and chance.random() < 0.8:
        words.append(str(box))
    for _ in range(chance.randrange(6)):
        words.append(chance.choice(chance.choice((options, values))).replace("\0", ""))
    return words
