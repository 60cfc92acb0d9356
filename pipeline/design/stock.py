"""What a part is cut from, as its owner states it: a box, a turned blank, a casting, a mesh, or an allowance round it.

Part coordinates.  Each value tells its `shape` (stock/shapes.py), which every later stage asks.  Files are found beside
the design that names them; a build copies them beside its outputs, and goes on with the copies.  The CAD kernel is
loaded when a solid is asked for: whoever lists designs or machines does not wait for it.
"""

import shutil
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field, PrivateAttr, model_serializer, model_validator

from cuspline.kernel.stl_files import read_stl, stl_of_corners
from cuspline.stock.shapes import BoxShape, CylinderShape, closed_mesh
from cuspline.values.errors import DesignError
from cuspline.values.models import FAR_MM, Model, Point, one_of

SOLID_MM = 0.01             # what the triangles of a casting, or of a clamp, may lie off its surfaces
SHORTEST_MM = 1e-3          # of a cylinder
SKIN_MM, SKIN_SHARE = 0.1, 0.1      # what the triangles under a skin may lie off the part, in mm and of its thickness
MET_SHARE = 0.01            # of the part's area
OVER = 1.1                  # times as thick: outside of it, unless it meets itself


class Standing(Model):
    """What stands in a setup: the base of all stocks and fixtures."""

    def beside(self, folder):
        """The same, its file found in a folder."""
        return self

    def written(self, folder, name):
        """The same as it stands in a folder of outputs, under a name without its ending."""
        return self


class Box(Standing):
    """Two corners."""

    TOLD_BY: ClassVar[str] = "min_mm"

    min_mm: Point
    max_mm: Point

    @property
    def shape(self):
        return BoxShape(min_mm=self.min_mm, max_mm=self.max_mm)


class Cylinder(Standing):
    """The middles of two ends and a diameter."""

    TOLD_BY: ClassVar[str] = "diameter_mm"

    from_mm: Point = Field(description="middle of one end")
    to_mm: Point = Field(description="middle of the other end")
    diameter_mm: float = Field(gt=SHORTEST_MM, le=FAR_MM)

    @model_validator(mode="after")
    def _has_length(self):
        if max(abs(b - a) for a, b in zip(self.from_mm, self.to_mm)) < SHORTEST_MM:
            raise ValueError(f"a cylinder has two ends, not one: from_mm and to_mm are both {self.from_mm}")
        return self

    @property
    def shape(self):
        return CylinderShape(from_mm=self.from_mm, to_mm=self.to_mm, radius_mm=self.diameter_mm / 2)


class FromFile(Standing):
    """A shape that stands in a file, read when it is first asked for."""

    ENDING: ClassVar[str]

    _folder: Path = PrivateAttr(Path())
    _shape: Any = PrivateAttr(None)

    def beside(self, folder):
        found = self.model_copy()
        found._folder, found._shape = Path(folder), None
        return found

    @property
    def path(self):
        """Where its file is."""
        return self._folder / getattr(self, self.TOLD_BY)

    @property
    def shape(self):
        """Its Shape.

        Raises:
            InputError: the file is missing or cannot be read.  DesignError: what it holds bounds no solid.
        """
        if self._shape is None:
            self._shape = self._read()
        return self._shape

    def written(self, folder, name):
        target = Path(folder) / f"{name}{self.ENDING}"
        if target.exists():
            raise DesignError(f"{target.name} would be written twice: give the design, or what is written beside it, "
                              "another name")
        self._write(target)
        return self.model_copy(update={self.TOLD_BY: target.name, **self._only_in_code}).beside(folder)

    def _write(self, target):
        shutil.copyfile(self._checked_path, target)

    _only_in_code: ClassVar[dict] = {}


class Solid(FromFile):
    """A solid in a STEP file, or one made in code."""

    TOLD_BY: ClassVar[str] = "step"
    ENDING: ClassVar[str] = ".step"
    _only_in_code: ClassVar[dict] = {"solid": None}

    step: str | None = Field(default=None, min_length=1, description="STEP file, beside the design or the job file")
    solid: Any = Field(default=None, exclude=True, repr=False,
                       description="in code, in place of it: a solid of CadQuery, build123d or the kernel")

    @model_validator(mode="after")
    def _is_one(self):
        if (self.step is None) == (self.solid is None) or isinstance(self.solid, (str, int, float, list, dict)):
            raise ValueError("name the solid's file as `step`; in code, `solid` may hold the solid in its place")
        return self

    @property
    def _checked_path(self):
        from cuspline.kernel import brep
        brep.refuse_unreadable(self.path)
        return self.path

    @property
    def _the_solid(self):
        from cuspline.kernel import brep
        if self.solid is not None:
            return brep.the_solid(self.solid, "the solid of a stock or fixture")
        return brep.the_solid(brep.read_step(self._checked_path), str(self.path))

    def _read(self):
        from cuspline.kernel.tessellation import tessellate
        mesh, name = tessellate(self._the_solid, SOLID_MM), self.step or "made in code"
        return closed_mesh(mesh.vertices_mm, mesh.triangles, mesh.deviation_mm, f"the solid {name}", f"SOLID {name}")

    def _write(self, target):
        from cuspline.kernel import brep
        if self.solid is None:
            super()._write(target)
        else:
            brep.write_step(self._the_solid, target, target.stem)


class Mesh(FromFile):
    """A closed mesh in an STL file, millimetres, or one made in code."""

    TOLD_BY: ClassVar[str] = "stl"
    ENDING: ClassVar[str] = ".stl"
    _only_in_code: ClassVar[dict] = {"mesh": None}

    stl: str | None = Field(default=None, min_length=1, description="STL file of a closed mesh in mm, beside the design "
                            "or the job file")
    mesh: Any = Field(default=None, exclude=True, repr=False,
                      description="in code, in place of it: (vertices (v, 3), triangles (t, 3))")

    @model_validator(mode="after")
    def _is_one(self):
        if (self.stl is None) == (self.mesh is None) or isinstance(self.mesh, (str, int, float, dict)):
            raise ValueError("name the mesh's file as `stl`; in code, `mesh` may hold its vertices and triangles in its place")
        return self

    @property
    def _checked_path(self):
        read_stl(self.path)
        return self.path

    def _read(self):
        if self.mesh is not None:
            return closed_mesh(*self.mesh, 0.0, "the mesh made in code", "MESH made in code")
        return closed_mesh(*read_stl(self.path), 0.0, f"the mesh in {self.path}", f"MESH {self.stl}")

    def _write(self, target):
        if self.mesh is None:
            super()._write(target)
        else:
            target.write_bytes(stl_of_corners(np.asarray(self.mesh[0])[np.asarray(self.mesh[1])]))


class StockBox(Box):
    """A rectangular billet, part coordinates."""

    allowance_mm: float | None = Field(default=None, description="it is the box round the part and so much: where a design states "
                                       "no stock of its own")

    @model_validator(mode="after")
    def _has_volume(self):
        if any(b <= a for a, b in zip(self.min_mm, self.max_mm)):
            raise ValueError(f"stock box has no volume: {self.min_mm} .. {self.max_mm}")
        return self

    @model_serializer(mode="wrap")
    def _only_what_it_says(self, dump):
        return {k: v for k, v in dump(self).items() if (k, v) != ("allowance_mm", None)}


class StockCylinder(Cylinder):
    """A turned blank, part coordinates."""


class StockSolid(Solid):
    """A casting or a forging, part coordinates."""


class StockMesh(Mesh):
    """A scanned or sculpted blank, part coordinates."""

    thickest_mm: float | None = Field(default=None, exclude=True, repr=False,
                                      description="in code: no place of it is farther from the part; None: nobody knows")


class StockAllowance(Standing):
    """The box round the part and an allowance on every side."""

    TOLD_BY: ClassVar[str] = "allowance_mm"

    allowance_mm: float | None = Field(default=None, ge=0, le=FAR_MM, description="None: what the shop takes")


class StockSkin(Standing):
    """The part's own form and so much more on all sides: a casting or a forging near to its shape."""

    TOLD_BY: ClassVar[str] = "skin_mm"

    skin_mm: float = Field(gt=0, le=100, description="thickness over every face; less than every inner radius")


Stock = one_of(StockBox, StockCylinder, StockSolid, StockMesh, StockAllowance, StockSkin)


def settled(stock, part, practice):
    """The stock a part is cut from: as stated, or the box round the part and its allowance.

    Args:
        stock: any of the above.   part: TopoDS solid.   practice: shop.practice.Practice, asked where the design is silent.
    """
    if isinstance(stock, StockSkin):
        return _skinned(stock, part)
    if not isinstance(stock, StockAllowance):
        return stock
    from cuspline.kernel import brep
    allowance = practice.stock_allowance_mm if stock.allowance_mm is None else stock.allowance_mm
    low, high = brep.bounding_box_mm(part)
    corner = lambda place: tuple(np.round(place, 6).tolist())
    return StockBox(min_mm=corner(low - allowance), max_mm=corner(high + allowance), allowance_mm=allowance)


def _skinned(stock, part):
    """StockMesh of a part with a skin.

    Raises:
        DesignError: an inner corner is tighter than the skin is thick.
    """
    from cuspline.kernel.skin import skin_round
    from cuspline.kernel.tessellation import tessellate
    mesh = tessellate(part, min(SKIN_SHARE * stock.skin_mm, SKIN_MM))
    outside = [skin_round(mesh.vertices_mm, mesh.triangles, share * (stock.skin_mm + mesh.deviation_mm)) for share in (1.0, OVER)]
    off = outside[0] - mesh.vertices_mm                 # facet by facet: what lies between corners is no farther
    made = StockMesh(mesh=(outside[0], mesh.triangles),
                     thickest_mm=float(np.sqrt((off ** 2).sum(axis=1)).max()) + mesh.deviation_mm)
    corners = mesh.vertices_mm[mesh.triangles]
    met = made.shape.holds(outside[1][mesh.triangles].mean(axis=1))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if area[met].sum() > MET_SHARE * area.sum():        # less is a crease in a tight corner, which is filled
        place = " ".join(f"{axis}{v:.3f}" for axis, v in zip("XYZ", corners[(met * area).argmax()].mean(axis=0)))
        raise DesignError(f"stock: a skin of {stock.skin_mm:g} mm round the part meets itself at {place}: the part is too narrow "
                          "there; make it thinner, or give the casting as STEP")
    return made


def stock_in_words(stock):
    """What a stock is, for a header: nothing of a box, which its corners tell."""
    if isinstance(stock, StockBox):
        return "" if stock.allowance_mm is None else f"BOX ROUND THE PART AND {stock.allowance_mm:g}"
    return stock.shape.in_words()
