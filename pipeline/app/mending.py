"""What a check finds the build mends: its places go back to the planner, the program is posted and judged again.

Two checks ask for it.  The planner's own measures the posted moves as the first verifier will, against limits that keep
MARGIN: a verdict never hangs on the last digit.  The verdict's findings are the other.  Places that stand too high
get clean-up passes; a gouge has its setup planned again to a tighter tolerance; what is found in a copy is mended in
what it is a copy of.  After ROUNDS what is left reaches a person, with what was tried.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.design.design import by_clamping
from cuspline.planning.clean_up import clean_up, squarely_touched, why_out_of_reach
from cuspline.planning.copied_plans import with_copies
from cuspline.planning.plan import plan_setup
from cuspline.values.amounts import counted
from cuspline.values.errors import CamError
from cuspline.verification.reporter import allowed_mm

ROUNDS = 4                  # of posting and judging again
OWN_ROUNDS = 3              # of the planner's own check before
MARGIN = 0.03               # of what the finish allows, that the planner keeps from it
TIGHTER = 0.6               # of the tolerance, where a path gouges
HELPED = 0.9                # of the places and of their height, or of the gouge: a round that leaves more did not help
TOO_HIGH = ("excess", "missing_area")
TOO_DEEP = ("gouge",)


@dataclass(frozen=True, eq=False, kw_only=True)
class Wants:
    """What one setup is to be mended for."""

    places_mm: np.ndarray       # (n, 3) that stand too high, part coordinates
    left_mm: float              # the most that stands there
    gouge_mm: float             # the deepest gouge; 0 none

    @property
    def is_none(self):
        return not len(self.places_mm) and self.gouge_mm == 0.0


def wants_of(found, finish, gouge_mm=0.0, share=1.0, is_high=True, more_mm=()):
    """Wants of one setup from its residuals.

    Args:
        found: residuals.Residuals of its faces after all setups.
        finish: design.Finish.
        gouge_mm: the deepest of this setup alone on any face.
        share: of the limits, from which places count.
        is_high: whether places that stand too high are wanted.
        more_mm: (k, 3) more of these.
    """
    d = found.deviation_mm
    high = found.is_reachable & (d > share * allowed_mm(finish)) if is_high else np.zeros(len(d), bool)
    places = np.vstack([found.samples.points_mm[high], np.reshape(more_mm, (-1, 3))]) if is_high else np.zeros((0, 3))
    return Wants(places_mm=places, left_mm=float(d[high].max(initial=allowed_mm(finish))),
                 gouge_mm=gouge_mm if gouge_mm > share * finish.gouge_mm else 0.0)


def wants_between(proof, finish):
    """Wants of one setup from its excess_proof.ExcessProof: places between the samples that stand higher than is allowed."""
    return Wants(places_mm=proof.higher_mm, left_mm=float(proof.amount_mm.max(initial=allowed_mm(finish))), gouge_mm=0.0)


def wants_of_verdict(verdict, accepted):
    """Wants of one SetupVerdict; kinds accepted by name are left as they are."""
    kinds = {f.kind for f in verdict.findings} - set(accepted)
    found = verdict.residuals
    wants = wants_of(found, verdict.finish, is_high=bool(kinds & set(TOO_HIGH)),
                     more_mm=verdict.excess_proof.higher_mm)
    deepest = max((f.amount_mm for f in verdict.findings if f.kind in TOO_DEEP and f.kind in kinds), default=0.0)
    return replace(wants, gouge_mm=deepest)


def mended(plans, wants, number, by):
    """Plans in which what is wanted is mended as far as it can be.

    Args:
        plans: SetupPlan values.
        wants: Wants, one a plan.
        number: of the round, from 1.
        by: who found it, for plan.json.
    Returns:
        (plans, bool: something was changed).
    """
    out, changed = [], False
    for plan, want in zip(plans, _dealt(plans, _of_originals(plans, wants))):
        new = plan if want.is_none or not plan.is_mended else _mended(plan, want, number, by)
        changed |= new.operations is not plan.operations
        out.append(new)
    return with_copies(out), changed


def _of_originals(plans, wants):
    """The same Wants, those of copies with the plan that they are copied from, their places where these lie there."""
    where, wants = {p.setup.name: k for k, p in enumerate(plans)}, list(wants)
    for k, plan in enumerate(plans):
        if plan.setup.planned_as is None:
            continue
        first, more = where[plan.setup.planned_as], wants[k]
        places = plans[first].setup.turn.out(plan.setup.turn.into(more.places_mm))
        wants[first] = replace(wants[first], places_mm=np.vstack([wants[first].places_mm, places]),
                               left_mm=max(wants[first].left_mm, more.left_mm), gouge_mm=max(wants[first].gouge_mm, more.gouge_mm))
        wants[k] = replace(more, places_mm=more.places_mm[:0], gouge_mm=0.0)
    return wants


def _dealt(plans, wants):
    """The same Wants, each place with the position of its clamping that touches it most squarely.

    A face that several positions cut is judged once, beside whichever of them: who is told is not who reaches the place.
    """
    wants, first = list(wants), 0
    for held in by_clamping(plans):
        own = [k for k in range(first, first + len(held)) if plans[k].setup.planned_as is None]
        numbers, high = [k for k in own if plans[k].is_mended], [k for k in own if len(wants[k].places_mm)]
        first += len(held)
        if len(own) < 2 or not numbers or not high:
            continue
        told = np.concatenate([np.full(len(wants[k].places_mm), k) for k in high])
        places, left_mm = np.vstack([wants[k].places_mm for k in high]), max(wants[k].left_mm for k in high)
        by = _most_squarely(plans, numbers, told, places, left_mm)
        for k in numbers:
            wants[k] = replace(wants[k], places_mm=places[by == k], left_mm=left_mm)
    return wants


def _most_squarely(plans, numbers, told, places_mm, left_mm):
    """(n,) which of some plans touches each place (n, 3) most squarely; none: the one that was told of it."""
    square = np.full((len(numbers), len(places_mm)), -np.inf)
    face = plans[numbers[0]].context.faces_near(places_mm)
    for row, k in enumerate(numbers):
        context = plans[k].context
        mine = np.isin(face, context.wanted)
        if mine.any():
            own = context.setup.turn.into(places_mm[mine])
            square[row, mine] = squarely_touched(context, plans[k].operations, own, left_mm)
    return np.where(np.isfinite(square.max(axis=0)), np.array(numbers)[square.argmax(axis=0)], told)


def with_reasons(verdict, plans):
    """The Verdict, with what was tried, or why nothing was, in the advice of findings that mending is for."""
    def told(finding, plan):
        if finding.kind not in (*TOO_HIGH, *TOO_DEEP):
            return finding
        reason = plan.mending[-1]["done"] if plan.mending else ""
        if not plan.is_mended:
            reason = "nothing: " + next(o.why_not_mended for o in plan.setup.operations if not o.is_mended)
        return replace(finding, advice=f"{finding.advice} (tried: {reason})") if reason else finding

    return replace(verdict, setups=tuple(replace(v, findings=tuple(told(f, plan) for f in v.findings))
                                         for v, plan in zip(verdict.setups, plans)))


def _mended(plan, want, number, by):
    told = {"round": number, "found_by": by, "places": len(want.places_mm),
            "highest_mm": round(want.left_mm, 6) if len(want.places_mm) else None,
            "gouge_mm": round(want.gouge_mm, 6) if want.gouge_mm else None}
    if _is_no_better(plan, told):
        return _told(plan, {**told, "done": "nothing: the round before did not help"})
    context = plan.context
    if want.gouge_mm:
        share = TIGHTER * context.tolerance_share
        try:
            again = plan_setup(context.design, context.setup, context.machine, context.given, context.before,
                               context.shop, share)
        except CamError as error:
            return _told(plan, {**told, "done": f"nothing: {error}"})
        return replace(again, mending=(*plan.mending, {**told, "done": "planned again to a tolerance of "
                                                       f"{again.context.finish.profile_tolerance_mm:g} mm"}))
    places = context.setup.turn.into(want.places_mm)
    added, touched = clean_up(context, plan.operations, places, want.left_mm, number)
    if not added:
        why = why_out_of_reach(context, plan.operations, places, want.left_mm)
        return _told(plan, {**told, "done": f"nothing: {why}"})
    done = ", ".join(f"T{o.tool.number} {o.tool.cutter.name}{', leaning' if 'tool_axis' in o.facts else ''}" for o in added)
    rest = int((~touched).sum())
    return replace(plan, operations=(*plan.operations, *context.as_cut(added)), mending=(*plan.mending, {
        **told, "done": f"clean-up passes with {done}" + (f"; {counted(rest, 'place')} out of reach" if rest else "")}))


def _is_no_better(plan, told):
    """Whether the last round of the same check has left as much as it found."""
    last = plan.mending[-1] if plan.mending else None
    if last is None or last["found_by"] != told["found_by"]:
        return False
    if told["gouge_mm"]:
        return bool(last["gouge_mm"]) and told["gouge_mm"] > HELPED * last["gouge_mm"]
    return bool(last["places"]) and (told["places"] > HELPED * last["places"]
                                     and told["highest_mm"] > HELPED * last["highest_mm"])


def _told(plan, told):
    """The same operations; a line more of what was tried."""
    return replace(plan, mending=(*plan.mending, told))
