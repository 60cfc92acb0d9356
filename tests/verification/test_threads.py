"""Threads as posted: the plate of three threads as it is, and with everything that may be wrong about a thread."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.app.judge import posted_moves
from cuspline.design import Design, Thread
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.shop.threads import thread_form
from cuspline.surfaces.holes import holes_of
from cuspline.values.errors import CamError
from cuspline.verification.reach import is_drilled
from cuspline.verification.threads import thread_findings
from cuspline.verification.verdict import SetupProgram

sys.path.insert(0, str(Path(__file__).parent.parent / "parts"))
import threaded_plate  # noqa: E402

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
TOOLS = {t.number: t for t in SHOP.tools}


class Posted:
    """The plate's program, and what is found of it."""

    def __init__(self, design, machine=MACHINE):
        self.design, self.machine, self.setup = design, machine, design.setups[0]
        self.plan = plan_setup(design, self.setup, machine, SHOP)
        self.text = catalogue.find_post(machine.control.post).post(self.plan.program((), "plate"), machine).text
        self.solid = brep.the_solid(design.solid, "plate")

    def found(self, *changes, tools=TOOLS, threads=None, change=lambda text: text):
        """{(kind, x of the hole): amount} with words of the text changed."""
        text = change(self.text)
        for old, new in changes:
            assert text.count(old) == 1, (text.count(old), old)
            text = text.replace(old, new)
        moves = posted_moves([text], self.setup, self.machine, tools)
        program = SetupProgram(posted=moves, setup=self.setup, faces=())
        found, = thread_findings([program], self.solid, self.design.threads if threads is None else threads, self.design.predicates,
                                 tools, [threaded_plate.Z])
        return {(f.kind, min((10, 16, 22, 34), key=lambda x: abs(x - f.place_mm[0]))): f.amount_mm for f in found}


@pytest.fixture(scope="module")
def plate():
    return Posted(threaded_plate.design(threaded_plate.Parameters()))


def test_threads_as_they_are_planned_are_as_they_are_stated(plate):
    assert plate.found() == {}
    names = [o.name for o in plate.plan.operations]
    assert names == ["drill 5", "drill 3.3", "drill 6.8", "tap M6x1", "tap M4x0.7", "thread mill"]
    assert plate.plan.area_reached_mm2 == pytest.approx(plate.plan.area_required_mm2, rel=0.02)


M6, M4 = "G33.1 Z-3 K1\n", "G33.1 Z3.9 K0.7\n"
WRONG = {
    "K of another pitch": ([(M6, "G33.1 Z-3 K0.75\n")], {("thread_pitch", 10): 0.25}),
    "a spindle that turns backwards": ([("S870 M3", "S870 M4")], {("thread_hand", 10): 0.0}),
    "a feed not tied to the spindle": ([(M6, "G1 Z-3 F870\nZ17\n")], {("thread_pitch", 10): 1.0, ("thread_missing", 10): 0.0}),
    "no tap": ([(M6, "")], {("thread_missing", 10): 0.0}),
    "no drill": ([("G98 G83 X10 Y10 Z-1.4099 R15 Q5 F525.0\nG80\n", "")], {("thread_hole", 10): thread_form("M6").minor_mm[0]}),
    "a tap deeper than the drill": ([(M4, "G33.1 Z2.9 K0.7\n")], {("thread_bottom", 22): 0.1}),
    "a tap not deep enough": ([(M4, "G33.1 Z4.9 K0.7\n")], {("thread_depth", 22): 1.0}),
    "a tap that leaves nothing below": ([("G83 X10 Y10 Z-1.4099", "G83 X10 Y10 Z6")], {("thread_bottom", 10): 9 + 2.5 / 2.74748}),
    "a tap beside its hole": ([("G0 X10 Y10\nG0 Z19\nG0 Z17\n", "G0 X10.2 Y10\nG0 Z19\nG0 Z17\n")], {("thread_beside", 10): 0.2}),
    "a tap where no thread is": ([("G0 X22 Y10\nG0 Z19\nG0 Z16.1\n", "G0 X16 Y10\nG0 Z19\nG0 Z16.1\n")],
                                 {("thread_beside", 16): 10.1, ("thread_missing", 22): 0.0}),
    "M8's tap in M6's hole": ([("T64 M6\nG43 H64", "T65 M6\nG43 H65")],
                              {("thread_diameter", 10): 2.0, ("thread_pitch", 10): 0.25, ("thread_depth", 10): 0.75,
                               ("thread_missing", 10): 0.0}),
    "a drill for another pitch": ([("T35 M6\nG43 H35", "T36 M6\nG43 H36")],
                                  {("thread_hole", 10): 6 - thread_form("M6").minor_mm[1]}),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_about_a_tapped_thread_is_found(plate, name):
    changes, wanted = WRONG[name]
    found = plate.found(*changes)
    assert found.keys() == wanted.keys() and found == pytest.approx(wanted, abs=3e-3)


def test_taps_that_are_not_what_the_library_said_are_found(plate):
    def with_tap(**changes):
        tool = TOOLS[64]
        return {**TOOLS, 64: tool.model_copy(update={"cutter": tool.cutter.model_copy(update=changes)})}

    assert plate.found(tools=with_tap(pitch_mm=0.75)) == pytest.approx({("thread_pitch", 10): 0.25})
    assert plate.found(tools=with_tap(hand="left")) == {("thread_hand", 10): 0.0}
    assert plate.found(tools=with_tap(chamfer_threads=5.0)) == pytest.approx({("thread_depth", 10): 2.0})
    left = {**plate.design.threads, "m6": Thread(size="M6", hand="left")}
    assert plate.found(threads=left) == {("thread_hand", 10): 0.0}


def milled(text, change):
    """The program with the words of the milled thread changed by a function of (word, number)."""
    head, rest = text.split("(OPERATION 6")
    start = rest.index("G0 X34 Y10\n") + len("G0 X34 Y10\n")
    words = re.sub(r"([XYZIJ])(-?[\d.]+)", lambda m: f"{m[1]}{change(m[1], float(m[2])):.4f}", rest[start:rest.rindex("M5")])
    return head + "(OPERATION 6" + rest[:start] + words + rest[rest.rindex("M5"):]


def wider(by_mm):
    """The path of the last pass, whose radius is 1.0267 mm, on another radius."""
    scale = 1 + by_mm / 1.0267
    return lambda word, v: {"X": 34 + (v - 34) * scale, "I": v * scale}.get(word, v)


MILLED = {
    "0.1 mm too far out": (wider(0.1), {"thread_diameter": 0.2 - 2 / 3 * 0.16}),
    "0.1 mm too narrow": (wider(-0.1), {"thread_diameter": 0.2 - 1 / 3 * 0.16}),
    "a pitch of 1 mm": (lambda w, v: 14.25 + (v - 14.25) * 0.8 if w == "Z" and v < 15 else v,
                        {"thread_pitch": 0.25, "thread_depth": 3.0}),
    "left-hand": (lambda w, v: 13.5 - v if w == "Z" and v < 15 and v != 1.0 else v, {"thread_hand": 0.0}),
    "1 mm too high": (lambda w, v: v + 1 if w == "Z" and v < 15 else v, {"thread_depth": 1.0}),
}


@pytest.mark.parametrize("name", MILLED)
def test_what_is_wrong_about_a_milled_thread_is_found(plate, name):
    change, wanted = MILLED[name]
    found = plate.found(change=lambda text: milled(text, change))
    assert found == pytest.approx({(kind, 34): amount for kind, amount in wanted.items()}, abs=0.02)


def changed(**changes):
    """The plate's Design with other values."""
    design = threaded_plate.design(threaded_plate.Parameters())
    own = {name: getattr(design, name) for name in ("name", "description", "parameters", "solid", "predicates", "material", "stock",
                                                    "threads", "finish", "setups")}
    return Design(**{**own, **changes})


def test_left_hand_threads_are_milled_downward(plate):
    threads = {"m8": Thread(size="M8", hand="left")}
    setup = plate.setup.model_copy(update={"operations": (plate.setup.operations[0], plate.setup.operations[2])})
    posted = Posted(changed(threads=threads, setups=(setup,)))
    assert posted.found() == {}
    assert posted.found(threads={"m8": Thread(size="M8")}) == {("thread_hand", 34): 0.0}


@pytest.mark.parametrize("machine", ["mill_fanuc", "mill_haas", "mill_siemens", "mill_heidenhain"])
def test_the_same_threads_are_found_in_every_dialect(machine):
    posted = Posted(changed(), catalogue.find_machine(machine))
    assert posted.found() == {}
    wrong = {"mill_fanuc": ("F870.0", "F652.5"), "mill_haas": ("F870.0", "F652.5"),
             "mill_siemens": ("G331 Z-3 K1", "G331 Z-3 K0.75"), "mill_heidenhain": ("Q239=+1 ", "Q239=+0.75 ")}[machine]
    assert posted.found(wrong) == pytest.approx({("thread_pitch", 10): 0.25})


@pytest.mark.parametrize("threads, why", [
    ({"m6": "M5"}, r"the hole is 5 mm wide, this thread is cut into one of 4.134 to 4.334 mm"),
    ({"m9": "M6"}, "a name of no predicate"),
    ({"m6": "M6x2"}, r"M6 has the pitches 1, 0.75 mm"), ({"point": "M4"}, "the cone at .* is no wall of a hole"),
    ({"m4": "M4", "m6": Thread(size="M6", depth_mm=15)}, "no room for 15.000 mm of full thread"),
    ({"m6": "M6", "m4": Thread(size="M4", depth_mm=9)}, "takes the tip of T62 tap M4 0.800 mm too far down"),
    ({"m4": "M4"}, "no thread is stated of the hole at"),
    ({"m4": "M4", "m6": Thread(size="M6", hand="left")}, "no tap cuts the thread M6x1 left-hand")])
def test_threads_that_cannot_be_are_refused(threads, why):
    with pytest.raises(CamError, match=why):
        Posted(changed(threads=threads))


def test_a_machine_that_does_not_tap_is_told_to_mill():
    with pytest.raises(CamError, match="mill_grbl does not tap"):
        Posted(changed(), catalogue.find_machine("mill_grbl"))


@pytest.mark.parametrize("taps, last", [(True, ["tap"] * 3), (False, ["thread mill"] * 3)])
def test_auto_taps_or_mills_what_it_has_drilled_and_says_why(taps, last):
    machine = MACHINE.model_copy(update={"control": MACHINE.control.model_copy(update={"rigid_tapping": taps})})
    setup = threaded_plate.design(threaded_plate.Parameters()).setups[0].model_copy(update={"operations": ()})
    threads = {"m6": "M6", "m4": Thread(size="M4", depth_mm=7), "m8": "M8"}
    posted = Posted(changed(threads=threads, setups=(setup,)), machine)
    made = posted.plan.operations
    assert [o.name for o in made][3:] == last and all("drill" in o.name for o in made[:3])
    assert posted.found() == {} and all(taps or "does not tap" in o.facts["instead_of"] for o in made[3:])


def test_a_counterbore_with_its_flat_drill_is_drilled():
    import cadquery as cq
    hole = cq.Workplane("XY").box(30, 20, 14, centered=False).faces(">Z").workplane(origin=(15, 10, 0)).cboreHole(6.6, 11, 6.4)
    inside = threaded_plate.FacePredicate(name="hole", count=3, center_min_mm=(5, 5, 0.1), center_max_mm=(25, 15, 13.9))
    setup = threaded_plate.Setup(name="setup-1", faces=("hole",), wcs_in_words="corner")
    plan = plan_setup(changed(solid=hole.val(), predicates=(inside,), threads={}, setups=(setup,)), setup, MACHINE, SHOP)
    assert sorted(o.name for o in plan.operations) == ["drill 11", "drill 6.6"]
    flat = next(o for o in plan.operations if o.tool.cutter.diameter_mm == 11)
    assert flat.tool.cutter.has_flat_bottom and flat.moves.end_mm[:, 2].min() == pytest.approx(14 - 6.4)
    assert plan.area_reached_mm2 == pytest.approx(plan.area_required_mm2)


def test_a_flat_drill_is_held_to_the_rim_of_its_ledge_by_neither_side():
    """The hole of a post that rounds lies 0.5 um beside it: a ray from the rim would run up or along its whole depth."""
    import cadquery as cq
    block = cq.Workplane("XY").box(30, 20, 14, centered=False).faces(">Z").workplane(origin=(15, 10, 0)).cboreHole(6.6, 11, 6.4)
    holes = holes_of(brep.faces_of(brep.the_solid(block.val())))
    flat = next(t.cutter for t in SHOP.tools if t.cutter.diameter_mm == 11 and t.cutter.has_flat_bottom)
    from_axis = np.array([(5.4995, 0.0), (5.5005, 0.0), (5.5, 0.0005), (4.5, 0.0), (5.5, 1.0)])
    places = np.column_stack([15 + from_axis[:, 0], np.full(5, 10.0), 7.6 + from_axis[:, 1]])
    up, inward = np.tile((0.0, 0.0, 1.0), (5, 1)), np.tile((-1.0, 0.0, 0.0), (5, 1))
    assert is_drilled(places, up, holes, [flat]).tolist() == [False, False, False, True, False]
    assert is_drilled(places, inward, holes, [flat]).tolist() == [False, False, False, True, True]


def test_a_drill_makes_the_wall_of_its_hole_and_no_ledge_round_it():
    """A counterbore that no flat drill of the shop fits: the point of its ledge at the rim of the hole is none of the drill's."""
    import cadquery as cq
    block = cq.Workplane("XY").box(30, 20, 14, centered=False).faces(">Z").workplane(origin=(15, 10, 0)).cboreHole(6.6, 11, 6.4)
    holes = holes_of(brep.faces_of(brep.the_solid(block.val())))
    drill = next(t.cutter for t in SHOP.tools if t.cutter.diameter_mm == 6.6)
    at_the_rim = np.array([(18.3, 10.0, 7.6), (18.3, 10.0, 7.6), (18.3, 10.0, 4.0)])
    normals = np.array([(0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    assert is_drilled(at_the_rim, normals, holes, [drill]).tolist() == [False, True, True]
