r"""Threads by their sizes: pitch, the limits of an internal thread of the usual class, the drill for its tap.

         |<----- D ----->|       D   nominal (major) diameter
          \_|       |_/          D2  pitch diameter = D - 0.649519 P
            |<-D1 ->|            D1  minor diameter = D - 1.082532 P: the hole's, before the thread is cut

Metric: coarse and fine pitches of ISO 261 and ISO 262, basic sizes of ISO 724, tolerances of class 6H of ISO 965-1 at normal
length of engagement.  Unified: series UNC and UNF of ASME B1.1, class 2B by its formulas, the length of engagement one diameter.
"""

import math
import re
from dataclasses import dataclass
from typing import Literal

from pydantic import Field, field_validator, model_serializer, model_validator

from cuspline.values import fixed_math as fixed
from cuspline.values.models import Model
from cuspline.values.units import MM

PITCH_SHARE = 0.649519      # 3 sqrt(3) / 8: how much of the pitch the pitch diameter is below the nominal one
MINOR_SHARE = 1.082532      # 5 sqrt(3) / 8: the same of the minor diameter
CLASS_2B = 1.3              # times the tolerance of class 2A
RUN_OUT = 5.0               # pitches at the end of a blind hole that get no full thread, where nobody states the depth
LARGE_IN = 0.25             # from here on another formula holds for the minor diameter

COARSE_MM = {1.6: 0.35, 2: 0.4, 2.5: 0.45, 3: 0.5, 3.5: 0.6, 4: 0.7, 5: 0.8, 6: 1, 7: 1, 8: 1.25, 10: 1.5, 12: 1.75, 14: 2,
             16: 2, 18: 2.5, 20: 2.5, 22: 2.5, 24: 3, 27: 3, 30: 3.5, 33: 3.5, 36: 4}
FINE_MM = {3: (0.35,), 3.5: (0.35,), 4: (0.5,), 5: (0.5,), 6: (0.75,), 8: (0.75, 1), 10: (0.75, 1, 1.25), 12: (1, 1.25, 1.5),
           14: (1.25, 1.5), 16: (1, 1.5), 18: (1, 1.5, 2), 20: (1, 1.5, 2), 22: (1, 1.5, 2), 24: (1, 1.5, 2), 27: (1.5, 2),
           30: (1.5, 2, 3), 33: (1.5, 2), 36: (1.5, 2, 3)}
# pitch -> tolerance of D1, class 6, um: ISO 965-1, table 2
MINOR_UM = {0.35: 100, 0.4: 112, 0.45: 125, 0.5: 140, 0.6: 160, 0.7: 180, 0.75: 190, 0.8: 200, 1: 236, 1.25: 265, 1.5: 300,
            1.75: 335, 2: 375, 2.5: 450, 3: 500, 3.5: 560, 4: 600}
# nominal diameter up to -> {pitch: tolerance of D2, class 6, um}: ISO 965-1, table 4
PITCH_UM = {2.8: {0.35: 85, 0.4: 90, 0.45: 95}, 5.6: {0.35: 90, 0.5: 100, 0.6: 112, 0.7: 118, 0.75: 118, 0.8: 125},
            11.2: {0.75: 132, 1: 150, 1.25: 160, 1.5: 180},
            22.4: {1: 160, 1.25: 180, 1.5: 190, 1.75: 200, 2: 212, 2.5: 224},
            45.0: {1: 170, 1.5: 200, 2: 224, 3: 265, 3.5: 280, 4: 300}}
# name -> nominal diameter in inches, and threads an inch of the series: ASME B1.1, table of the standard series
UNIFIED_IN = {"#4": (0.112, 40, 48), "#6": (0.138, 32, 40), "#8": (0.164, 32, 36), "#10": (0.19, 24, 32), "1/4": (0.25, 20, 28),
              "5/16": (0.3125, 18, 24), "3/8": (0.375, 16, 24), "7/16": (0.4375, 14, 20), "1/2": (0.5, 13, 20),
              "9/16": (0.5625, 12, 18), "5/8": (0.625, 11, 18), "3/4": (0.75, 10, 16), "7/8": (0.875, 9, 14), "1": (1.0, 8, 12)}
SERIES = ("UNC", "UNF")
METRIC = re.compile(r"M(\d+(?:\.\d+)?)(?:\s*[xX]\s*(\d+(?:\.\d+)?))?")
UNIFIED = re.compile(r"(#?\d+(?:/\d+)?)-(\d+)(?:\s+(UNC|UNF))?")


@dataclass(frozen=True, kw_only=True)
class ThreadForm:
    """What a thread's size says, millimetres."""

    name: str               # "M6x1", "1/4-20 UNC"
    nominal_mm: float
    pitch_mm: float
    minor_tolerance_mm: float
    pitch_tolerance_mm: float

    @property
    def minor_mm(self):
        """(least, largest) diameter of the hole before the thread is cut."""
        least = self.nominal_mm - MINOR_SHARE * self.pitch_mm
        return least, least + self.minor_tolerance_mm

    @property
    def pitch_diameter_mm(self):
        """(least, largest) diameter at which thread and gap are as wide as each other."""
        least = self.nominal_mm - PITCH_SHARE * self.pitch_mm
        return least, least + self.pitch_tolerance_mm

    @property
    def tap_drill_mm(self):
        """Diameter of the drill for a tap: the nominal one less the pitch."""
        return self.nominal_mm - self.pitch_mm


def thread_form(size):
    """ThreadForm of a size.

    Args:
        size: "M6", "M8x1", "1/4-20 UNC", "#10-32".
    Raises:
        ValueError: no size of the tables; says which pitches there are.

    >>> form = thread_form("M6")
    >>> form.pitch_mm, form.tap_drill_mm, [round(v, 3) for v in (*form.minor_mm, *form.pitch_diameter_mm)]
    (1.0, 5.0, [4.917, 5.153, 5.35, 5.5])
    """
    text = " ".join(size.split())
    if found := METRIC.fullmatch(text):
        return _metric(size, float(found[1]), None if found[2] is None else float(found[2]))
    if (found := UNIFIED.fullmatch(text)) and found[1] in UNIFIED_IN:
        return _unified(size, found[1], int(found[2]), found[3])
    raise ValueError(f"thread {size!r} is not known: write M6, M8x1, 1/4-20 UNC or #10-32 UNF")


def _metric(size, nominal, pitch):
    if nominal not in COARSE_MM:
        raise ValueError(f"thread {size!r}: no nominal diameter of the table, which has {', '.join(f'M{d:g}' for d in COARSE_MM)}")
    pitches = (COARSE_MM[nominal], *FINE_MM.get(nominal, ()))
    pitch = pitches[0] if pitch is None else pitch
    if pitch not in pitches:
        raise ValueError(f"thread {size!r}: M{nominal:g} has the pitches {', '.join(f'{p:g}' for p in pitches)} mm")
    by_pitch = next(row for most, row in PITCH_UM.items() if nominal <= most)
    return ThreadForm(name=f"M{nominal:g}x{pitch:g}", nominal_mm=nominal, pitch_mm=float(pitch),
                      minor_tolerance_mm=MINOR_UM[pitch] / 1000, pitch_tolerance_mm=by_pitch[pitch] / 1000)


def _unified(size, name, per_inch, series):
    d, *standard = UNIFIED_IN[name]
    if per_inch not in standard or series not in (None, SERIES[standard.index(per_inch)]):
        raise ValueError(f"thread {size!r}: {name} is {name}-{standard[0]} UNC or {name}-{standard[1]} UNF")
    p, inch = 1.0 / per_inch, MM["inch"]
    pitch_2a = 0.0015 * fixed.cbrt(d) + 0.0015 * math.sqrt(d) + 0.015 * fixed.cbrt(p * p)
    large = 0.25 * p - 0.4 * p * p
    minor = large if d >= LARGE_IN else min(max(0.05 * fixed.cbrt(p * p) + 0.03 * p / d - 0.002, large), 0.394 * p)
    return ThreadForm(name=f"{name}-{per_inch} {SERIES[standard.index(per_inch)]}", nominal_mm=d * inch, pitch_mm=p * inch,
                      minor_tolerance_mm=round(minor * inch, 4), pitch_tolerance_mm=round(CLASS_2B * pitch_2a * inch, 4))


class Thread(Model):
    """A thread that holes get; the solid has their plain walls, as wide as the drill for the tap."""

    size: str = Field(description="M6, M8x1, 1/4-20 UNC, #10-32 UNF")
    depth_mm: float | None = Field(default=None, gt=0, le=500, description="full thread from the mouth of the wall; left out: all "
                                   f"of a through hole, of a blind one all but {RUN_OUT:g} pitches")
    hand: Literal["right", "left"] = "right"

    @model_validator(mode="before")
    @classmethod
    def _by_its_size(cls, said):
        return {"size": said} if isinstance(said, str) else said

    @field_validator("size")
    @classmethod
    def _is_known(cls, size):
        thread_form(size)
        return size

    @model_serializer(mode="wrap")
    def _only_what_it_says(self, dump):
        return {k: v for k, v in dump(self).items() if v is not None}

    @property
    def form(self):
        """ThreadForm."""
        return thread_form(self.size)

    def depth_in(self, wall_mm, is_open):
        """Depth of the full thread in a wall of a height; `is_open`: the tool may come out below."""
        if self.depth_mm is not None:
            return self.depth_mm
        return wall_mm if is_open else wall_mm - RUN_OUT * self.form.pitch_mm

    @property
    def sign(self):
        """1 of a right-hand thread, -1 of a left-hand one."""
        return 1 if self.hand == "right" else -1

    @property
    def in_words(self):
        """For messages.

        >>> Thread(size="M8x1", hand="left").in_words
        'M8x1 left-hand'
        """
        return self.form.name + (" left-hand" if self.hand == "left" else "")
