"""A program of one control in the words of another: read by the one's reader, written by the other's post, read back, compared.

    text -> reader -> PostedMoves -> Program -> post -> text -> its reader -> the same moves, or it is refused
"""

import re
from dataclasses import dataclass

import numpy as np

from cuspline.app import catalogue
from cuspline.program.drilling import DrillCycle
from cuspline.program.posted import PostedMoves
from cuspline.program.program import WORK_OFFSETS, Kind, Moves, Operation, Pause, Plane, Program
from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.coolants import BITS
from cuspline.values.errors import InputError, ReadError

SAME_MM = 1e-9
SAME_AXIS = 1e-8                    # of a tool axis, part by part: nine decimals, stretched to a length of 1
EXTENSIONS = {".ngc": "linuxcnc", ".mpf": "siemens", ".h": "heidenhain", ".pmc": "pmac", ".apt": "apt", ".cls": "apt",
              ".aptsource": "apt"}
MACHINES = {"linuxcnc": "mill_3axis"}           # of other posts: mill_<post>
TOOL_NUMBER = re.compile(r"(?:\bT(?:OOL CALL)?\s*=?\s*\"?|LOADTL\s*/\s*)(\d+)", re.IGNORECASE)
COOLANTS = {bits: name for name, bits in BITS.items()}
STANDS = ("G4", "M0", "M1")
SPINDLE = {"M3": True, "M4": True, "M5": False, "M6": False}        # whether it turns behind
SAME_S = 6e-4                       # of a dwell: half a millisecond, and rounding; a shorter one is none
UPRIGHT = np.array([0.0, 0.0, 1.0])
ARM_MM = 1000.0                     # from a rotary axis to the tip, at most
FASTER, SAME_SHARE = 1.02, 1e-3     # of a piece of a leaning line beside the line
LARGEST_STORE_BYTES = 1 << 40       # the whole text stays one: to split it is the planner's business


@dataclass(frozen=True)
class NumberedTool:
    """A tool of which the program says its number alone."""

    number: int

    offset_mm, length_mm, head = (0.0, 0.0, 0.0), 0.0, None

    @property
    def cutter(self):
        return self

    @property
    def name(self):
        return "of the program"


@dataclass(frozen=True, kw_only=True)
class Translation:
    """What came out, and what whoever runs it has to know."""

    texts: tuple[str, ...]
    extension: str
    notes: tuple[str, ...]


def post_of(name, given):
    """The post whose words a file is in: as given, or by how its name ends.

    Args:
        name: of the file.   given: name of a post, or None.
    Raises:
        InputError: neither says it.
    """
    if given is not None:
        return given
    suffix = "." + name.rpartition(".")[2].lower()
    if suffix not in EXTENSIONS:
        raise InputError(f"{name}: several controls have files that end so: say which one by --from, one of "
                         f"{', '.join(catalogue.post_names())}")
    return EXTENSIONS[suffix]


def machine_of(post):
    """The machine that a post's words are written for and read on, where none is named."""
    catalogue.find_post(post)
    name = MACHINES.get(post, f"mill_{post}")
    if name not in catalogue.machine_names():
        raise InputError(f"post {post}: name its machine by --machine")
    return catalogue.with_post(catalogue.find_machine(name), post)


def source_of(name, post, machine):
    """The machine that a program is read on.

    Args:
        name: of the file.   post: whose words it is in, or None.   machine: by name or TOML file; None: the post's own.
    """
    if machine is None:
        return machine_of(post_of(name, post))
    return catalogue.with_post(catalogue.find_machine(machine), post)


def translated(text, *, name, source, target, tools=None):
    """A program in another control's words.

    Args:
        text: of the file.   name: its name, for the header.
        source, target: machines.Machine whose posts say the languages; the target's file says decimals, units and tolerance.
        tools: {number: cutters.Tool}, or None: only their numbers are known, no lengths.
    Returns:
        Translation.
    Raises:
        ReadError, PostError: what the one does not know or the other does not take, with its line or its name.
        InputError: what can be read, but not said in a Program: several zeros, threads that are no tapped holes.
    """
    if tools is None and getattr(catalogue.find_post(target.control.post), "NEEDS_LENGTHS", False):
        raise InputError(f"the post {target.control.post} writes tool lengths into the program: give the tools by --cutters")
    if tools is None and source.rotaries:
        raise InputError(f"{name} turns rotary axes: where the tips are hangs on the tools' lengths: give the tools by --cutters")
    if tools is None and target.rotaries:
        raise InputError(f"{target.name} turns rotary axes: where its joints are hangs on the tools' lengths: give the tools by "
                         "--cutters")
    moves = _read(text, source, tools)
    program = program_of(moves, name, source.control.post, tools)
    store = target.control.model_copy(update={"program_store_bytes": LARGEST_STORE_BYTES, "program_store_sub_blocks": None})
    target = target.model_copy(update={"control": store})
    posted = catalogue.find_post(target.control.post).post(program, target)
    back = _read_all(posted.texts, target, tools)
    notes = [f"line {moves.line[min(r.row, len(moves) - 1)]}: {r.advice}" for r in moves.remarks if r.kind == "unknown_start"]
    notes += _compared(moves, back, target.control, posted.arcs_as_lines, target.rotaries)
    notes += _looser(moves, back, target)
    return Translation(texts=posted.texts, extension=catalogue.find_post(target.control.post).EXTENSION, notes=tuple(notes))


def refuse_other_moves(moves, texts, machine, tools):
    """Nothing, where texts say the moves that they were written for.

    Args:
        moves: PostedMoves.   texts: as a machine's post wrote them.   tools: {number: cutters.Tool}.
    Raises:
        ReadError: they do not.
    """
    _compared(moves, _read_all(texts, machine, tools), machine.control, 0, machine.rotaries)


def _read_all(texts, machine, tools):
    return PostedMoves.joined([_read(t, machine, tools) for t in texts], [t.count("\n") for t in texts])


def _read(text, machine, tools):
    """PostedMoves; machine coordinates stay unknown, for the zero is; rotaries turn about the machine file's zero."""
    numbers = {int(number) for number in TOOL_NUMBER.findall(text)}
    lengths = {number: 0.0 for number in numbers} if tools is None else {n: t.offset_mm for n, t in tools.items()}
    read = catalogue.reader_of(machine)
    zeros = dict.fromkeys(WORK_OFFSETS, machine.wcs_origin_mm) if machine.rotaries else {}
    return read(text, work_offsets=zeros, tool_lengths=lengths,
                **catalogue.coolants_taken(read, machine), **({} if tools is None else catalogue.radii_taken(read, tools)))


def program_of(moves, name, language, tools=None):
    """A Program of moves that were read: an operation wherever tool, coolant or name change, or the speed above the work.

    Args:
        moves: posted.PostedMoves.   name: of the file.   language: the post whose words it is in.
        tools: {number: cutters.Tool}; None: their numbers alone.
    Raises:
        InputError: it cuts nothing, or says what a Program does not.
    """
    _refuse_what_is_lost(moves)
    operations = tuple(_operations(moves, tools))
    if not operations:
        raise InputError(f"{name} cuts nothing: there is nothing to translate")
    lowest = min(min(o.moves.start_mm[2], o.moves.end_mm[-1, 2]) for o in operations)
    return Program(name=name, setup="setup-1", wcs=moves.work_offsets[0], wcs_in_words="", operations=operations,
                   clearance_z_mm=float(lowest), header=(f"TRANSLATED FROM {name}, WORDS OF {language.upper()}",
                                                         "NOT SIMULATED: PROVE IT OUT ABOVE THE WORK FIRST"))


def _refuse_what_is_lost(moves):
    cuts = moves.kind != Kind.RAPID
    wrong = {"a cut without a tool": cuts & (moves.tool == 0),
             "a cut while the spindle stands": cuts & (moves.spindle_rpm == 0),
             _coolants_in_words(moves.coolant): ~np.isin(moves.coolant, list(COOLANTS))}
    for what, rows in wrong.items():
        if rows.any():
            line = int(moves.line[np.flatnonzero(rows)[0]])
            raise InputError(f"line {line}: {what}, which is not translated: correct the program", rows=[line])
    if len(moves.work_offsets) > 1:
        raise InputError(f"the program uses the work offsets {' and '.join(moves.work_offsets)}: translate a program for each")


def _coolants_in_words(coolant):
    """Of bits (n,) the first that are more than one coolant, by name."""
    both = next((bits for bits in coolant.tolist() if bits not in COOLANTS), 0)
    return f"{' and '.join(name for name, bits in BITS.items() if bits & both)} at once"


def _operations(moves, tools):
    """Runs of moves with one tool, coolant and name, whose places are known; the speed changes in the cut alone."""
    rpm, hands = np.round(np.abs(moves.spindle_rpm)), _hand_of_taps(moves)
    starts = np.cumsum((moves.kind == Kind.RAPID) & (np.r_[0.0, np.diff(rpm)] != 0))
    backwards = _senses(moves) & (hands == 0)                               # of a tap its thread says it
    keys = np.column_stack([moves.operation, moves.tool, starts, moves.coolant, backwards, hands])
    pauses = _Pauses(moves)
    known = np.isfinite(moves.start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1)
    changes = np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1) | (known[1:] != known[:-1])) + 1
    before, runs = None, []
    for rows in np.split(np.arange(len(moves)), changes):
        if known[rows[0]] and (moves.kind[rows] != Kind.RAPID).any():
            runs.append(rows)
    for k, rows in enumerate(runs):
        cuts = np.flatnonzero(moves.kind[rows] != Kind.RAPID)
        tool = int(moves.tool[rows[0]])
        own = NumberedTool(tool) if tools is None else tools[tool]
        goes_on = before is not None and before + 1 == rows[0] and moves.tool[before] == tool
        yield Operation(name=moves.operation_name(rows[0]) or f"tool {tool}", tool=own, is_from_top=not goes_on,
                        spindle_rpm=float(rpm[rows[cuts[0]]]), coolant=COOLANTS[int(moves.coolant[rows[0]])],
                        moves=_moves(moves, rows), rpm_changes=_changes(moves, rows, rpm), cycles=_taps(moves, rows),
                        is_backwards=bool(backwards[rows[cuts[0]]]),
                        pauses=pauses.taken(rows, is_last=k + 1 == len(runs)))
        before = rows[-1]


def _senses(moves):
    """(n,) bool: the spindle turns backwards; where it stands, as it does at the next move."""
    turns = np.flatnonzero(moves.spindle_rpm)
    following = np.searchsorted(turns, np.arange(len(moves))).clip(max=max(len(turns) - 1, 0))
    return moves.spindle_rpm[turns[following]] < 0 if len(turns) else np.zeros(len(moves), bool)


def _hand_of_taps(moves):
    """(n,) of the thread that is tapped next with the same tool: 1 right, -1 left, 0 none; at a tap its own."""
    taps, at = np.flatnonzero(moves.pitch_mm), np.arange(len(moves))
    if not len(taps):
        return np.zeros(len(moves))
    ends = np.r_[(moves.tool[1:] != moves.tool[:-1]) | (moves.kind[:-1] != Kind.RAPID), True]      # no tap behind counts before it
    ended = np.r_[0, np.cumsum(ends)]
    following = taps[np.searchsorted(taps, at).clip(max=len(taps) - 1)]
    leads_there = (following >= at) & (ended[at] == ended[following])
    return np.where(leads_there, np.sign(moves.pitch_mm[following]), 0.0)


def _taps(moves, rows):
    """A DrillCycle of every hole that is tapped: one tied move down, the next up to where it began.

    Raises:
        InputError: a feed that is tied to the spindle otherwise, with its line.
    """
    tied, pieces, out = np.flatnonzero(moves.pitch_mm[rows] != 0).tolist(), _pieces_before(moves, rows), []
    for k, after in zip(tied[::2], [*tied[1::2], None][:len(tied[::2])]):
        if after != k + 1 or not _is_tapped(moves, rows[k], rows[after]):
            line = int(moves.line[rows[k]])
            raise InputError(f"line {line}: the feed is tied to the spindle, and it is no hole tapped straight down and up: that "
                             "is not translated; plan the part for the other machine", rows=[line])
        x, y, bottom = moves.end_mm[rows[k]].tolist()
        out.append(DrillCycle(kind="tap", xy_mm=(x, y), bottom_z_mm=bottom, retract_z_mm=float(moves.start_mm[rows[k], 2]),
                              pitch_mm=float(moves.pitch_mm[rows[k]]), feed_mm_per_min=float(moves.feed_mm_per_min[rows[k]]),
                              stays_low=True, first=int(pieces[k]), end=int(pieces[after + 1])))
    return tuple(out)


def _is_tapped(moves, down, up):
    """Whether two tied moves are one hole, upright."""
    way, pitch = moves.end_mm[down] - moves.start_mm[down], moves.pitch_mm
    is_upright = max(abs(way[0]), abs(way[1])) < SAME_MM and way[2] < 0 and not _leans(moves)[[down, up]].any()
    return bool(is_upright and np.abs(moves.end_mm[up] - moves.start_mm[down]).max() < SAME_MM
                and abs(pitch[up] - pitch[down]) < SAME_MM)


class _Pauses:
    """Where a program stands still, handed out to its operations one after the other."""

    def __init__(self, moves):
        self.moves, self.left, is_on = moves, [], False
        for at, stop in enumerate(moves.stops):
            if stop.word in STANDS and (stop.word != "G4" or stop.seconds >= SAME_S):
                self.left.append((at, stop, is_on))
            is_on = SPINDLE.get(stop.word, is_on)
        self.changes = [(at, stop.row) for at, stop in enumerate(moves.stops) if stop.word == "M6"]

    def taken(self, rows, is_last):
        """Pauses of an operation: those among its moves and at its end, and those since the one before.

        Args:
            rows: of its moves, one after the other.   is_last: no operation follows; what is left is this one's.
        """
        first, end, pieces, out = rows[0], rows[-1] + 1, _pieces_before(self.moves, rows), []
        comes_in = max((at for at, row in self.changes if row <= first), default=-1)       # its tool
        while self.left and (self.left[0][1].row <= end or is_last) and not self._is_before_next_tool(end, is_last):
            at, stop, is_on = self.left.pop(0)
            is_behind = stop.row > end
            is_at_top = is_behind or stop.row < first and at < comes_in
            move = len(pieces) - 1 if is_behind else max(stop.row - first, 0)
            out.append(Pause(move=int(pieces[move]), seconds=stop.seconds, is_optional=stop.word == "M1", is_spindle_on=is_on and
                             not is_at_top, is_at_top=bool(is_at_top)))
        return tuple(out)

    def _is_before_next_tool(self, end, is_last):
        """What comes at the operation's end, but behind the next tool, belongs to the next operation."""
        at, stop, _ = self.left[0]
        return not is_last and stop.row == end and any(change < at and row == end for change, row in self.changes)


def _pieces_before(moves, rows):
    """(n + 1,) moves of a Program that rows of moves before each make: arcs of more than one turn go out in pieces."""
    return np.cumsum([0, *np.where(moves.turns[rows] > 0, 2 * (moves.turns[rows] + 1), 1)])


def _changes(moves, rows, rpm):
    """(move, spindle speed from there on) among rows of moves, arcs of more than one turn counted in their pieces."""
    pieces = _pieces_before(moves, rows)
    cuts = np.flatnonzero(moves.kind[rows] != Kind.RAPID)
    speed = rpm[rows[cuts]]
    changed = np.flatnonzero(np.diff(speed) != 0) + 1
    return tuple((int(pieces[cuts[k]]), float(speed[k])) for k in changed.tolist())


def _moves(moves, rows):
    """The same as Moves; arcs of more than one turn in as many pieces."""
    parts = [_pieces(moves, row) for row in rows.tolist()]
    end, center, row = (np.concatenate([part[k] for part in parts]) for k in range(3))
    column = lambda values: values[row]
    return Moves(start_mm=moves.start_mm[rows[0]], kind=column(moves.kind), end_mm=end, center_mm=center,
                 plane=np.where(column(moves.kind) > Kind.FEED, column(moves.plane), Plane.XY),
                 axis=column(moves.end_axis), feed_mm_per_min=column(moves.feed_mm_per_min))


def _pieces(moves, row):
    """(ends, centres, rows) of one move: several where it turns more than once."""
    start, end, center, turns = moves.start_mm[row], moves.end_mm[row], moves.center_mm[row], int(moves.turns[row])
    if not turns:
        return end[None], center[None], np.array([row])
    a, b, third = Plane(moves.plane[row]).axes
    side = -1.0 if moves.kind[row] == Kind.ARC_CW else 1.0
    angle = lambda p: float(fixed.arctan2(p[b] - center[b], p[a] - center[a]))
    sweep = side * (angle(end) - angle(start)) % (2 * np.pi)
    sweep = (sweep if sweep > SAME_MM else 2 * np.pi) + 2 * np.pi * turns
    count = 2 * (turns + 1)
    share = np.arange(1, count + 1) / count
    ends, radius = np.empty((count, 3)), float(fixed.hypot(start[a] - center[a], start[b] - center[b]))
    ends[:, a] = center[a] + radius * fixed.cos(angle(start) + side * share * sweep)
    ends[:, b] = center[b] + radius * fixed.sin(angle(start) + side * share * sweep)
    ends[:, third] = start[third] + share * (end[third] - start[third])
    ends[-1] = end
    return ends, np.tile(center, (count, 1)), np.full(count, row)


def _looser(moves, back, target):
    """A note where the new control may leave the path farther than the program had it; NaN is what parameters say."""
    was = moves.path_tolerance_mm[moves.kind != Kind.RAPID].min()
    now = np.nan_to_num(back.path_tolerance_mm[back.kind != Kind.RAPID], nan=target.control.path_tolerance_mm).max()
    if now > was * (1 + SAME_MM):
        return [f"the new control may leave the path by {now:g} mm, the program allowed {was:g} mm in places"]
    return []


# comparison --------------------------------------------------------------------------------------------


def _compared(moves, back, control, arcs_as_lines, rotaries=()):
    """Notes about how the moves read back differ from those of the program.

    A line with a leaning tool comes back in pieces where rotary axes turn, slower where they cannot follow.

    Raises:
        ReadError: by more than half the last digit that the new control is given; `.rows` holds the program's line.
    """
    half_mm = 0.5 * control.resolution_mm * (1 + 1e-6)
    half_feed = 0.5 * control.resolution_mm * float(f"1e{control.decimals - control.decimals_feed}") * (1 + 1e-6)
    cuts = np.flatnonzero(moves.kind != Kind.RAPID)
    found = np.flatnonzero(back.kind != Kind.RAPID)
    through_joints, is_leaning = _ThroughJoints(control), _leans(moves) if rotaries else np.zeros(len(moves), bool)
    at, off_mm, off_feed, made = 0, 0.0, 0.0, [0]
    for row in cuts.tolist():
        first, leans = at, is_leaning[row]
        ends_there = through_joints.ends_there if leans else _ends_there
        while at < len(found) and not ends_there(moves, row, back, found[at], half_mm):
            at += 1
        is_arc, rows = moves.kind[row] > Kind.FEED, found[first:at + 1]
        if at == len(found) or not (through_joints.is_same_path(moves, row, back, rows, half_mm) if leans else
                                    (at == first or is_arc) and _is_same_path(moves, row, back, rows, 3 * half_mm)):
            line = int(moves.line[row])
            raise ReadError(f"line {line}: the move does not come back as it was meant: the new control has not the digits or "
                            "the words for it", rows=[line])
        _refuse_another_turn(moves, row, back, rows, half_feed)
        off_mm = max(off_mm, float(np.abs(back.end_mm[found[at]] - moves.end_mm[row]).max()))
        if not leans:
            off_feed = max(off_feed, float(np.abs(back.feed_mm_per_min[rows] - moves.feed_mm_per_min[row]).max()))
        at += 1
        made.append(at)
    if at < len(found) or off_feed > half_feed:
        raise ReadError(f"{counted(len(found) - at, 'move')} more than the program has, or feeds off by {off_feed:g} mm/min",
                        rows=[1])
    stands = _where_it_stands(moves, cuts, np.arange(len(cuts) + 1)), _where_it_stands(back, found, np.array(made))
    notes = _pauses_compared(*stands)
    notes += [f"ends are up to {off_mm:.2g} mm off: {control.decimals} decimals in {control.units}"] if off_mm > SAME_MM else []
    notes += [f"feeds are up to {off_feed:.2g} mm/min off"] if off_feed > SAME_MM else []
    if arcs_as_lines:
        notes.append(f"{counted(arcs_as_lines, 'arc')} as chords within {control.path_tolerance_mm:g} mm")
    return notes


def _refuse_another_turn(moves, row, back, rows, half_feed):
    """Nothing, where the spindle turns in the same sense at the same speed, tied to the feed by the same pitch.

    Raises:
        ReadError: it does not; `.rows` holds the program's line.
    """
    turns, line = np.round(moves.spindle_rpm[row]), int(moves.line[row])
    pitch = half_feed / max(abs(turns), 1.0)
    is_tied = moves.pitch_mm[row] != 0
    if (np.abs(back.pitch_mm[rows] - moves.pitch_mm[row]) > pitch + SAME_MM).any():
        raise ReadError(f"line {line}: the thread does not come back with its pitch and hand", rows=[line])
    if not is_tied and (back.spindle_rpm[rows] != turns).any():
        raise ReadError(f"line {line}: the spindle does not come back with its speed and sense", rows=[line])


def _where_it_stands(moves, cuts, made):
    """[(cuts of the program made before, Stop)]: one between two pieces of a cut counts as behind it.

    Args:
        cuts: (m,) rows that cut.   made: (n + 1,) of them behind every cut of the program.
    """
    before = [(int(np.searchsorted(cuts, s.row)), s) for s in moves.stops
              if s.word in STANDS and (s.word != "G4" or s.seconds >= SAME_S)]
    return [(int(np.searchsorted(made, n)), s) for n, s in before]


def _pauses_compared(wanted, found):
    """Notes; the program's stops and dwells come back in their order, after as many cuts; the post may have more of its own.

    Raises:
        ReadError: one is missing; `.rows` holds its line.
    """
    notes, left = [], iter(found)
    for count, stop in wanted:
        there = next((s for n, s in left if n == count and s.word in (stop.word, "M0" if stop.word == "M1" else stop.word)
                      and abs(s.seconds - stop.seconds) < SAME_S), None)
        if there is None:
            raise ReadError(f"line {stop.line}: {stop.word} does not come back where it was meant: the new control has not the "
                            "words for it", rows=[stop.line])
        if there.word != stop.word:
            notes.append(f"line {stop.line}: the optional stop became one that always stops")
    return notes


def _leans(moves):
    """(n,) bool: moves whose tool leans at one end at least."""
    return np.maximum(np.abs(moves.start_axis - UPRIGHT), np.abs(moves.end_axis - UPRIGHT)).max(axis=1) > SAME_AXIS


class _ThroughJoints:
    """How near a leaning tool comes back through the joints of a machine: rounded angles, pieces of a line."""

    def __init__(self, control):
        self.turn_rad = np.radians(float(f"1e-{control.decimals_deg}"))
        self.arm_mm = 0.0 if control.tip_control else ARM_MM * self.turn_rad
        self.beside_mm = control.path_tolerance_mm

    def ends_there(self, moves, row, back, other, half_mm):
        """Whether a move read back ends where one of the program does, tip and axis, within the digits of both."""
        is_held = np.abs(back.end_axis[other] - moves.end_axis[row]).max() <= 2 * self.turn_rad
        return is_held and np.abs(back.end_mm[other] - moves.end_mm[row]).max() <= 2 * half_mm + self.arm_mm

    def is_same_path(self, moves, row, back, rows, half_mm):
        """Pieces of one line, at no more than its feed."""
        if moves.kind[row] != Kind.FEED or (back.kind[rows] != Kind.FEED).any():
            return False
        start, way = moves.start_mm[row], moves.end_mm[row] - moves.start_mm[row]
        share = np.clip(((back.end_mm[rows] - start) * way).sum(axis=1) / max((way * way).sum(), SAME_MM), 0.0, 1.0)
        off = np.abs(back.end_mm[rows] - start - share[:, None] * way).max()
        is_slow = back.feed_mm_per_min[rows].max() <= FASTER * moves.feed_mm_per_min[row]
        return bool(off <= 2 * half_mm + self.arm_mm + self.beside_mm and (np.diff(share) >= -SAME_SHARE).all() and is_slow)


def _ends_there(moves, row, back, other, half_mm):
    return np.abs(back.end_mm[other] - moves.end_mm[row]).max() <= half_mm * (4 if moves.kind[row] > Kind.FEED else 1)


def _is_same_path(moves, row, back, rows, allowed_mm):
    """A line is one line; an arc is arcs about its centre, or chords."""
    if np.abs(back.end_axis[rows[-1]] - moves.end_axis[row]).max() > SAME_AXIS:
        return False
    if moves.kind[row] == Kind.FEED:
        return len(rows) == 1 and back.kind[rows[0]] == Kind.FEED
    if (back.kind[rows] == Kind.FEED).all():
        return True
    axes = list(Plane(moves.plane[row]).axes[:2])
    return bool((back.kind[rows] == moves.kind[row]).all() and (back.plane[rows] == moves.plane[row]).all()
                and np.abs(back.center_mm[rows][:, axes] - moves.center_mm[row, axes]).max() <= allowed_mm)

