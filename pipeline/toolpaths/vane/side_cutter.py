r"""Transverse arcs with a circular side cutter: a disc with radiused teeth on a right-angle head, axis along the vane.

        ┌────────┐ head, hangs from the spindle            the disc turns in the transverse plane: seen from +x it is a
        │        ├──┐                                      circle of radius W + rt that rolls over the tip like the
        │        │ ▐│▌ disc: teeth of radius rt about a    ball's centre circle, grown by W all round
        └────────┘ ▐│▌ circle of radius W
    ──────────────────────────── x ►

A ball of radius rt whose centre is spread round a circle of radius W in the plane: with rt in place of the ball's
radius contacts, interval, Y, Z, C and the register stay as they are, and W is added to the arc's radius alone.  Teeth
so small leave room in valleys no ball of the disc's size would enter, at the disc's cutting speed.
What the head and the disc may not meet is the holding fixture: that is asked over the whole of every move.

Source: the motive and the trouble, Crandall and Stovall ("interference with holding fixtures has been a problem").
"""

from dataclasses import replace

from cuspline.program.pass_templates import Go, Let, Quantity, Register, terms
from cuspline.program.program import Kind
from cuspline.replay.head_clearance import lowest_mm, nearest_to_fixtures, stations
from cuspline.values.errors import PlanError

CLEARANCE_MM = 1.0          # head and disc keep that from fixtures


def with_wheel(passes, tool):
    """Templated passes of a ball of the teeth's radius, for the disc: W is one more register, in every arc's radius.

    Rapids across run higher by what hangs below the disc's middle, for the program drives that.  A stroke ends beside
    the body: straight up from the foot, the disc's widest place would pass through what stands over it.

    Args:
        passes: TemplatedPasses whose register `ball` is 0.
        tool: cutters.Tool on a right-angle head.
    Returns:
        TemplatedPasses.
    """
    if passes.register("ball").value != 0:
        raise PlanError("side-and-face cutter: the program drives the cutter's middle, so its passes are computed with "
                        "ball_radius_mm 0")
    g, fy, beside, wheel, ny = terms("g fy beside wheel ny")
    grown = {"g": lambda t: t + wheel, "fy": lambda t: t + wheel * ny}
    templates = tuple(replace(t, body=_ending_beside(tuple(
        Let(s.name, grown[s.name](s.value)) if isinstance(s, Let) and s.name in grown else s for s in t.body)))
        for t in passes.templates)
    more = {"beside": tool.wheel_mm, "clear": lowest_mm(tool)}
    registers = tuple(replace(r, value=r.value + more.get(r.name, 0.0)) for r in passes.registers)
    x, y, z = passes.start_mm
    return replace(passes, templates=templates, start_mm=(x, y - more["beside"], z + more["clear"]), registers=(
        *registers, Register(Quantity("wheel", meaning="circle of the teeth's centres"), tool.wheel_mm)))


def _ending_beside(body):
    """A stroke's body with its last cutting move followed by one across to where the tool goes up and down."""
    mid, beside, feed = terms("mid beside feed")
    arcs = [s.kind for s in body if isinstance(s, Go) and s.kind >= Kind.ARC_CW]
    if not arcs:
        return body
    last = max(k for k, s in enumerate(body) if isinstance(s, Go))
    side = mid + beside if arcs[0] == Kind.ARC_CW else mid - beside
    return (*body[:last + 1], Go(Kind.FEED, y=side, feed=feed), *body[last + 1:])


def refuse_interference(moves, tool, fixtures, spindle_head=()):
    """Complain where disc, arbor or head come too near to a fixture.

    Args:
        moves: program.Moves of the disc's middle.   tool: cutters.Tool on a right-angle head.
        fixtures: scene.Fixture values in the same frame.   spindle_head: of the machine.
    Raises:
        PlanError: names part, fixture, amount and place.
    """
    along = stations(moves.starts_mm, moves)
    worst = min(nearest_to_fixtures(along, tool, fixtures, spindle_head), key=lambda n: n.clearance_mm, default=None)
    if worst is not None and worst.clearance_mm < CLEARANCE_MM:
        place = " ".join(f"{a}{v:.3f}" for a, v in zip("XYZ", worst.center_mm))
        raise PlanError(f"side-and-face cutter T{tool.number}: its {worst.part} comes within {worst.clearance_mm:.2f} mm of the "
                        f"{worst.fixture} with the cutter's middle at {place}, {CLEARANCE_MM:g} mm are wanted: clamp "
                        "lower, raise the vane, or take a smaller cutter or angle head")
