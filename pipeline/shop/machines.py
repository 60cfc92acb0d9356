"""Machines as TOML files: travels, speeds, accelerations, and what the control can take."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_serializer, model_validator

from cuspline.values.input_files import checked, toml_of
from cuspline.values.models import Coordinate, Model, Point
from cuspline.values.units import MM


class LinearAxis(Model):
    """One linear axis in machine coordinates."""

    min_mm: Coordinate
    max_mm: Coordinate
    rapid_mm_per_min: float = Field(gt=0, description="largest axis speed")
    acceleration_mm_per_s2: float = Field(gt=0)

    @model_validator(mode="after")
    def _travel_is_positive(self):
        if self.max_mm <= self.min_mm:
            raise ValueError(f"max_mm {self.max_mm} must exceed min_mm {self.min_mm}")
        return self


class Spindle(Model):
    min_rpm: float = Field(gt=0)
    max_rpm: float = Field(gt=0)


class Control(Model):
    """What the controller accepts."""

    post: str = Field(description="name of the post in posts/writers, or its .py file, seen from the machine's")
    units: Literal["mm", "inch"] = "mm"
    decimals_mm: int = Field(default=4, ge=1, le=6)
    decimals_inch: int = Field(default=5, ge=1, le=7)
    decimals_feed: int = Field(default=1, ge=0, le=3)
    line_length: int = Field(default=252, ge=40, description="longest block the control takes, characters")
    program_store_bytes: int = Field(gt=0)
    sub_programs: bool = Field(default=True, description="repeated passes as sub-programs and calls; false: move by move")
    path_tolerance_mm: float = Field(gt=0, description="how far the control may leave the path: half of it "
                                     "goes out as LinuxCNC's G64 P, whose blends take up to twice that; what is set in a "
                                     "Fanuc control for G64 (corners, smoothing)")
    arc_max_radius_mm: float = Field(default=1e4, gt=0, description="flatter arcs go out as lines")
    arc_min_length_mm: float = Field(default=1e-3, gt=0, description="shorter arcs go out as lines")

    @model_serializer(mode="wrap")
    def _without_what_is_usual(self, dump):
        """Only a control that is to have no sub-programs says so where a machine is written out."""
        return {k: v for k, v in dump(self).items() if (k, v) != ("sub_programs", True)}

    @property
    def decimals(self):
        """Of a length, in the control's units."""
        return self.decimals_mm if self.units == "mm" else self.decimals_inch

    @property
    def resolution_mm(self):
        """One step of the last decimal of a length, mm."""
        return MM[self.units] / 10 ** self.decimals


class Machine(Model):
    """A three-axis mill, spindle along Z."""

    name: str
    description: str
    x: LinearAxis
    y: LinearAxis
    z: LinearAxis
    spindle: Spindle
    time_constant_s: float = Field(gt=0, description="first-order lag of the axis drives")
    max_feed_mm_per_min: float = Field(gt=0)
    tool_change_s: float = Field(ge=0)
    table_z_mm: Coordinate = Field(description="table top, machine coordinates")
    wcs_origin_mm: Point = Field(
        description="where G54 is expected, machine coordinates of the spindle nose")
    tool_change_z_mm: float | None = Field(
        default=None, description="lowest spindle nose at which a tool is changed, machine coordinates; left out: where "
        "G53 Z0 and G28 lead, or the top of the travel where that is lower")
    stop_clearance_mm: float = Field(
        default=25.0, ge=0, description="tip above stock and fixtures where the program stops or ends below the tool change")
    rapid_clearance_mm: float = Field(
        default=0.5, ge=0, description="least height of a rapid above the stock; straight up it may leave the cut")
    spindle_head: tuple[tuple[float, float], ...] = Field(
        default=(), description="(height_mm, diameter_mm) of cylinders above the holder's top, from below, that must not touch")
    control: Control

    @model_validator(mode="after")
    def _head_has_size(self):
        if any(not size > 0 for segment in self.spindle_head for size in segment):
            raise ValueError("every segment of spindle_head has a height and a diameter above 0")
        return self

    @property
    def axes(self):
        return (self.x, self.y, self.z)

    @property
    def tool_change_height_mm(self):
        """Lowest spindle nose at a tool change, machine coordinates."""
        if self.tool_change_z_mm is not None:
            return self.tool_change_z_mm
        return min(self.z.max_mm, max(self.z.min_mm, 0.0))


def machine_from_toml(path):
    """Read a machine file.

    Raises:
        InputError: missing, broken TOML, or values out of range; names every key that is wrong.
    """
    machine = checked(Machine, toml_of(path, "machine file"), f"machine file {path}")
    if not machine.control.post.endswith(".py"):
        return machine
    post = str(Path(path).parent / machine.control.post)
    return machine.model_copy(update={"control": machine.control.model_copy(update={"post": post})})
