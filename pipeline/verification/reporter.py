"""What both verifiers, the certificate and the proof have found about one clamping, as findings."""

import numpy as np

from cuspline.program.program import Kind
from cuspline.stock.swept import nearest_moves
from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted, length, over_area
from cuspline.values.clusters import clusters_of
from cuspline.values.findings import Finding
from cuspline.verification.certificate import gouges_beyond
from cuspline.verification.reach import AT_FOOT, DOWNWARD

NOISE_MM = 1e-6           # a tolerance is exceeded only by more than this
SMALLER = ("a ball, between upright walls a flat one narrower than they are apart (`cuspline cutters fine_mills` lists balls "
           "down to 2 mm and flat ones down to 1 mm)")
EXCESS_ADVICE = ("lower `scallop_mm` of the setup's operation for closer passes, or add a smaller cutter to the file of "
                 f"--cutters: {SMALLER}")
MISSING_ADVICE = ("give its face to an operation of the setup (`faces`), or add a cutter to the file of --cutters that "
                  f"is smaller, or sticks out farther: {SMALLER}")
LOOKED_CLOSER = ("and it stayed when both looked twice as closely; do not cut, keep the folder and report this as a fault of "
                 "cuspline")
FOOT_ADVICE = ("a cutter of the program fits here, though no ball of the shop does: let its floor pass run up to the wall, and its "
               "wall pass down to the floor")
FLUTES_ADVICE = ("it stands beside the cutter's neck, above flutes that end below it: take a cutter whose flutes are as long as "
                 "the wall is high, or cut the wall from above in steps no deeper than the flutes")
NARROW_ADVICE = ("no cutter of the shop is narrow enough, and sticks out far enough, to come there (`instead_of` in plan.json says "
                 f"what was tried); add one to the file of --cutters: {SMALLER}")
DOWNWARD_ADVICE = "it faces away from the tool; give it to a setup that looks at it"
MISSED = 5.0              # an area is missing, not just rough, when it stands this many tolerances proud
MISSED_MM2 = 1.0
UNPROVEN_MM2 = 1.0          # of what a leaning tool leaves without a proof, from which it is told
SEEN_PITCHES = 3.0        # a body narrower than this many pitches may slip through the grid


def allowed_mm(finish):
    """Largest deviation that a finished point may show."""
    return finish.scallop_mm + finish.profile_tolerance_mm


def _at_least(more):
    return "at least " if more else ""


def rounded(value, decimals=6):
    """A number for verify.json; whole numbers stay whole."""
    return value if isinstance(value, int) else round(float(value), decimals)


class Reporter:
    """Findings of both verifiers about one clamping."""

    def __init__(self, program, finish, found, own, true_mm, columns):
        """Args:
            true_mm: function (Residuals, rows) -> (amount, row, whether it may be more), see true_depths.
            columns: Residuals as `found`, had all cutters' flutes been long enough.
        """
        self.posted, self.setup, self.frame = program.posted, program.setup.name, program.setup.frame
        self.finish, self.found, self.own, self.true_mm, self.columns = finish, found, own, true_mm, columns

    def _finding(self, kind, found, sample, amount, advice, is_at_least=False):
        row = int(found.row[sample])
        place = found.samples.points_mm[sample].round(6)
        return Finding(kind=kind, amount_mm=rounded(amount), place_mm=tuple(place.tolist()),
                       operation=self.posted.operation_name(row) if row >= 0 else "",
                       line=int(self.posted.line[row]) if row >= 0 else 0, setup=self.setup, advice=advice, row=row,
                       is_at_least=is_at_least)

    def gouges(self):
        """One finding a connected gouge deeper than the finish allows."""
        d = self.own.deviation_mm
        for group in self.own.groups(d < -self.finish.gouge_mm - NOISE_MM):
            amount, worst, more = self.true_mm(self.own, group)
            yield self._finding("gouge", self.own, worst, amount,
                                f"the cutter goes {_at_least(more)}{length(amount)} into the part "
                                f"{over_area(self.own.area_mm2(group))}, {self.finish.gouge_mm:g} mm are allowed: lower "
                                "`profile_tolerance_mm` of the finish, or name a smaller `tool` for the operation; in a program "
                                "edited by hand, correct the offset of this pass", more)

    def unseen_gouges(self, proven):
        """Moves that are not proven to keep to what the finish allows, where no sample tells of them."""
        d, points = self.own.deviation_mm, self.own.samples.points_mm
        told = self.frame.into(points[d < -self.finish.gouge_mm - NOISE_MM])
        for moves in _runs(gouges_beyond(proven, self.finish.gouge_mm)):
            worst = max(moves, key=lambda m: m.depth_mm)
            if len(told) and np.linalg.norm(told - worst.place_mm, axis=1).min() <= 2 * self.own.spacing_mm:
                continue
            place = self.frame.out(np.array([worst.place_mm]))[0].round(6)
            yield Finding(kind="gouge", amount_mm=rounded(worst.depth_mm), place_mm=tuple(place.tolist()),
                          operation=self.posted.operation_name(worst.row), line=int(self.posted.line[worst.row]),
                          setup=self.setup, row=worst.row,
                          advice=f"between the sample points this move may go {length(worst.depth_mm)} into the part, "
                          f"{self.finish.gouge_mm:g} mm are allowed; {counted(len(moves), 'move')} from line "
                          f"{self.posted.line[moves[0].row]}: lower `profile_tolerance_mm` of the finish")

    def unproven(self, proven, proof):
        """What nothing proves of tools that lean or turn in the cut, moves or leavings: samples alone speak for it."""
        posted = self.posted
        leans = ~posted.is_upright & (posted.kind != Kind.RAPID)
        rows = [row for row, _ in proven.uncovered if leans[row]]
        told = [(rows[0], f"that {counted(len(rows), 'move')} from here on keep out of the part")] if rows else []
        open_mm2 = proof.unproven_mm2["inside"]
        if leans.any() and open_mm2 > UNPROVEN_MM2:
            told.append((int(leans.argmax()), f"how much is left between the sample points of {open_mm2:.1f} mm²"))
        for row, what in told:
            place = self.frame.out(posted.end_mm[[row]])[0].round(6)
            yield Finding(kind="surface_not_proven", amount_mm=0.0, place_mm=tuple(place.tolist()),
                          operation=posted.operation_name(row), line=int(posted.line[row]), setup=self.setup, row=row,
                          advice=f"not proven, only looked at in samples: {what}; finish with a ball, a bull nose or a flat "
                          "cutter, or let the tool keep its direction")

    def excess(self):
        """One finding a connected area that a ball, or at walls a cutter of the program, could finish and that was left proud."""
        d, allowed = self.found.deviation_mm, allowed_mm(self.finish)
        above_flutes = d > self.columns.deviation_mm + NOISE_MM
        for group in self.found.groups(self.found.is_reachable & (d > allowed + NOISE_MM)):
            (amount, worst, more), area = self.true_mm(self.found, group), self.found.area_mm2(group)
            missed = np.median(d[group]) > MISSED * allowed and area >= MISSED_MM2
            left = f"{_at_least(more)}{length(amount)} left {over_area(area)}"
            advice = (FOOT_ADVICE if (self.found.reach[group] == AT_FOOT).all() else
                      FLUTES_ADVICE if np.median(above_flutes[group]) else MISSING_ADVICE if missed else EXCESS_ADVICE)
            advice = f"never finished, {left}: {advice}" if missed else f"{left}, {allowed:.4f} mm are allowed: {advice}"
            yield self._finding("missing_area" if missed else "excess", self.found, worst, amount, advice, more)

    def not_cut(self, groups):
        """One finding a connected group of places on faces most of which is not cut, see faces_not_cut."""
        for group in groups:
            worst = group[self.found.deviation_mm[group].argmax()]
            why = DOWNWARD_ADVICE if np.median(self.found.reach[group] == DOWNWARD) else NARROW_ADVICE
            yield self._finding("face_not_cut", self.found, worst, self.found.deviation_mm[worst],
                                f"a face that the setup names is not cut {over_area(self.found.area_mm2(group))}: {why}, or take "
                                "it out of the setup's `faces` if it is made elsewhere", True)

    def unseen_excess(self, proof, cut):
        """One finding a connected group of places that only the proof has found to stand too high."""
        allowed = allowed_mm(self.finish)
        told = self.found.samples.points_mm[self.found.is_reachable & (self.found.deviation_mm > allowed + NOISE_MM)]
        for group in clusters_of(np.vstack([told, proof.higher_mm]), 2 * self.found.spacing_mm):
            if group.min() < len(told):
                continue
            worst = group[proof.amount_mm[group - len(told)].argmax()] - len(told)
            place = proof.higher_mm[[worst]]
            row = int(nearest_moves(cut.paths, cut.frame.into(place))[1][0])
            yield Finding(kind="excess", amount_mm=rounded(proof.amount_mm[worst]), setup=self.setup,
                          place_mm=tuple(place[0].round(6).tolist()),
                          operation=self.posted.operation_name(row) if row >= 0 else "",
                          line=int(self.posted.line[row]) if row >= 0 else 0, row=row,
                          advice=f"{length(proof.amount_mm[worst])} left between the sample points, "
                          f"{allowed:.4f} mm are allowed: {EXCESS_ADVICE}")

    def disagreements(self, view, pitch_mm, bounds):
        """The second verifier must see what the first sees, and the other way round."""
        yield from self._volume_disagreements(view.volumes)
        yield from self._unseen_by_residuals(view, bounds)
        yield from self._unseen_by_solids(view, pitch_mm, bounds)

    def _volume_disagreements(self, held):
        for name, (first, second), bound in (("excess", held.excess_mm3, held.bound_mm3), ("gouge", held.gouge_mm3, held.bound_mm3),
                                             ("excess less gouge", held.net_mm3, held.net_bound_mm3)):
            if abs(first - second) > bound:
                yield Finding(kind="verifiers_disagree", amount_mm=rounded(abs(first - second) / held.area_mm2), place_mm=None,
                              operation="", line=0, setup=self.setup, advice=f"{name}: residuals add up to {first:.6f} mm³, "
                              f"solids to {second:.6f} mm³, more than {bound:.6f} mm³ apart over {held.area_mm2:.0f} mm²: "
                              "report this as a fault of cuspline")

    def _unseen_by_residuals(self, view, bounds):
        slack = bounds["tessellation_mm"] + bounds["path_mm"] + NOISE_MM
        for body in view.bodies:
            found = self._seen_in(body.kind)
            d, fair = found.deviation_mm[body.samples], found.is_reachable[body.samples]
            seen = ((d > allowed_mm(self.finish) - slack) | ~fair if body.kind == "excess"
                    else d < -self.finish.gouge_mm + slack)
            if not seen.any():
                yield Finding(kind="verifiers_disagree", amount_mm=rounded(body.depth_mm), place_mm=body.place_mm,
                              operation="", line=0, setup=self.setup,
                              advice=f"the solids show a body of {body.kind}, {body.volume_mm3:.6f} mm³, "
                              f"{length(body.depth_mm)} deep, that no sample point shows: {LOOKED_CLOSER}")

    def _seen_in(self, kind):
        """Residuals that a body of that kind must show in."""
        return self.found if kind == "excess" else self.own

    def _unseen_by_solids(self, view, pitch_mm, bounds):
        slack = bounds["tessellation_mm"] + bounds["path_mm"] + 3 * bounds["zmap_mm"]
        for kind in ("excess", "gouge"):
            found = self._seen_in(kind)
            d, samples = found.deviation_mm, found.samples
            beyond = (found.is_reachable & (d > allowed_mm(self.finish) + slack) if kind == "excess"
                      else d < -self.finish.gouge_mm - slack)
            seen = np.zeros(len(d), dtype=bool)
            for body in view.bodies:
                if body.kind == kind:
                    seen |= ((samples.points_mm > np.array(body.min_mm) - found.spacing_mm).all(axis=1)
                             & (samples.points_mm < np.array(body.max_mm) + found.spacing_mm).all(axis=1))
            up = fixed.matmul(samples.normals, self.frame.rotation[:, 2])
            for group in found.groups(beyond & (up > 0.5)):
                wide = np.ptp(self.frame.into(samples.points_mm[group])[:, :2], axis=0).min() > SEEN_PITCHES * pitch_mm
                if wide and not seen[group].any():
                    worst = group[np.abs(d[group]).argmax()]
                    yield self._finding("verifiers_disagree", found, worst, abs(d[worst]),
                                        f"sample points show {kind} of {length(d[worst])} that the solids do not "
                                        f"show: {LOOKED_CLOSER}")


def _runs(moves):
    """Moves that follow one another, as lists in order of their rows."""
    found = []
    for move in sorted(moves, key=lambda m: m.row):
        if found and move.row == found[-1][-1].row + 1:
            found[-1].append(move)
        else:
            found.append([move])
    return found
