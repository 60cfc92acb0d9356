"""Keyboard plate: 1.5 mm sheet, square cut-outs of 14 mm with corners of 0.5 mm, a rounded outline."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class Keys(Parameters):
    """Nothing to choose."""


def design(p: Keys) -> Design:
    """Three by two keys."""
    body = cq.Workplane().box(66, 46, 1.5, centered=(True, True, False)).edges("|Z").fillet(3)
    cut = cq.Workplane().rarray(19.05, 19.05, 3, 2).rect(14, 14).extrude(1.5).edges("|Z").fillet(0.5)
    body = body.cut(cut)
    return Design(name="keyboard", description="keyboard plate", parameters=p, solid=body.val(),
                  predicates=(FacePredicate(name="walls", at_least=1, normal=(0, 0, 1), normal_within_deg=91,
                                            center_max_mm=(90, 90, 1.4)),),
                  material="aluminium_6061", stock=StockBox(min_mm=(-35, -25, 0), max_mm=(35, 25, 1.5)),
                  finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
                  setups=(Setup(name="setup-1", faces=("walls",), wcs_in_words="middle, Z0 below"),))
