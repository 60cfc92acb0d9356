"""In which order passes of a ball run, so that its tip stays out of the cut: step-up or uphill, where that costs little time.

    as laid    the nearest next: up one slope and down the other, where the tip cuts
    step-up    the lowest pass first: the ball cuts beside its tip, on the side of the slope
    uphill     every pass from its lower end, with a lift between two

Taken is the one whose tip cuts least, measured on the stock as it stands, if it frees more of the way than it takes longer;
plan.json says what each costs.
Indexed positions keep their order: what stands there after the positions before is dear to look at, and another may see better.
"""

from dataclasses import replace

from cuspline.planning.by_engagement import as_moves, found_stock
from cuspline.process.cut_of_operations import cuts_of_operations
from cuspline.process.engagement import Look, engagement
from cuspline.program.program import Moves
from cuspline.toolpaths.freeform.tip_links import moves_of_tip_paths

ORDERS = "step-up", "uphill"
MOST_TIME = 1.1             # times as long as laid
WORTH = 0.01                # of the way, by which the tip must cut less
FEW = 4                     # passes: with fewer there is no order to speak of
LOOK = Look(most_places=1200, screened=4, only_tip=True)
# rings as close as the verdict's: thin finishing cuts lie between coarser ones


def other_orders(work, made, runs, link):
    """The same passes in other orders: ((name, times as long, PlannedOperation or None where that is too long), ...).

    Args:
        work: PlanningContext.   made: PlannedOperation as laid.
        runs: (waterlines, paths), lists of TipPath; the waterlines keep their order: below a wall's stock the shank would cut.
        link: TipLinkRules.
    """
    walls, paths = runs
    stands = made.tool.cutter.type == "ball" and work.tool_axis is None and not work.setup.indexed
    if getattr(work.operation, "bearing", None) is not None or not stands or len(paths) < FEW:
        return ()
    found = []
    for name in ORDERS:
        moves = [moves_of_tip_paths(some, rules) for some, rules in ((walls, link), (paths, replace(link, bearing=name))) if some]
        other = work.measured(made.name, made.tool, made.rpm, Moves.joined(moves), {**made.facts, "bearing": name}, made.left)
        share = other.facts["time_s"] / max(made.facts["time_s"], 1e-9)
        found.append((name, round(share, 4), other if share <= MOST_TIME else None))
    return tuple(found)


def with_tip_out(plan):
    """A SetupPlan whose operations run in the order that keeps the tip out of the cut, of those that cost little time."""
    laid = plan.operations
    if not any(o.orders for o in laid):
        return plan
    shares = {"as laid": _tip_shares(plan, laid)}
    for name in ORDERS:
        tried = [_in_order(o, name) if shares["as laid"].get(o.name, 0.0) >= WORTH else None for o in laid]
        if any(o is not None for o in tried):
            shares[name] = _tip_shares(plan, [one or o for one, o in zip(tried, laid)])
    return replace(plan, operations=tuple(_chosen(o, {name: own.get(o.name) for name, own in shares.items()}) for o in laid))


def _in_order(operation, name):
    """The operation in that order; None where it is too long, or there is none."""
    return next((other for known, _, other in operation.orders if known == name), None)


def _chosen(operation, shares):
    """The operation in the order whose tip cuts least; shares: {name of the order: of the way, None: not looked at}."""
    if not operation.orders:
        return operation
    laid = shares["as laid"]
    known = {name: shares[name] for name, _, other in operation.orders if other is not None and shares.get(name) is not None}
    best = min(known, key=known.get, default=None)
    longer = {name: share - 1 for name, share, _ in operation.orders}
    is_used = best is not None and laid is not None and known[best] <= laid - max(WORTH, longer[best])
    told = {"as laid": {"tip_share": laid}} | {
        name: {"times_as_long": share, **({"tip_share": known[name]} if name in known else {"why_not": _why_not(share, laid)})}
        for name, share, _ in operation.orders}
    taken = _in_order(operation, best) if is_used else operation
    return replace(taken, orders=(), facts={**taken.facts, "orders": told})


def _why_not(share, laid):
    """Why an order was not measured."""
    if share > MOST_TIME:
        return f"{100 * (share - 1):.0f} % longer: more than {100 * (MOST_TIME - 1):.0f} % is taken where it is requested alone"
    return "the tip is out of the cut as laid" if laid is not None and laid < WORTH else "not looked at"


def _tip_shares(plan, operations):
    """{name: share of its way with the tip in the cut} of operations whose cuts are seen."""
    seen = [o for o in operations if o.tool.head is None]
    posted, _ = as_moves(seen)
    tools = {o.tool.number: o.tool.simulated for o in seen}
    met = engagement(posted, tools, found_stock(plan.context), LOOK)
    return {cut.name: round(cut.tip_share, 4) for cut in cuts_of_operations(posted, tools, met)}
