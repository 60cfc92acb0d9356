"""How deep a tool comes before its holder or shank would touch the part, and a dropper that goes no deeper.

    |  holder  |
    |__________|        z0 above the tip; over a place its tip comes no lower than
        |  |            what stands there within the holder's radius, and a clearance, less z0
     ___|  |___
        (__)
"""

from dataclasses import replace

import numpy as np

from cuspline.shop.cutters import cylinders_of
from cuspline.toolpaths.contact.contacts import NO_FACE
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm, is_held_above
from cuspline.toolpaths.drop.droppers import Dropper

HOLDER_CLEARANCE_MM = 1.0
SHANK_CLEARANCE_MM = 0.05
CLEARANCES_MM = np.array([SHANK_CLEARANCE_MM, HOLDER_CLEARANCE_MM])     # of neck and shank, and of the holder and all above it
ROUNDING_MM = 1e-9          # heights that differ by less are the same
SOME = 16                   # every so many-th place is looked at first: the rest seldom shows more


def clear_tips_mm(tool, mesh, xy_mm, stock_mm, least_mm=-np.inf, cutter_mm=None):
    """(n,) lowest tips over places (n, 2) at which holder and shank keep clear.

    Args:
        tool: Tool.
        mesh: DropMesh of the part, or of what stands beside it.
        stock_mm: thickness of the material that may still stand on the part.
        least_mm: one or (n,): tips below it do not count, it stands for them; -inf where nothing is in their way.
        cutter_mm: that the cutter itself must keep clear; None: it may touch.
    """
    lowest = np.array(np.broadcast_to(np.asarray(least_mm, float), (len(xy_mm),)))
    for z0, radius, corner, clearance in _rims(tool, stock_mm, cutter_mm):
        higher = is_held_above(mesh, xy_mm, radius, corner, lowest + z0 - clearance)
        tips = drop_tips_mm(mesh, xy_mm[higher], radius, corner) + clearance - z0
        lowest[higher] = np.maximum(lowest[higher], tips)
    return lowest


def is_clear_above(tool, lowest_tip_mm, top_mm, stock_mm, cutter_mm=None):
    """Whether holder and shank, and the cutter too where it must, see `clear_tips_mm`, stay over a height wherever the tip goes."""
    return all(lowest_tip_mm + z0 >= top_mm + clearance for z0, _, _, clearance in _rims(tool, stock_mm, cutter_mm))


def missing_stick_out_mm(tool, tips_mm, mesh, stock_mm, cutter_mm=None):
    """How much deeper the holder and shank would have to clear; 0 where everything is clear.

    Args:
        tool: Tool.
        tips_mm: (n, 3) tip positions it must reach.
        mesh, stock_mm, cutter_mm: see `clear_tips_mm`.
    """
    least = missing_stick_outs_mm(tool, tips_mm[::SOME], mesh, stock_mm, 0.0, cutter_mm).max(initial=0.0)
    return float(missing_stick_outs_mm(tool, tips_mm, mesh, stock_mm, least, cutter_mm).max(initial=0.0))


def missing_stick_outs_mm(tool, tips_mm, mesh, stock_mm, least_mm=0.0, cutter_mm=None):
    """(n,) how much deeper holder and shank would have to clear at each tip position; `least_mm`, one or (n,), where no more."""
    worst = np.full(len(tips_mm), least_mm)
    for z0, radius, corner, clearance in _rims(tool, stock_mm, cutter_mm):
        bottom = tips_mm[:, 2] + z0
        more = is_held_above(mesh, tips_mm[:, :2], radius, corner, bottom - clearance + worst - ROUNDING_MM)
        below = drop_tips_mm(mesh, tips_mm[more, :2], radius, corner)
        worst[more] = np.maximum(worst[more], below + clearance - bottom[more])
    return worst


def too_short(tool, missing_mm):
    """In words, what keeps a tool from where its cutter fits: it may be the neck over short flutes, beside what still stands."""
    lengths = f"flutes {tool.cutter.flute_length_mm:g} mm, stick-out {tool.stick_out_mm:g} mm"
    return f"{missing_mm:.2f} mm too short, neck, shank or holder would touch ({lengths})"


def _rims(tool, stock_mm, cutter_mm=None):
    """(z0, radius, corner radius, clearance) of neck, shank and holder where they are wider than the cutter that goes before
    them, and of the cutter where that must keep clear too; radii as grown by the clearance."""
    cutter = tool.cutter
    if cutter_mm is not None:
        corner = cutter.corner_radius_mm if cutter.largest_radius_mm == cutter.radius_mm else 0.0
        yield 0.0, cutter.largest_radius_mm + cutter_mm, corner + cutter_mm if corner else 0.0, cutter_mm
    for frustum in tool.non_cutting_frusta():
        clearance = stock_mm + (HOLDER_CLEARANCE_MM if frustum[0] >= tool.stick_out_mm - 1e-9 else SHANK_CLEARANCE_MM)
        for z0, radius in cylinders_of(*frustum):
            if radius + clearance > cutter.radius_mm:
                yield z0, radius + clearance, 0.0, clearance


class ShortToolDropper(Dropper):
    """A dropper whose cutter stays up where holder or shank would touch the part: there it touches no face."""

    def __init__(self, dropper, lowest_mm):
        """
        Args:
            dropper: Dropper of the cutter alone.
            lowest_mm: function of places (n, 2) and tips (n,) -> (n,) lowest tips of the whole tool, those tips or above.
        """
        self.radius_mm, self.corner_radius_mm = dropper.radius_mm, dropper.corner_radius_mm
        self.allowance_mm, self._dropper, self._lowest_mm = dropper.allowance_mm, dropper, lowest_mm

    def tips_mm(self, xy_mm):
        return self._lowest_mm(np.asarray(xy_mm, float), self._dropper.tips_mm(xy_mm))

    def contacts(self, xy_mm):
        found = self._dropper.contacts(xy_mm)
        lowest = self._lowest_mm(np.asarray(xy_mm, float), found.tip_z_mm)
        short = lowest > found.tip_z_mm
        at = lambda column, value: np.where(short if column.ndim == 1 else short[:, None], value, column)
        return replace(found, tip_z_mm=at(found.tip_z_mm, lowest), contact_mm=at(found.contact_mm, np.nan),
                       normal=at(found.normal, np.nan), face=at(found.face, NO_FACE), beside=at(found.beside, NO_FACE),
                       is_edge=found.is_edge & ~short)
