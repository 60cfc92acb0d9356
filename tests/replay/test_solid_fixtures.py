"""Fixtures of any form: posts, mandrels, clamps out of STEP files, touched by so much as closed forms say."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, tool
from scipy.spatial.transform import Rotation

from cuspline.design import FixtureBox, FixtureCylinder, FixtureSolid, Setup
from cuspline.design.fixtures import placed_fixtures
from cuspline.kernel import brep
from cuspline.replay.replay import replay
from cuspline.replay.replay_design import TOLERANCE_MM
from cuspline.replay.replay_stock import DEEP_MM, SHARE
from cuspline.replay.scene import Fixture, FoundStock, SolidFixture, Surroundings
from cuspline.stock.shapes import ROUND_MM

LOW, HIGH = (-20.0, -10.0, -20.0), (20.0, 10.0, 0.0)
POST = FixtureCylinder(name="post", from_mm=(0, 30, -20), to_mm=(0, 30, 10), diameter_mm=8)
MANDREL = FixtureCylinder(name="mandrel", from_mm=(-25, 30, 0), to_mm=(25, 30, 0), diameter_mm=10)


def standing(*fixtures, **where):
    """Fixtures as the replay takes them."""
    setup = Setup(name="s", wcs_in_words="", faces=("f",), fixtures=fixtures, **where)
    return [SolidFixture(f.name, *f.mesh) for f in placed_fixtures(setup, setup.frame)]


def touched(fixtures, *moves, start=(-30, 60, 50), cutter=None):
    """Amounts of fixture_contact."""
    posted = program(start, moves)
    found = replay(posted, {1: cutter or tool("flat", 6, flute=40.0)}, FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=0.5),
                   around=Surroundings(fixtures=fixtures)).findings
    assert {f.kind for f in found} <= {"fixture_contact"}
    return [f.amount_mm for f in found]


def is_right(amount, want, off=0.0):
    """As deep as it is, less the tolerance of the search, more what facets stand out."""
    slack = TOLERANCE_MM + (SHARE * want if want > DEEP_MM else 0.0)
    return want - slack <= amount <= want + off + 1e-9


@pytest.mark.parametrize("depth", [0.03, 0.08, 1.5])
def test_a_flat_cutter_beside_a_post_goes_as_deep_as_their_radii_say(depth):
    y = 30.0 - 7.0 + depth              # their axes: 3 + 4 less the depth
    amounts = touched(standing(POST), rapid(-30, y, 50), rapid(-30, y, 2), feed(30, y, 2), rapid(30, y, 50))
    assert len(amounts) == 1 and is_right(amounts[0], depth, ROUND_MM)
    assert touched(standing(POST), rapid(-30, 22.99, 50), rapid(-30, 22.99, 2), feed(30, 22.99, 2), rapid(30, 22.99, 50)) == []


@pytest.mark.parametrize("depth", [0.03, 0.08])
def test_a_ball_on_a_mandrel_goes_as_deep_as_it_is_low(depth):
    ball, z = tool("ball", 6, flute=40.0), 5.0 - depth
    amounts = touched(standing(MANDREL), rapid(0, 60, 50), rapid(0, 60, z), feed(0, 30, z), rapid(0, 30, 50), cutter=ball)
    assert len(amounts) == 1 and is_right(amounts[0], depth, ROUND_MM)
    assert touched(standing(MANDREL), rapid(0, 60, 50), rapid(0, 60, 5.01), feed(0, 0, 5.01), rapid(0, 0, 50), cutter=ball) == []


def wedge(**where):
    """A clamp with a slope of 30 degrees from (x = 0, z = 0) up to x = 20, 30 wide."""
    rise = 20 * np.tan(np.radians(30))
    body = cq.Workplane("XZ").polyline([(0, -5), (20, -5), (20, rise), (0, 0)]).close().extrude(-30)
    return FixtureSolid(name="clamp", solid=body, **where)


def on_the_slope(depth, radius=3.0):
    """Tip over x = 10 of a ball that is so deep in the slope."""
    return 10 * np.tan(np.radians(30)) + (radius - depth) / np.cos(np.radians(30)) - radius


def test_a_ball_on_a_clamps_slope_is_as_deep_as_its_centre_says(tmp_path):
    ball = tool("ball", 6, flute=40.0)
    for depth, want in ((0.05, 1), (-0.01, 0)):
        z = on_the_slope(depth)
        moves = (rapid(10, 60, 50), rapid(10, 60, z), feed(10, 15, z), rapid(10, 15, 50))
        amounts = touched(standing(wedge()), *moves, cutter=ball)
        assert len(amounts) == want and all(is_right(a, depth) for a in amounts)
    brep.write_step(brep.the_solid(wedge().solid), tmp_path / "clamp.step", "clamp")
    read = FixtureSolid(name="clamp", step="clamp.step").beside(tmp_path)
    np.testing.assert_allclose(np.sort(read.shape.mesh[0], axis=0), np.sort(wedge().shape.mesh[0], axis=0), atol=1e-6)


def test_holder_and_shank_are_held_against_fixtures_too():
    tall = FixtureCylinder(name="stop", from_mm=(0, 30, -20), to_mm=(0, 30, 46.5), diameter_mm=8)
    moves = (rapid(-30, 8, 50), rapid(-30, 8, 2), feed(30, 8, 2), rapid(30, 8, 50))       # holder radius 20, at 45 + 2
    assert touched(standing(tall), *moves) == []
    assert is_right(touched(standing(tall), *moves, cutter=tool("flat", 6, flute=40.0, stick_out=44.0))[0], 0.5, ROUND_MM)


def test_a_box_as_a_solid_is_met_as_a_box_is():
    box = FixtureBox(name="jaw", min_mm=(-22, 6, -20), max_mm=(-16, 12, 8))
    plain = [Fixture(name="jaw", min_mm=box.min_mm, max_mm=box.max_mm)]
    for y, z in ((3.05, 5.0), (9.0, 7.95), (3.1, 7.97)):
        moves = (rapid(-30, y, 50), rapid(-30, y, z), feed(-5, y, z), rapid(-5, y, 50))
        one, other = (touched(fixtures, *moves) for fixtures in (plain, standing(box)))
        assert len(one) == len(other) == 1 and other[0] == pytest.approx(one[0], abs=2 * TOLERANCE_MM)


def test_what_is_on_the_part_lies_with_it_and_what_is_on_the_table_stays():
    turn = Rotation.from_euler("xz", (37, 20), degrees=True).as_matrix()
    where = {"wcs_origin_mm": (3.0, 4.0, 5.0), "wcs_x": tuple(turn[:, 0]), "wcs_z": tuple(turn[:, 2])}
    setup = Setup(name="s", wcs_in_words="", faces=("f",), fixtures=(
        POST, POST.model_copy(update={"on": "table"}),
        wedge(on="table", origin_mm=(7, 0, 0), x=(0, 1, 0)), wedge(origin_mm=(7, 0, 0), x=(0, 1, 0))), **where)
    lying, standing_, clamp, on_part = placed_fixtures(setup, setup.frame)
    np.testing.assert_allclose(lying.mesh[0], setup.frame.into(POST.shape.mesh[0]), atol=1e-12)
    np.testing.assert_allclose(standing_.mesh[0], POST.shape.mesh[0], atol=1e-12)
    assert standing_.box_mm[1] == pytest.approx((4, 34, 10), abs=1e-9)
    low, high = clamp.box_mm
    np.testing.assert_allclose([low[:2], high[:2]], [[7 - 30, 0], [7, 20]], atol=1e-9)        # its X is the table's Y
    np.testing.assert_allclose(on_part.mesh[0], setup.frame.into(clamp.mesh[0]), atol=1e-9)
    seen = [f.mesh[0] for f in placed_fixtures(setup, setup.turn)]
    zero = setup.turn.into(setup.frame.origin_mm[None])
    for here, there in zip((lying, standing_, clamp, on_part), seen):
        np.testing.assert_allclose(there, here.mesh[0] + zero, atol=1e-9)


def test_a_fixture_says_where_it_stands_in_square_unit_directions():
    with pytest.raises(ValueError, match="fixture 'clamp'.*unit vectors square"):
        wedge(x=(1, 0, 0.2))
    with pytest.raises(ValueError, match="two ends"):
        FixtureCylinder(name="post", from_mm=(0, 0, 1), to_mm=(0, 0, 1), diameter_mm=3)
    assert "on" not in FixtureBox(name="jaw", min_mm=(0, 0, 0), max_mm=(1, 1, 1)).model_dump()
