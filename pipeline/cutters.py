r"""Cutters, holders and the shop's library: validated, every length with its unit.

    z                    ┌──────┐
    │                    │holder│   holder segments, from the nose upward
    │                    └┐    ┌┘ ← stick_out_mm
    │                     │shank│   shank_diameter_mm
    │                     └┐  ┌┘  ← reach_mm
    │                      │neck│   neck_diameter_mm
    │                      ├──┤   ← flute_length_mm
    └─── 0                 \__/     tip; corner_radius_mm
"""

import json
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from cuspline.errors import InputError


class Model(BaseModel):
    """Frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class HolderSegment(Model):
    """A cone frustum of the holder, stacked upward from the nose."""

    height_mm: float = Field(gt=0, description="length along the axis")
    lower_diameter_mm: float = Field(gt=0)
    upper_diameter_mm: float = Field(gt=0)


class Holder(Model):
    """A tool holder: revolved segments from its nose upward."""

    name: str
    segments: tuple[HolderSegment, ...] = Field(min_length=1)


class Cutter(Model):
    """An end mill of revolution about the tool axis; z = 0 at the tip."""

    name: str
    type: Literal["ball", "bull_nose", "flat"]
    diameter_mm: float = Field(gt=0)
    corner_radius_mm: float = Field(ge=0, description="0 flat, diameter/2 ball")
    flutes: int = Field(ge=1)
    flute_length_mm: float = Field(gt=0)
    neck_diameter_mm: float = Field(gt=0)
    reach_mm: float = Field(gt=0, description="tip to where the neck ends and the shank begins")
    shank_diameter_mm: float = Field(gt=0)
    overall_length_mm: float = Field(gt=0)

    @model_validator(mode="after")
    def _shape_is_consistent(self):
        half = self.diameter_mm / 2
        wanted = {"ball": half, "flat": 0.0}.get(self.type)
        if wanted is not None and abs(self.corner_radius_mm - wanted) > 1e-9:
            raise ValueError(f"a {self.type} cutter of diameter {self.diameter_mm} mm has corner_radius_mm {wanted}")
        if self.type == "bull_nose" and not 0 < self.corner_radius_mm < half:
            raise ValueError("a bull_nose cutter has 0 < corner_radius_mm < diameter/2")
        if self.neck_diameter_mm > self.diameter_mm + 1e-9:
            raise ValueError("neck_diameter_mm must not exceed diameter_mm")
        if not self.corner_radius_mm <= self.flute_length_mm <= self.reach_mm < self.overall_length_mm:
            raise ValueError("lengths must satisfy corner radius <= flute_length <= reach < overall_length")
        return self

    @property
    def radius_mm(self):
        return self.diameter_mm / 2


class Tool(Model):
    """A cutter in its holder, as it stands in the magazine."""

    number: int = Field(ge=1, le=99999)
    cutter: Cutter
    holder: Holder
    stick_out_mm: float = Field(gt=0, description="tip to holder nose")

    @model_validator(mode="after")
    def _stick_out_is_possible(self):
        if not self.cutter.flute_length_mm <= self.stick_out_mm < self.cutter.overall_length_mm:
            raise ValueError("stick_out_mm must lie between flute_length_mm and overall_length_mm")
        return self

    def non_cutting_frusta(self):
        """(k, 4) frusta (z0_mm, radius0_mm, z1_mm, radius1_mm) above the tip that must never touch.

        Neck and shank as far as they leave the holder, then the holder's segments.
        """
        c, rows = self.cutter, []
        neck_end = min(c.reach_mm, self.stick_out_mm)
        if neck_end > c.flute_length_mm:
            rows.append((c.flute_length_mm, c.neck_diameter_mm / 2, neck_end, c.neck_diameter_mm / 2))
        if self.stick_out_mm > neck_end:
            rows.append((neck_end, c.shank_diameter_mm / 2, self.stick_out_mm, c.shank_diameter_mm / 2))
        z = self.stick_out_mm
        for s in self.holder.segments:
            rows.append((z, s.lower_diameter_mm / 2, z + s.height_mm, s.upper_diameter_mm / 2))
            z += s.height_mm
        return np.array(rows)

    @property
    def length_mm(self):
        """Tool length offset: holder gauge line (top of its last segment) to tip."""
        return self.stick_out_mm + sum(s.height_mm for s in self.holder.segments)


class ToolLibrary(Model):
    """The shop's tools."""

    tools: tuple[Tool, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _numbers_are_unique(self):
        numbers = [t.number for t in self.tools]
        twice = sorted({n for n in numbers if numbers.count(n) > 1})
        if twice:
            raise ValueError(f"tool numbers used twice: {twice}")
        return self

    def of_type(self, *types):
        """Tools of the given cutter types, largest diameter first."""
        found = [t for t in self.tools if t.cutter.type in types]
        return sorted(found, key=lambda t: (-t.cutter.diameter_mm, t.number))

    def number(self, number):
        """The tool with that number.

        Raises:
            InputError: there is none.
        """
        for t in self.tools:
            if t.number == number:
                return t
        raise InputError(f"tool T{number} is not in the library; it holds "
                         + ", ".join(f"T{t.number}" for t in self.tools))


def library_from_json(path):
    """Read a tool library file.

    Raises:
        InputError: missing, broken or inconsistent; names the tool and the key.
    """
    path = Path(path)
    try:
        return ToolLibrary.model_validate(json.loads(path.read_text()))
    except FileNotFoundError:
        raise InputError(f"tool library {path} does not exist") from None
    except (ValidationError, ValueError) as error:
        raise InputError(f"tool library {path}: {first_complaint(error)}") from None


def first_complaint(error):
    """One line out of a pydantic or parser error: where, what, and the value given."""
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        where = ".".join(str(p) for p in first["loc"])
        given = "" if isinstance(first["input"], dict) else f" (given: {first['input']!r})"
        return f"{where}: {first['msg']}{given}" if where else first["msg"]
    return " ".join(str(error).split())
