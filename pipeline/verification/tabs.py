"""Tabs that contours were to leave: whether they stand on the simulated stock."""

import numpy as np

from cuspline.stock.workpiece import Workpiece
from cuspline.values.findings import Finding
from cuspline.verification.reporter import rounded

PLACES = 9                  # along, across and up each tab
LACKS_MM = 0.02             # of a tab's height, that is none


def with_left(vertices_mm, triangles, left):
    """(corners (n, 3), triangles (m, 3)) of the design and of what is to be left beside it: no tool is to go there.

    Args:
        left: values with `triangles`, part coordinates: design.tabs.Tab, design.drill_points.DrillPoint.
    """
    for tab in left:
        more, corners = tab.triangles()
        triangles = np.vstack([triangles, corners + len(vertices_mm)])
        vertices_mm = np.vstack([vertices_mm, more])
    return vertices_mm, triangles


def said_of_left(rows, left, radius_mm):
    """Rows of places that are not reached, those at what is to be left with their own reason."""
    boxes = [(one.why, corners.min(axis=0) - radius_mm, corners.max(axis=0) + radius_mm)
             for one, (corners, _) in ((one, one.triangles()) for one in left)]
    why = lambda row: [w for w, low, high in boxes if (row["place_mm"] >= low).all() and (row["place_mm"] <= high).all()]
    return [{**row, "reason": (why(row) or [row["reason"]])[0]} for row in rows]


def standing_tabs(tabs, piece, setups):
    """Rows of verify.json: what stands of each tab in its narrowest part after its setup.

    Args:
        tabs: design.tabs.Tab values.   piece: stock.workpiece.Workpiece after all setups.   setups: their names, in order.
    """
    return tuple(_row(tab, Workpiece(blank=piece.blank, cuts=piece.cuts[:setups.index(tab.setup) + 1])) for tab in tabs)


def _row(tab, piece):
    places = tab.core_places(PLACES)
    stands = piece.is_stock(places.reshape(-1, 3)).reshape(places.shape[:-1])
    # of each column the share that stands from the foot up, without a gap
    least = float(np.cumprod(stands, axis=2).sum(axis=2).min()) / PLACES * tab.height_mm
    return {"setup": tab.setup, "operation": tab.operation, "place_mm": [rounded(v) for v in tab.place_mm.tolist()],
            "width_mm": tab.width_mm, "height_mm": tab.height_mm, "standing_mm": rounded(least),
            "ok": least > tab.height_mm - LACKS_MM}


def tab_findings(rows):
    """One finding each tab that does not stand."""
    return tuple(Finding(kind="tab_cut", amount_mm=rounded(row["height_mm"] - row["standing_mm"]), place_mm=tuple(row["place_mm"]),
                         operation=row["operation"], line=0, setup=row["setup"],
                         advice=f"of the tab of {row['width_mm']:g} x {row['height_mm']:g} mm {row['standing_mm']:g} mm stand: let "
                         "no move go through it, or state tabs where the program leaves them")
                 for row in rows if not row["ok"])
