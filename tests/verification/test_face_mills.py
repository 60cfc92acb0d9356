"""Face mills cut as their inserts stand, and no deeper than these are high."""

from types import SimpleNamespace

import cadquery as cq
import pytest
from known_programs import feed, program, rapid

from cuspline.app.catalogue import find_library
from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.planning.level_finishing import facing_tool, within_inserts_mm
from cuspline.planning.strategies.facing import Facing
from cuspline.values.errors import PlanError
from cuspline.verification.verdict import Options, verify_setup

FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=1.5, solid_pitch_mm=1.0, replay_pitch_mm=1.0, tessellation_mm=0.01)
BLOCK = brep.the_solid(cq.Workplane().box(60, 30, 20, centered=False))
LIBRARY = find_library(None)
MILLS = {t.cutter.insert_angle_deg: t.simulated for t in LIBRARY.of_type("face_mill")}


def judged(angle, high_mm):
    """Findings of one pass along X at Z20, through stock so much higher, with the mill whose inserts stand at an angle."""
    tool = MILLS[angle]
    moves = [rapid(-45, 15, 60), rapid(-45, 15, 20), feed(105, 15, 20), rapid(105, 15, 60)]
    top = [f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > 0.5]
    posted = program((-45, 15, 90), moves, tool=[tool.number] * len(moves))
    return verify_setup(posted, {tool.number: tool}, BLOCK, top, finish=FINISH, options=COARSE, ball_radius_mm=2.0,
                        stock=StockBox(min_mm=(0, 0, 0), max_mm=(60, 30, 20 + high_mm)),
                        setup=Setup(name="setup-1", faces=("top",), wcs_in_words="corner")).findings


def facing(narrow_mm, **says):
    """As much of a PlanningContext as the choice of a facing's tool looks at."""
    operation = Facing(**says)
    asked = lambda t: operation.wish is None or operation.wish.fits(t)
    return SimpleNamespace(operation=operation, library=LIBRARY, stock_min_mm=(0, 0, 0), stock_max_mm=(200, narrow_mm, 20),
                           is_asked=asked, tools=lambda *types: [t for t in LIBRARY.of_type(*types) if asked(t)])


@pytest.mark.parametrize("angle", sorted(MILLS))
def test_what_inserts_reach_is_faced_and_what_is_higher_meets_the_body_of_the_mill(angle):
    assert not judged(angle, 3.0)
    assert "shank_contact" in {f.kind for f in judged(angle, 12.0)}


def test_facing_takes_a_face_mill_no_wider_than_the_stock_and_no_deeper_than_its_inserts():
    wide, narrow = (facing_tool(facing(mm)).cutter for mm in (60.0, 40.0))
    assert (wide.type, wide.diameter_mm, narrow.type) == ("face_mill", 50.0, "flat")
    deep = facing(60.0, stepdown_mm=7.0)
    with pytest.raises(PlanError, match="stepdown_mm 7 is more than the inserts of T94 face mill 50 mm 45 cut, 6 mm: lower it"):
        within_inserts_mm(deep.operation, facing_tool(deep), 7.0)
    assert within_inserts_mm(facing(60.0).operation, facing_tool(deep), 12.0) == 6.0
