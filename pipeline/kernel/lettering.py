"""Lines to engrave: text as the outlines of its letters, by the CAD kernel's own font routine, and borders of faces.

Where no font is given it is the DejaVu Sans that comes with matplotlib: the same letters on every machine.
"""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Font import Font_FA_Regular, Font_FontMgr
from OCP.GCPnts import GCPnts_TangentialDeflection
from OCP.NCollection import NCollection_Utf8String
from OCP.StdPrs import StdPrs_BRepFont, StdPrs_BRepTextBuilder
from OCP.TopAbs import TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

USUAL = "mpl-data/fonts/ttf/DejaVuSans.ttf"         # beside matplotlib, which the report needs anyway
TURN_RAD = 0.5              # between chords of a curve, at most


def text_outlines(text, height_mm, tolerance_mm, font_path=None):
    """Closed lines round all letters, from the origin to +X.

    Args:
        text: one line.   height_mm: the font's size.   tolerance_mm: between a curve and its chords.
        font_path: a font's file; None: DejaVu Sans.
    Returns:
        (list of (n, 2), name of the font).
    Raises:
        DesignError: the file is no font, it lacks a letter, or the text has no outline.
    """
    file = usual_font() if font_path is None else Path(font_path)
    font = Font_FontMgr.GetInstance_s().CheckFont(str(file)) if file.is_file() else None
    if font is None:
        raise DesignError(f"{file} is no font that can be read: give font_path a .ttf or .otf file")
    path = font.FontPath(Font_FA_Regular).ToCString()
    if lacking := missing_letters(text, path):
        raise DesignError(f"the text {text!r} has letters that {font.FontName().ToCString()} has not: "
                          f"{', '.join(map(repr, lacking))}: write others, or give font_path a font that has them")
    shape = StdPrs_BRepTextBuilder().Perform(StdPrs_BRepFont(NCollection_Utf8String(path), float(height_mm)),
                                             NCollection_Utf8String(text))
    name, lines = font.FontName().ToCString(), [line[:, :2] for line in lines_of(shape, tolerance_mm)]
    if not lines:
        raise DesignError(f"the text {text!r} has no outline in {name}: write letters that the font has")
    return lines, name


def usual_font():
    """Path of the font where none is given."""
    return Path(find_spec("matplotlib").origin).parent / USUAL


def missing_letters(text, path):
    """Letters of a text that a font's file does not have, each once."""
    from matplotlib.ft2font import FT2Font
    there = FT2Font(str(path)).get_charmap()
    return [c for c in dict.fromkeys(text) if ord(c) not in there and not c.isspace()]


def lines_of(shape, tolerance_mm):
    """[(n, 3)] along every wire of a shape, closed ones ending where they begin."""
    lines, explorer = [], TopExp_Explorer(shape, TopAbs_WIRE)
    while explorer.More():
        parts, edges = [], BRepTools_WireExplorer(TopoDS.Wire_s(explorer.Current()))
        while edges.More():
            points = _edge_points(edges.Current(), tolerance_mm)
            parts.append(points if not parts else points[1:])
            edges.Next()
        if parts:
            lines.append(np.vstack(parts))
        explorer.Next()
    return lines


def _edge_points(edge, tolerance_mm):
    found = GCPnts_TangentialDeflection(BRepAdaptor_Curve(edge), TURN_RAD, tolerance_mm)
    places = [found.Value(k) for k in range(1, found.NbPoints() + 1)]
    points = np.array([(p.X(), p.Y(), p.Z()) for p in places])
    return points[::-1] if edge.Orientation() == TopAbs_REVERSED else points


def spread(points, spacing_mm):
    """A polyline (n, k) with places no farther apart than that."""
    out = [points[:1]]
    for a, b in zip(points, points[1:]):
        count = max(1, int(np.ceil(float(fixed.length(b - a)) / spacing_mm)))
        out.append(a + (np.arange(1, count + 1) / count)[:, None] * (b - a))
    return np.vstack(out)
