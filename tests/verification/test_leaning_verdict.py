"""Verdicts on a dome finished by a ball that leans: the good program has no finding, each fault is found by name and line."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import tilted_dome as dome
from known_programs import tool

from cuspline.kernel import brep
from cuspline.kernel.tessellation import tessellate
from cuspline.program.program import Kind
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.replay import replay
from cuspline.replay.scene import FinishedDesign, FoundStock, Surroundings
from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.verification.certificate import certify, solid_in_wcs
from cuspline.verification.reporter import Reporter
from cuspline.verification.verdict import Judging, Options, SetupProgram, first_look, verify_setup

OPTIONS = Options(spacing_mm=0.6, solid_pitch_mm=0.4, replay_pitch_mm=0.5, tessellation_mm=0.005)
SOLID = dome.solid()
LEAD_RAD = np.radians(45.0)             # so far over that a short tool's holder comes near to the block
SHORT = tool("ball", 6, number=7, flute=6.5, neck=5.6, stick_out=8.2)
BULL = tool("bull_nose", 6, 1.0, number=7)
CORNER = CornerContact(radius_mm=3.0, corner_radius_mm=1.0, lead_rad=dome.LEAD_RAD, tilt_rad=0.0)
SHORT = SHORT.model_copy(update={"cutter": SHORT.cutter.model_copy(update={"reach_mm": 7.0})})


def judged(posted, tools=dome.TOOLS, mill=None):
    return verify_setup(posted, tools, SOLID, dome.dome_of(SOLID), setup=dome.SETUP, finish=dome.FINISH, stock=dome.STOCK,
                        ball_radius_mm=1.0, machine=mill or dome.trunnion(), options=OPTIONS)


@cache
def good_text():
    return dome.text_of(dome.trunnion(), dome.finishing())


@cache
def steep_text():
    return dome.text_of(dome.trunnion(), dome.finishing(lead_rad=LEAD_RAD), SHORT)


def with_ball(ball):
    return {**dome.TOOLS, 7: ball}


def replayed(posted, tools):
    """{kind: line} of what the replay alone finds."""
    mesh = tessellate(SOLID, 0.005)
    design = FinishedDesign(tree=ClearanceTree.of_triangles(mesh.vertices_mm, mesh.triangles), error_mm=0.015)
    stock = FoundStock(min_mm=dome.STOCK.min_mm, max_mm=dome.STOCK.max_mm, pitch_mm=0.5)
    found = replay(posted, tools, stock, design=design, around=Surroundings(machine=dome.trunnion()))
    return {f.kind: (f.line, f.amount_mm) for f in (*found.findings, *found.idle)}


def test_the_good_program_is_verified_with_no_finding_and_all_of_it_is_proven():
    v = judged(dome.read(dome.trunnion(), good_text()))
    assert v.findings == ()
    numbers = v.numbers
    assert numbers["area_reached_mm2"] == pytest.approx(numbers["area_required_mm2"])
    sagitta = 0.8 ** 2 / 8 / (dome.RADIUS_MM + 3.0)                 # of the chords of the ball's centre, mm
    assert 0.8 * sagitta < numbers["gouge_max_mm"] < sagitta + 1.5e-3
    assert numbers["gouge_max_mm"] <= numbers["gouge_proven_mm"] < numbers["gouge_max_mm"] + 0.004
    assert list(numbers["certificate"]["not_covered"]) == ["the program does not say where the move begins or ends"]
    cusp = 0.6 ** 2 / 8 * (1 / 3.0 + 1 / dome.RADIUS_MM)            # of passes so far apart over the dome
    assert 0.7 * cusp < numbers["cusp_max_mm"] < 1.1 * cusp
    assert numbers["excess_max_mm"] <= numbers["excess_proven_mm"] < 1.03 * numbers["excess_max_mm"]
    assert numbers["sampling"]["unproven_mm2"]["inside"] < 0.01 and numbers["sampling"]["not_covered"] == []


@cache
def bull_text(number_pushed=None):
    """Passes of a bull nose of R3 r1, one millimetre apart; one of them pushed 0.05 mm into the dome."""
    def change(number, tips, axes):
        points, normals = dome.contacts(np.linspace(-dome.HALF_MM, dome.HALF_MM, 9)[number])
        pushed = 0.05 if number == number_pushed else 0.0
        return points + (CORNER.ball_radius_mm - pushed) * normals + CORNER.tips_off(normals, axes), axes
    return dome.text_of(dome.trunnion(), dome.finishing(1.0, change=change), BULL)


def test_a_bull_nose_that_leans_and_turns_is_verified_and_all_of_it_is_proven():
    v = judged(dome.read(dome.trunnion(), bull_text(), with_ball(BULL)), with_ball(BULL))
    assert v.findings == ()
    numbers = v.numbers
    assert numbers["gouge_max_mm"] <= numbers["gouge_proven_mm"] < dome.FINISH.gouge_mm
    assert numbers["gouge_proven_mm"] < numbers["gouge_max_mm"] + 0.004
    cusp = 1.0 ** 2 / 8 * (1 / CORNER.across_mm + 1 / dome.RADIUS_MM)
    assert 0.8 * cusp < numbers["cusp_max_mm"] < 1.1 * cusp
    assert numbers["excess_max_mm"] <= numbers["excess_proven_mm"] < 1.03 * numbers["excess_max_mm"]
    assert numbers["sampling"]["unproven_mm2"]["inside"] < 0.01


def test_a_bull_nose_pushed_into_the_dome_on_one_pass_is_bounded_by_the_certificate():
    posted = dome.read(dome.trunnion(), bull_text(4), with_ball(BULL))
    tools, solid = with_ball(BULL), solid_in_wcs(SOLID, dome.SETUP.frame)
    finishing = np.flatnonzero((posted.tool == 7) & (posted.kind != Kind.RAPID) & np.isfinite(posted.start_mm).all(axis=1))
    proven = certify(posted, tools, ExactPart.of_faces(brep.faces_of(solid)), tolerance_mm=0.0033, rows=finishing, solid=solid)
    deep = proven.row[proven.bound_mm > 0.02]
    assert proven.is_complete and len(deep) and (np.abs(posted.end_mm[deep, 1]) < 0.6).all()
    assert 0.045 < proven.proven_mm < 4 * 0.05


def test_a_holder_two_millimetres_longer_is_found():
    segment = HolderSegment(height_mm=52.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0)
    longer = SHORT.model_copy(update={"stick_out_mm": 6.2, "holder": Holder(name="longer", segments=(segment,))})
    assert longer.length_mm == SHORT.length_mm
    mill = dome.trunnion()
    assert replayed(dome.read(mill, steep_text(), with_ball(SHORT)), with_ball(SHORT)) == {}
    found = replayed(dome.read(mill, steep_text(), with_ball(longer)), with_ball(longer))
    assert set(found) == {"holder_contact"} and 0.5 < found["holder_contact"][1] < 2.0


def test_a_rapid_through_the_dome_is_found_by_its_line():
    text = dome.text_of(dome.trunnion(), dome.finishing(low_return=6))
    posted = dome.read(dome.trunnion(), text)
    found = replayed(posted, dome.TOOLS)
    assert set(found) == {"rapid_through_stock"}
    line, amount = found["rapid_through_stock"]
    mine = posted.line == line
    assert (posted.kind[mine] == Kind.RAPID).all() and 0.5 < amount < 1.0
    assert posted.end_mm[mine, 2].max() < dome.TOP_MM


def test_a_pivot_a_tenth_of_a_millimetre_off_is_a_gouge():
    """At 45 degrees the ball's middle sinks by 0.1 (1 - cos 45), and goes aside on the slope."""
    off = dome.trunnion(a=[0.0, 0.0, -450.1])
    posted = dome.read(off, steep_text(), with_ball(SHORT))
    judging = Judging(tools=with_ball(SHORT), stock=dome.STOCK, finish=dome.FINISH, ball_radius_mm=1.0, options=OPTIONS)
    program = SetupProgram(posted=posted, setup=dome.SETUP, faces=tuple(dome.dome_of(SOLID)))
    own = first_look([program], SOLID, judging).residuals[0][1]
    deepest = int(own.deviation_mm.argmin())
    assert 0.02 < -own.deviation_mm[deepest] < 0.05
    assert posted.operation_name(own.row[deepest]) == "finish" and posted.line[own.row[deepest]] > 100


def test_what_nothing_proves_of_a_leaning_tool_is_a_finding():
    """Its moves, its leavings; an upright move that nothing proves is told in verify.json alone."""
    posted = dome.read(dome.trunnion(), good_text())
    program = SimpleNamespace(posted=posted, setup=dome.SETUP)
    report = Reporter(program, dome.FINISH, None, None, None, None)
    leans = np.flatnonzero(~posted.is_upright & (posted.kind != Kind.RAPID))
    upright = np.flatnonzero(posted.is_upright & (posted.kind != Kind.RAPID))
    certificate = SimpleNamespace(uncovered=((int(upright[0]), "T3"), (int(leans[5]), "T7"), (int(leans[9]), "T7")))
    left = lambda area: SimpleNamespace(unproven_mm2={"inside": area})
    of_moves, of_leavings = report.unproven(certificate, left(3.25))
    assert {of_moves.kind, of_leavings.kind} == {"surface_not_proven"}
    assert of_moves.line == posted.line[leans[5]] and "2 moves" in of_moves.advice and "of 3.2 mm²" in of_leavings.advice
    assert list(report.unproven(SimpleNamespace(uncovered=certificate.uncovered[:1]), left(0.01))) == []
