"""The plan: operations of each setup with cutters, steps, feeds and the moves they came to.

A setup's operations are planned in the order in which they stand, each on the stock that those before it leave; a
setup that lists none is cut by `Auto`.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.design.operations import Clearing
from cuspline.planning.context import PlannedOperation, PlanningContext, left_as_steep
from cuspline.planning.level_finishing import UPRIGHT
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.tip_orders import with_tip_out
from cuspline.program.arcs import CHORD_SHARE, straightened
from cuspline.program.program import Operation, Program
from cuspline.shop.practice import ShopFile
from cuspline.surfaces.inner_corners import inner_edges
from cuspline.values.errors import CutterDoesNotFit
from cuspline.values.findings import Finding

MILLS = ("flat", "bull_nose", "ball")       # what leaves its own radius in a corner


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
    context: PlanningContext    # of the setup, that it was planned with
    accounts: tuple = ()        # Account of every operation that the setup lists
    mending: tuple = ()         # what checks found and what was done about it, for plan.json

    @property
    def idle(self):
        """Finding of every listed operation for which nothing was left to cut.

        Clearing that comes first and finds the stock near to the part's shape is none: such is the blank.  Nor is a rest
        operation whose tool nobody has named, where the one before has left nothing.
        """
        first = next((k for k, a in enumerate(self.accounts) if a.programmed), len(self.accounts))
        return tuple(Finding(kind="idle_operation", amount_mm=0.0, place_mm=None, operation=a.operation.title, line=0,
                             setup=self.setup.name, advice=f"{a.why}: leave it out, or choose other faces or a smaller tool")
                     for k, a in enumerate(self.accounts)
                     if not a.programmed and not a.operation.may_be_idle
                     and not (k < first and isinstance(a.operation, Clearing)))

    def radius_left_mm(self, edge):
        """What its smallest mill leaves in an inner edge: its radius along the tool, its corner's across; None: it has none."""
        mills = [o.tool.cutter for o in self.operations if o.tool.cutter.type in MILLS]
        stands = all(abs(float(self.context.faces[i].middle.normal[0, 2])) < UPRIGHT for i in edge.faces)
        return min((round(c.radius_mm if stands else c.corner_radius_mm, 6) for c in mills), default=None)

    @property
    def is_mended(self):
        """Whether what stands too high gets clean-up passes."""
        return all(o.is_mended for o in self.setup.operations)

    def program(self, header, name):
        """The controller-free Program of a setup that is clamped for itself, in its WCS."""
        return clamping_program((self,), header, name)

    @property
    def level_mm(self):
        """Height above the WCS's zero, along the position's Z, from which rapids across run."""
        zero = self.setup.turn.into(self.setup.frame.origin_mm[None])[0]
        return float(self.clearance_z_mm - zero[2])


def clamping_program(plans, header, name):
    """The Program of one clamping.

    Args:
        plans: SetupPlan of the setup that holds the part, then those of the indexed positions in its clamping.
    """
    held = plans[0]
    return Program(
        name=name, setup=held.setup.name, wcs=held.setup.wcs, wcs_in_words=held.setup.wcs_in_words,
        clearance_z_mm=held.level_mm, header=tuple(header),
        operations=tuple(_posted_operation(o, plan) for plan in plans for o in plan.operations))


def _posted_operation(planned, plan):
    """An operation seen from its clamping's WCS; in an indexed position its axis leans, and its arcs are chords.

    What the control is to run beside keeps its arcs, about that axis.
    """
    setup, turn = plan.setup, plan.setup.turn
    into = lambda points: setup.clamped_frame.into(turn.out(points))
    same = {"name": planned.name, "tool": planned.tool, "spindle_rpm": planned.rpm, "coolant": planned.coolant,
            "time_s": planned.facts.get("time_s")}
    if not setup.indexed:
        same["rpm_changes"] = planned.rpm_changes
        by_mm = into(np.zeros((1, 3)))[0]
        return Operation(**same, moves=_moved(planned.moves, into), passes=_shifted(planned.passes, into),
                         cycles=tuple(c.shifted(by_mm) for c in planned.cycles),
                         compensated=tuple(c.moved(into) for c in planned.compensated))
    moves, first = straightened(planned.moves, CHORD_SHARE * plan.context.machine.control.path_tolerance_mm)
    axis, first = setup.clamped_frame.turn_into(np.array([setup.wcs_z])), [*first.tolist(), len(moves)]
    said = tuple(replace(c, first=first[c.first], end=first[c.end]) for c in planned.cycles if c.pitch_mm or c.dwell_s)
    return Operation(**same, cycles=said, level_mm=plan.level_mm,
                     compensated=tuple(c.moved(into).among(first) for c in planned.compensated),
                     moves=replace(_moved(moves, into), axis=np.repeat(axis, len(moves), axis=0)),
                     rpm_changes=tuple((first[k], rpm) for k, rpm in planned.rpm_changes))


@dataclass(frozen=True, kw_only=True)
class Account:
    """What one listed operation was to cut and what it reaches."""

    operation: object           # design.operations.Operation
    area_wanted_mm2: float
    area_reached_mm2: float
    programmed: tuple[str, ...]     # names in the program; none: it cuts nothing
    why: str                    # something is left, or nothing was to be done

    def as_dict(self):
        """For plan.json."""
        return {**self.operation.model_dump(mode="json"), "name": self.operation.title, "programmed": list(self.programmed),
                "area_wanted_mm2": round(self.area_wanted_mm2, 3), "area_reached_mm2": round(self.area_reached_mm2, 3),
                "area_left_mm2": round(self.area_wanted_mm2 - self.area_reached_mm2, 3), "why": self.why}


def _placed(found, setup):
    """The same, its place in part coordinates."""
    return replace(found, place_mm=tuple(setup.turn.out(np.array(found.place_mm)[None])[0].tolist()))


def _moved(moves, into):
    return replace(moves, start_mm=into(moves.start_mm), end_mm=into(moves.end_mm), center_mm=into(moves.center_mm))


def _shifted(passes, into):
    """Templated passes seen from the WCS, which lies as the part does in its setup."""
    return passes and passes.shifted(into(np.zeros((1, 3)))[0])


def plan_setup(design, setup, machine, library, before=None, shop=ShopFile(), tolerance_share=1.0):
    """Plan one setup.

    Args:
        design: Design.
        setup: one of its setups.
        machine: Machine.
        library: ToolLibrary.
        before: stock.workpiece.Workpiece that earlier setups leave; None: the stock as it comes.
        shop: shop.practice.ShopFile.
        tolerance_share: of every profile tolerance, that paths keep to.
    Returns:
        SetupPlan; places in part coordinates.
    Raises:
        PlanError, CutterDoesNotFit, ToolpathError: what cannot be done, where, and how to mend it.
    """
    setup = setup if setup.operations else setup.model_copy(update={"operations": (Auto(),)})
    context = PlanningContext(design, setup, machine, library, before, shop, tolerance_share)
    operations, accounts, reached = [], [], np.zeros(len(context.samples.area_mm2), bool)
    for operation in setup.operations:
        work = context.of(operation, operations)
        try:
            made, rows = operation.plan(work)
        except CutterDoesNotFit as error:
            where = design.where(_placed(work.hollow, setup).place_mm)
            raise CutterDoesNotFit(f"{where}: {error}" if where else str(error), rows=error.rows) from None
        rows = rows & ~left_as_steep(operation, work.samples)
        for left in _left_by(made):
            rows = rows & ~left.rows
        operations += made
        accounts.append(_account(operation, work, made, rows))
        reached |= _seen_in(context.samples, work.samples, rows)
    plan = SetupPlan(setup=setup, operations=context.as_cut(operations), clearance_z_mm=context.clearance_z_mm - context.plating_mm,
                     hollow=_placed(context.hollow, setup), inner_edges=tuple(
                         _placed(e, setup) for e in inner_edges(context.faces, set(context.wanted))),
                     area_required_mm2=float(context.samples.area_mm2.sum()),
                     area_reached_mm2=float(context.samples.area_mm2[reached].sum()), context=context,
                     accounts=tuple(accounts))
    return with_tip_out(plan)


def _left_by(made):
    """context.Left of those PlannedOperation values whose axis clears not everything."""
    return [o.left for o in made if o.left is not None]


def _account(operation, work, made, rows):
    area = work.samples.area_mm2
    wanted, reached = float(area.sum()), float(area[rows].sum())
    return Account(operation=operation, area_wanted_mm2=wanted, area_reached_mm2=reached,
                   programmed=tuple(o.name for o in made), why="; elsewhere ".join(_reasons(operation, work.samples, made, rows)))


def _reasons(operation, samples, made, rows):
    """Why samples that are no rows (n,) bool of an operation are left: what it says of itself, then what is in the way."""
    if not made:
        yield "nothing was left to cut"
        return
    unsaid = ~rows
    for left in _left_by(made):
        unsaid = unsaid & ~left.rows
        yield left.why
    steep = left_as_steep(operation, samples)
    if (unsaid & steep).any():
        yield f"steeper than {operation.steepest_deg:g} degrees"
    if (unsaid & ~steep).any():
        yield "other faces, or the holder, keep its cutter off there"


def _seen_in(samples, own, rows):
    """(n,) bool: which of a setup's samples are among those that an operation reaches."""
    if own is samples:
        return rows
    there = {tuple(p) for p in own.point_mm[rows].tolist()}
    return np.array([tuple(p) in there for p in samples.point_mm.tolist()], bool)
