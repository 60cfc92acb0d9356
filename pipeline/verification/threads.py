r"""Threads as posted: hole, pitch, hand, diameter and depth of each, out of the moves that were read and the tools' own shapes.

      ___|         |___     Nothing of a thread is simulated: taps and thread mills are, by their plain bodies.  Here stands what
         |>       <|        their teeth do: a tap goes as its pitch and the spindle lead it; a thread mill's tooth is where its
         |>       <|        path has it, and leaves a groove of that pitch, hand and width.
"""

import math

import numpy as np

from cuspline.kernel import brep
from cuspline.program.arcs import Arc
from cuspline.program.program import Kind
from cuspline.replay.replay_checks import Reporter
from cuspline.shop.threads import PITCH_SHARE
from cuspline.surfaces.holes import PARALLEL
from cuspline.surfaces.threaded_walls import faces_with_threads, threaded_walls
from cuspline.values import fixed_math as fixed
from cuspline.values.findings import Finding

SAME_MM = 2e-3              # heights and radii that are the same, roundings of posts included
BESIDE_MM = 0.05            # of a tool from a hole's axis, that is another place
PITCH_OFF = 2e-3            # of the pitch: what F and S and their roundings may be off
RING_MM = 0.004             # of a thread mill's path, within which it cuts its full depth
SAMPLES = 24                # of an arc
TURN_SHARE = 0.995          # of a full turn, that is one


class _Place:
    """A wall as one program sees it, upward along its Z; what the programs have made of it is shared."""

    def __init__(self, one, state, frame):
        up = float(frame.turn_into(one.hole.axis[None])[0, 2])
        self.one, self.state = one, state
        self.is_turned = one.hole.is_through and up < 0
        seen = one.turned_up() if self.is_turned else one
        self.is_upright = abs(up) > 1.0 - PARALLEL and (up > 0 or self.is_turned)
        point = frame.into(seen.hole.point_mm[None])[0]
        self.xy_mm, self.is_open, self.thread = point[:2], seen.is_open, one.thread
        self.mouth_mm, self.foot_mm = (float(point[2] + h) for h in (seen.wall.high_mm, seen.wall.low_mm))
        self.radius_mm, self.depth_mm = seen.wall.low_radius_mm, seen.depth_mm

    def opened(self, radius_mm, z_mm):
        """Something cuts here to a radius, from a height upward."""
        self.state.opened.append((radius_mm, *self._turned(z_mm - self.foot_mm, math.inf)))

    def closed_above_mm(self, z_mm, radius_mm):
        """How far above a height ends what is open to a radius from the mouth down; inf: nothing is."""
        spans = [self._turned(low, high) for radius, low, high in self.state.opened if radius >= radius_mm - SAME_MM]
        bottom = self._height_mm
        for low, high in sorted(spans, key=lambda span: -span[1]):
            bottom = min(bottom, low) if high >= bottom - SAME_MM else bottom
        return max(bottom - (z_mm - self.foot_mm), 0.0) if bottom < self._height_mm else math.inf

    def _turned(self, low, high):
        """Heights over the foot as the wall's own, and back."""
        return (self._height_mm - high, self._height_mm - low) if self.is_turned else (low, high)

    @property
    def _height_mm(self):
        return self.mouth_mm - self.foot_mm


class _State:
    """What the programs so far have made of a wall."""

    def __init__(self):
        self.opened, self.is_cut = [], False        # [(radius, from, to) as heights over the wall's foot]


def thread_findings(programs, solid, threads, predicates, tools, tops_mm):
    """Findings about the threads of a part, one tuple a program.

    Args:
        programs: verdict.SetupProgram values in the order in which they are run.
        solid: TopoDS_Solid, part coordinates.   threads: {name of faces: shop.threads.Thread}.
        predicates: design.FacePredicate values.   tools: {number: cutters.Tool}, as they are, not as they are simulated.
        tops_mm: highest place of the stock in each program's frame.
    Raises:
        DesignError: a thread of faces that are no holes, or holes of another width.
    """
    faces = brep.faces_of(solid) if threads else ()
    walls = [(one, _State()) for one in threaded_walls(faces, faces_with_threads(faces, threads, predicates))]
    found, last = [], {}
    for k, (program, top) in enumerate(zip(programs, tops_mm)):
        places = [p for p in (_Place(one, state, program.setup.frame) for one, state in walls) if p.is_upright]
        last |= {id(p.one): k for p in places}
        found.append(list(_Look(program, places, tools, top).findings()))
    for one, state in walls:
        if not state.is_cut:
            k = last.get(id(one), len(programs) - 1)
            found[k].append(Finding(
                kind="thread_missing", amount_mm=0.0, place_mm=tuple(np.round(one.mouth_mm, 6).tolist()), operation="", line=0,
                setup=programs[k].setup.name, advice=f"nothing cuts the thread {one.in_words}: tap it or mill it (tap, "
                "thread_mill), or take it out of the design's threads"))
    return [tuple(rows) for rows in found]


class _Look:
    """One program, move by move."""

    def __init__(self, program, places, tools, top_mm):
        self.posted, self.places, self.tools, self.top_mm = program.posted, places, tools, top_mm
        self.report = Reporter(self.posted, program.setup.name, program.setup.frame)
        posted = self.posted
        self.is_known = posted.is_upright & np.isfinite(posted.start_mm).all(axis=1) & np.isfinite(posted.end_mm).all(axis=1)

    def findings(self):
        """All of this program; what it makes of the walls is noted in their states."""
        posted, low = self.posted, np.minimum(self.posted.start_mm[:, 2], self.posted.end_mm[:, 2])
        is_tap, is_mill = (np.isin(posted.tool, [n for n, t in self.tools.items() if t.cutter.type == kind])
                           for kind in ("tap", "thread_mill"))
        is_thread = is_tap | is_mill
        owner = np.full(len(posted), -1)
        for number, place in enumerate(self.places):
            reach = self._reach_mm(place)
            inside = self.is_known & (reach < place.radius_mm)
            owner[inside] = number
            yield from self._made(place, np.flatnonzero(inside & ~is_thread & (posted.kind != Kind.RAPID)), reach, low)
            below = inside & (low < place.mouth_mm - SAME_MM)
            yield from self._taps(place, np.flatnonzero(below & is_tap), reach)
            yield from self._mills(place, np.flatnonzero(below & is_mill), reach)
        yield from self._elsewhere(is_thread & (owner < 0) & (low < self.top_mm - SAME_MM) & self.is_known)

    def _reach_mm(self, place):
        """(n,) how far from a wall's axis moves come at their ends."""
        away = [np.sqrt(((ends[:, :2] - place.xy_mm) ** 2).sum(axis=1)) for ends in (self.posted.start_mm, self.posted.end_mm)]
        return np.fmax(*away)

    def _finding(self, kind, row, amount_mm, advice, place):
        return self.report.finding(kind, row, amount_mm, self.posted.end_mm[row], f"{advice}: {place.one.in_words}")

    def _made(self, place, rows, reach, low):
        """Notes how wide and deep other tools open the hole; a finding of the first that opens it wider than its thread allows."""
        least, most = (d / 2 for d in place.thread.form.minor_mm)
        is_told = False
        for row in rows.tolist():
            cutter = self.tools[int(self.posted.tool[row])].cutter
            radius, full = float(reach[row]) + cutter.radius_mm, float(low[row]) + cutter.point_height_mm + cutter.corner_radius_mm
            if full > place.mouth_mm - SAME_MM:
                continue
            place.opened(radius, full)
            if radius > most + SAME_MM and not is_told:
                is_told = True
                yield self._finding("thread_hole", row, 2 * (radius - most), f"the hole gets {2 * radius:.3f} mm wide, before this "
                                    f"thread it may be {2 * least:.3f} to {2 * most:.3f}", place)

    def _elsewhere(self, flagged):
        """Taps and thread mills in the stock where no thread is."""
        yield from self.report.merged("thread_beside", np.where(flagged, self.top_mm - self.posted.end_mm[:, 2], 0.0).clip(0.0),
                                      self.posted.end_mm, np.ones(len(self.posted), bool),
                                      "a tap or thread mill is below the top of the stock where no threaded hole opens upward: "
                                      "move it to its hole, or state the thread in the design")

    # taps ------------------------------------------------------------------------------------------

    def _taps(self, place, rows, reach):
        """Every stroke of a tap in one hole."""
        posted, form = self.posted, place.thread.form
        for row in rows.tolist():
            tool = self.tools[int(posted.tool[row])].cutter
            tip = float(posted.end_mm[row, 2])
            if tip > posted.start_mm[row, 2]:
                continue
            if reach[row] > BESIDE_MM:
                yield self._finding("thread_beside", row, reach[row], "the tap is beside its hole's axis, move it there", place)
            if posted.pitch_mm[row] == 0:
                yield self._finding("thread_pitch", row, tool.pitch_mm, "a tap in its hole whose feed is not tied to the spindle: "
                                    "tap rigidly (G84, G74, G33.1, G331)", place)
                continue
            yield from self._shape(place, row, tool)
            yield from self._hole(place, row, tip)
            full = place.mouth_mm - tip - tool.chamfer_mm
            if full < place.depth_mm - SAME_MM:
                yield self._finding("thread_depth", row, place.depth_mm - full, f"{full:.3f} mm of full thread where "
                                    f"{place.depth_mm:.3f} are stated: tap deeper", place)
            place.state.is_cut |= abs(tool.diameter_mm - form.nominal_mm) < SAME_MM

    def _shape(self, place, row, tool):
        """Size, pitch and hand: of the tap, of the way, of the design."""
        form, sign, way = place.thread.form, place.thread.sign, float(self.posted.pitch_mm[row])
        if abs(tool.diameter_mm - form.nominal_mm) > SAME_MM:
            yield self._finding("thread_diameter", row, abs(tool.diameter_mm - form.nominal_mm), f"a tap of {tool.diameter_mm:g} "
                                "mm cuts another thread", place)
        for what, pitch in (("the tap's pitch is", tool.pitch_mm), ("F and S, or K, lead the tap by", abs(way))):
            if abs(pitch - form.pitch_mm) > PITCH_OFF * form.pitch_mm:
                yield self._finding("thread_pitch", row, abs(pitch - form.pitch_mm), f"{what} {pitch:.4f} mm a turn where the "
                                    f"thread has {form.pitch_mm:.4f}", place)
        if tool.hand != place.thread.hand or way * sign < 0:
            which = "the tap is" if tool.hand != place.thread.hand else "the spindle goes down as"
            yield self._finding("thread_hand", row, 0.0, f"{which} {'left' if place.thread.hand == 'right' else 'right'}-hand "
                                f"where the thread is {place.thread.hand}-hand", place)

    def _hole(self, place, row, tip):
        """The hole before: wide enough, and as deep as the tap goes."""
        least = place.thread.form.minor_mm[0] / 2
        missing = place.closed_above_mm(tip, least)
        if missing == math.inf:
            widest = max((r for r, _, _ in place.state.opened), default=0.0)
            yield self._finding("thread_hole", row, 2 * (least - widest), "no hole is there yet: drill it before" if not widest else
                                f"the hole is {2 * widest:.3f} mm wide, this thread needs {2 * least:.3f} at least", place)
        elif missing > SAME_MM and not (place.is_open and place.closed_above_mm(place.foot_mm, least) <= SAME_MM):
            yield self._finding("thread_bottom", row, missing, "the tap goes deeper than the hole is at its full width: drill "
                                "deeper, or tap less deep", place)

    # thread mills ------------------------------------------------------------------------------------

    def _mills(self, place, rows, reach):
        """The groove that a thread mill's tooth leaves in one hole."""
        if not len(rows):
            return
        posted = self.posted
        tool = self.tools[int(posted.tool[rows[0]])].cutter
        fast = rows[posted.kind[rows] == Kind.RAPID]
        touch = reach[fast] + tool.radius_mm - place.radius_mm
        if len(fast) and touch.max() > SAME_MM:
            yield self._finding("thread_beside", fast[int(touch.argmax())], touch.max(), "a thread mill goes by a rapid through "
                                "the wall of its hole: go to its middle before", place)
        feeds = rows[posted.kind[rows] != Kind.RAPID]
        if not len(feeds):
            return
        row, points = self._points(feeds)
        away = points[:, :2] - place.xy_mm
        radius = np.sqrt((away * away).sum(axis=1))
        if radius.max() + tool.radius_mm < place.radius_mm:
            return
        place.state.is_cut = True
        first = int(row[radius.argmax()])
        least = place.thread.form.minor_mm[0] / 2
        missing = place.closed_above_mm(float(points[:, 2].min()), least)
        if missing > SAME_MM and not place.is_open:
            yield self._finding("thread_hole", first, 0.0 if missing == math.inf else missing, "no hole as wide and deep is there "
                                "yet: drill it before", place)
        yield from self._groove(place, tool, first, points[radius > radius.max() - RING_MM], float(radius.max()))

    def _points(self, rows):
        """(rows (k,), places (k, 3)) along moves, arcs in between too."""
        out, numbers = [], []
        for k in rows.tolist():
            places = [self.posted.start_mm[k], self.posted.end_mm[k]]
            if self.posted.kind[k] >= Kind.ARC_CW:
                arc = Arc.of_posted(self.posted, k)
                places = [arc.at(share) for share in np.linspace(0.0, 1.0, SAMPLES + 1).tolist()]
            out += places
            numbers += [k] * len(places)
        return np.array(numbers), np.array(out)

    def _groove(self, place, tool, row, points, radius_mm):
        """Pitch, hand, width and depth of the groove; `points`: where the tooth cuts its full depth."""
        form, thread = place.thread.form, place.thread
        away = points[:, :2] - place.xy_mm
        turn, z = np.unwrap(fixed.arctan2(away[:, 1], away[:, 0])), points[:, 2]
        width = 2 * (radius_mm + tool.radius_mm)
        low, high = form.pitch_diameter_mm
        off = max(low - (width - PITCH_SHARE * form.pitch_mm), (width - PITCH_SHARE * form.pitch_mm) - high)
        if off > SAME_MM:
            yield self._finding("thread_diameter", row, off, f"the groove is {width:.3f} mm wide, with this pitch it may be "
                                f"{form.nominal_mm:.3f} to {high + PITCH_SHARE * form.pitch_mm:.3f}", place)
        turns = abs(turn[-1] - turn[0]) / (2 * math.pi)
        slope = float(((turn - turn.mean()) * (z - z.mean())).sum() / max(((turn - turn.mean()) ** 2).sum(), 1e-12))
        pitch = 2 * math.pi * slope
        if turns < TURN_SHARE or abs(abs(pitch) - form.pitch_mm) > PITCH_OFF * form.pitch_mm:
            yield self._finding("thread_pitch", row, abs(abs(pitch) - form.pitch_mm), f"the tooth rises by {abs(pitch):.4f} mm a "
                                f"turn, over {turns:.2f} turns, where the thread has {form.pitch_mm:.4f}", place)
        if pitch * thread.sign < 0:
            yield self._finding("thread_hand", row, 0.0, f"the helix is {'left' if thread.sign > 0 else 'right'}-hand where the "
                                f"thread is {thread.hand}-hand", place)
        middle = z + tool.chamfer_mm
        lacks = max(float(middle.min()) - (place.mouth_mm - place.depth_mm), place.mouth_mm - float(middle.max()))
        if lacks > SAME_MM:
            yield self._finding("thread_depth", row, lacks, f"the tooth's middle runs from {place.mouth_mm - middle.min():.3f} mm "
                                f"below the mouth to {place.mouth_mm - middle.max():.3f}, {place.depth_mm:.3f} are stated", place)
