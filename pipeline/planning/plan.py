"""The plan: operations of each setup with cutters, steps, feeds and the moves they came to.

Order: rough, semi-finish where roughing leaves too much, finish, and rest passes with smaller balls
where the finishing ball cannot go.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.planning.context import (
    ROUGH_ALLOWANCE_MM,
    SEMI_ALLOWANCE_MM,
    SEMI_SCALLOP_MM,
    PlannedOperation,
    Shop,
    ridge_for_step_mm,
)
from cuspline.planning.cutter_choice import choose_ball, choose_rest_ball
from cuspline.planning.finishing_chain import choose_finishing
from cuspline.planning.strategies import freeform, sections, transverse_arcs
from cuspline.planning.strategies.roughing import roughed
from cuspline.program.program import Operation, Program
from cuspline.surfaces.inner_corners import inner_edges
from cuspline.values.errors import CutterDoesNotFit


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupPlan:
    """One setup's operations and what they rest on."""

    setup: object               # design.Setup
    operations: tuple[PlannedOperation, ...]
    clearance_z_mm: float
    hollow: object              # surfaces.curvature.Hollow
    inner_edges: tuple
    area_required_mm2: float
    area_reached_mm2: float
    shop: Shop                  # that it was planned with
    mending: tuple = ()         # what checks found and what was done about it, for plan.json

    def program(self, header, name):
        """The controller-free Program, in the setup's WCS."""
        turn, frame = self.setup.turn, self.setup.frame
        into = lambda points: frame.into(turn.out(points))
        zero = turn.into(frame.origin_mm[None])[0]
        return Program(
            name=name, setup=self.setup.name, wcs=self.setup.wcs, wcs_in_words=self.setup.wcs_in_words,
            clearance_z_mm=float(self.clearance_z_mm - zero[2]), header=tuple(header),
            operations=tuple(Operation(name=o.name, tool=o.tool, spindle_rpm=o.rpm, coolant=o.coolant,
                                       moves=_moved(o.moves, into), passes=_shifted(o.passes, into))
                             for o in self.operations))


def _by_sections(shop):
    """Operations in section planes: one ball that fits everywhere, and the smallest where it is held off."""
    finish, work = shop.design.finish, shop.finishing_work()
    ball, candidates, reach = choose_ball(shop.finishing_library, shop.samples, shop.hollow.radius_mm, shop.mesh,
                                          ROUGH_ALLOWANCE_MM, work)
    semi = lambda: sections.finish(shop, "semi-finish", ball, SEMI_ALLOWANCE_MM, SEMI_SCALLOP_MM, (), reach)
    operations = roughed(shop, ball, reach.is_reached, semi)
    operations.append(sections.finish(shop, "finish", ball, 0.0, finish.scallop_mm, candidates, reach))
    rest, candidates, adds = choose_rest_ball(shop.library, shop.samples, reach, shop.mesh, ball.cutter.radius_mm,
                                              ROUGH_ALLOWANCE_MM)
    if rest is not None:
        operations.append(sections.rest(shop, ball, rest, candidates))
    return operations, reach.is_reached | adds


def _free_form(shop):
    """Operations over regions: the fastest chain of balls, each smaller one where the one before leaves too much."""
    chain, candidates, reached = choose_finishing(shop.finishing_library, shop.samples, shop.mesh, ROUGH_ALLOWANCE_MM,
                                                  shop.finishing_work())
    tools = [link.tool for link in chain]
    semi = lambda: freeform.finish(shop, "semi-finish", tools[0], SEMI_ALLOWANCE_MM, SEMI_SCALLOP_MM, ())
    operations = roughed(shop, tools[0], chain[0].adds, semi)
    scallop_mm = shop.design.finish.scallop_mm
    finishing = [freeform.finish(shop, "finish", tools[0], 0.0, scallop_mm, candidates)]
    for tool in tools[1:]:
        rest = freeform.rest(shop, finishing, tool, candidates)
        finishing += [rest] if rest is not None else []
    return operations + finishing, reached


def _placed(found, setup):
    """The same, its place in part coordinates."""
    return replace(found, place_mm=tuple(setup.turn.out(np.array(found.place_mm)[None])[0].tolist()))


def _moved(moves, into):
    return replace(moves, start_mm=into(moves.start_mm), end_mm=into(moves.end_mm), center_mm=into(moves.center_mm))


def _shifted(passes, into):
    """Templated passes seen from the WCS, which lies as the part does in its setup."""
    return passes and passes.shifted(into(np.zeros((1, 3)))[0])


def plan_setup(design, setup, machine, library, before=None):
    """Plan one setup.

    Args:
        design: Design.
        setup: one of its setups.
        machine: Machine.
        library: ToolLibrary.
        before: stock.workpiece.Workpiece that earlier setups leave; None: the stock as delivered.
    Returns:
        SetupPlan; places in part coordinates.
    Raises:
        PlanError, CutterDoesNotFit, ToolpathError: what cannot be done, where, and how to mend it.
    """
    for name, scallop_mm in (("semi-finish", SEMI_SCALLOP_MM), ("finish", design.finish.scallop_mm)):
        ridge_for_step_mm(name, scallop_mm, design.finish)
    shop = Shop(design, setup, machine, library, before)
    cut = {"sections": _by_sections, "transverse_arcs": transverse_arcs.operations}.get(setup.strategy, _free_form)
    try:
        operations, reached = cut(shop)
    except CutterDoesNotFit as error:
        where = design.where(_placed(shop.hollow, setup).place_mm)
        raise CutterDoesNotFit(f"{where}: {error}" if where else str(error), rows=error.rows) from None
    return SetupPlan(setup=setup, operations=tuple(operations), clearance_z_mm=shop.clearance_z_mm,
                     hollow=_placed(shop.hollow, setup), inner_edges=tuple(
                         _placed(e, setup) for e in inner_edges(shop.faces, set(shop.wanted))),
                     area_required_mm2=float(shop.samples.area_mm2.sum()),
                     area_reached_mm2=float(shop.samples.area_mm2[reached].sum()), shop=shop)
