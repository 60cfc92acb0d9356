"""What holds a part and must not be touched: boxes, cylinders, solids out of STEP files.

Those `on` the part are given in part coordinates and lie as the part does, measured markers included; those on the
table are given in the setup's work coordinates, and stay where they are.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_serializer, model_validator

from cuspline.design.stock import Box, Cylinder, Solid
from cuspline.stock.shapes import HERE, Shape
from cuspline.values.frames import Frame
from cuspline.values.models import Model, Point, one_of


class Holding(Model):
    """What every fixture has."""

    name: str
    on: Literal["part", "table"] = Field(default="part", description="what its coordinates belong to: the part, or the setup's "
                                         "work coordinates")

    @property
    def own_frame(self):
        """Its own coordinates, seen from what it is on."""
        return HERE

    @model_serializer(mode="wrap")
    def _only_what_it_says(self, dump) -> dict[str, Any]:
        return {k: v for k, v in dump(self).items() if (k, v) != ("on", "part")}


class FixtureBox(Box, Holding):
    """A box that no part of the tool may enter; it stands on the table: what lies below it is part of it."""


class FixtureCylinder(Cylinder, Holding):
    """A post, a mandrel, a locating pin."""


class FixtureSolid(Solid, Holding):
    """A clamp or a vice: a solid in coordinates of its own, and where it stands."""

    origin_mm: Point = Field(default=(0.0, 0.0, 0.0), description="where its zero stands")
    x: tuple[float, float, float] = Field(default=(1.0, 0.0, 0.0), description="where its X points")
    z: tuple[float, float, float] = Field(default=(0.0, 0.0, 1.0), description="where its Z points")

    @model_validator(mode="after")
    def _stands_square(self):
        try:
            self.own_frame
        except ValueError:
            raise ValueError(f"fixture {self.name!r}: x {self.x} and z {self.z} must be unit vectors square to each "
                             "other") from None
        return self

    @property
    def own_frame(self):
        return Frame.of_axes(self.origin_mm, self.x, self.z)


Fixture = one_of(FixtureBox, FixtureCylinder, FixtureSolid)


@dataclass(frozen=True, eq=False, kw_only=True)
class Placed:
    """A fixture as it stands, seen from a frame."""

    name: str
    shape: Shape              # in its own coordinates
    view: Frame               # that frame, seen from them

    @property
    def is_box(self):
        """A box along the frame's axes."""
        return self.shape.fills_box_in(self.view)

    @property
    def box_mm(self):
        """(3,) low and (3,) high corner of the box round it."""
        return self.shape.box_in(self.view)

    @property
    def mesh(self):
        """(v, 3) vertices and (t, 3) triangles of a closed mesh round it."""
        vertices, triangles = self.shape.mesh
        return self.view.into(vertices), triangles

    @property
    def edges_mm(self):
        """[(2, 3), ...] edges to draw it by."""
        return [self.view.into(np.asarray(edge)) for edge in self.shape.edges_mm]


def fixtures_beside(setup, folder):
    """A setup, the files of its fixtures found in a folder."""
    return setup.model_copy(update={"fixtures": tuple(f.beside(folder) for f in setup.fixtures)})


def placed_fixtures(setup, frame):
    """Placed values of a setup's fixtures.

    Args:
        setup: design.Setup.   frame: from which they are seen; it is given from the part.
    """
    return placed(setup.fixtures, setup.clamped_frame, frame)


def placed(fixtures, held, frame):
    """Placed values of fixtures in a clamping.

    Args:
        fixtures: of Fixture.   held: Frame of the clamping's WCS, seen from the part.   frame: see `placed_fixtures`.
    """
    base = {"part": HERE, "table": held}
    return tuple(Placed(name=f.name, shape=f.shape, view=frame.seen_from(base[f.on]).seen_from(f.own_frame)) for f in fixtures)
