"""Walls of holes that get a thread: which thread, how deep, and whether the wall is as wide as its tap drill leaves it.

The solid has the plain wall, no helix: what a thread is, its size says.
"""

from dataclasses import dataclass

from cuspline.kernel import brep
from cuspline.surfaces.holes import Hole, Wall, ends_on_level, holes_of
from cuspline.values.errors import DesignError

SAME_MM = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class ThreadedWall:
    """One wall of a hole with its thread, in the frame of its faces."""

    name: str               # of the faces
    thread: object          # shop.threads.Thread
    hole: Hole
    wall: Wall
    ends_flat: bool         # on a level floor

    @property
    def is_open(self):
        """Whether the tool may come out of the wall's lower end."""
        return self.hole.is_through and self.wall == self.hole.walls[0]

    @property
    def depth_mm(self):
        """Of the full thread, from the wall's upper end."""
        return self.thread.depth_in(self.wall.high_mm - self.wall.low_mm, self.is_open)

    @property
    def below_mm(self):
        """Height of the wall below its full thread."""
        return self.wall.high_mm - self.wall.low_mm - self.depth_mm

    @property
    def mouth_mm(self):
        """(3,) middle of the wall's upper end."""
        return self.hole.point_mm + self.wall.high_mm * self.hole.axis

    @property
    def in_words(self):
        """For messages."""
        return f"{self.thread.in_words} at ({', '.join(f'{v:.3f}' for v in self.mouth_mm)})"

    def turned_up(self):
        """The wall of a through hole seen from its other end."""
        hole = self.hole.turned_up()
        return ThreadedWall(name=self.name, thread=self.thread, hole=hole, ends_flat=False,
                            wall=next(w for w in hole.walls if w.faces == self.wall.faces))


def faces_with_threads(faces, threads, predicates):
    """{name: (Thread, indices of faces)}, as `threaded_walls` takes it.

    Args:
        faces: all brep.Face values of a solid as it was designed.   threads: {name of faces: shop.threads.Thread}.
        predicates: design.FacePredicate values.
    """
    return {name: (thread, brep.indices_of(faces, brep.named_faces(faces, predicates, (name,))))
            for name, thread in threads.items()}


def threaded_walls(faces, named):
    """The walls that get threads.

    Args:
        faces: all brep.Face values of a solid.
        named: {name: (Thread, indices of faces)}.
    Returns:
        list of ThreadedWall.
    Raises:
        DesignError: a face that is no wall of a hole, a wall that is too narrow or too wide for its thread, or too short.
    """
    if not named:
        return []
    by_face = {i: (hole, wall) for hole in holes_of(faces) for wall in hole.walls if wall.kind == "cylinder" for i in wall.faces}
    found = []
    for name, (thread, indices) in named.items():
        if stray := [i for i in indices if i not in by_face]:
            place = ", ".join(f"{v:.3f}" for v in faces[stray[0]].middle.point_mm[0])
            raise DesignError(f"thread {thread.in_words} of {name}: the {faces[stray[0]].kind} at ({place}) is no wall of a hole: "
                              "name the cylinders that go all round")
        for hole, wall in dict.fromkeys(by_face[i] for i in indices):
            one = ThreadedWall(name=name, thread=thread, hole=hole, wall=wall, ends_flat=ends_on_level(hole, wall))
            _refuse_other_width(one)
            if not 0 < one.depth_mm <= wall.high_mm - wall.low_mm + SAME_MM:
                raise DesignError(f"thread {one.in_words}: its wall is {wall.high_mm - wall.low_mm:.3f} mm high, which has no room "
                                  f"for {one.depth_mm:.3f} mm of full thread: state another depth_mm, or make the hole deeper")
            found.append(one)
    return found


def _refuse_other_width(one):
    (least, largest), d = one.thread.form.minor_mm, 2 * one.wall.low_radius_mm
    if not least - SAME_MM <= d <= largest + SAME_MM:
        raise DesignError(f"thread {one.in_words}: the hole is {d:.6g} mm wide, this thread is cut into one of {least:.3f} to "
                          f"{largest:.3f} mm: model the wall as its tap drill leaves it, {one.thread.form.tap_drill_mm:.6g} mm")
