"""Reads RS-274 text (LinuxCNC's dialect) back into moves: what the controller will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.
"""

import re
from array import array
from contextlib import suppress
from math import hypot, inf, isfinite, nan, tau

import numpy as np

from cuspline.posts.readers.cutter_compensation import (
    LINUXCNC_TANGENT_RAD,
    Compensation,
    Element,
    Shifted,
    beside,
    check_way_out,
)
from cuspline.posts.readers.rs274_arcs import (
    MM_PER_INCH,
    center_from_radius,
    check_radii,
    is_same_point,
    sweep_rad,
)
from cuspline.posts.readers.rs274_blocks import blocks_of, refusal
from cuspline.posts.readers.rs274_codes import BY_LETTER, MOVE, MOVING_LETTERS, TAKEN_ALWAYS, Code, code_of, in_order
from cuspline.posts.readers.rs274_cycles import CYCLES, EVERY, TAPS, begun, way_of, with_words
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_flow import executed, is_closed_by_percent, refuse_text_after
from cuspline.posts.readers.rs274_modes import UNSAID, Rules, relied_on, relied_on_by_cycle
from cuspline.posts.readers.rs274_tools import read_tool_table
from cuspline.posts.readers.turns import turned_about
from cuspline.program.arcs import Arc
from cuspline.program.joint_sweeps import JointBlocks
from cuspline.program.posted import PostedMoves, Remark, Stop
from cuspline.program.program import Kind, Plane
from cuspline.values import fixed_math as fixed
from cuspline.values.coolants import BITS, FLOOD, MIST
from cuspline.values.errors import PostError
from cuspline.values.frames import Frame

__all__ = ["read_program", "read_tool_table"]

OPERATION = re.compile(r"\s*OPERATION\b[^:]*:([^,]*)", re.IGNORECASE)
PLANES = {"G17": Plane.XY, "G18": Plane.ZX, "G19": Plane.YZ}
COOLANTS = {"M7": (MIST, 0), "M8": (FLOOD, 0), "M9": (0, sum(BITS.values()))}      # BITS that they turn on, and off
KINDS = {"G0": Kind.RAPID, "G1": Kind.FEED, "G2": Kind.ARC_CW, "G3": Kind.ARC_CCW}
UNKNOWN = (nan, nan, nan)
SAME_SHIFT_MM = 6e-4        # half the last of three decimals, and a little
SAME_LENGTH_MM = 2e-5       # half the last of six decimals of an inch: a length written out is no nearer
NO_OFFSET = (0.0, 0.0, 0.0)
SYNCHRONISED = ("G33.1", "G331", "G332")        # feeds tied to the spindle
CYCLE_MM = 5e-4             # what one servo cycle adds to a blend at least; 0.33 um measured at 2500 mm/s^2
PLANE_RAD = 1e-5            # between the tool and the normal of a tilted plane: rounded angles
CHORD_MM = 1e-4             # off a leaning arc: a tenth of what the finest paths are posted within
COLUMNS = 27                # numbers kept of a move
RULES = Rules(code_of=code_of, modes=frozenset(UNSAID) - {"canned cycle", "local zero"}, takes_own_length=True, moves_z_alone=False,
              path_tolerance_mm=inf, cycles=CYCLES,
              compensation=Compensation(joins_by_arcs=True, needs_register=False, tangent_rad=LINUXCNC_TANGENT_RAD,
                                        enters_beside_own=True))


def read_program(text, *, work_offsets, tool_lengths, chain=None, tool_radii=None, coolants=None):
    """The moves of an RS-274 program.

    Args:
        text: the whole program.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each WCS origin, mm; the machine
            coordinates of a WCS that is not listed stay NaN.
        tool_lengths: {number: length offset, or offsets (x, y, z), mm}; a tool that is not listed is refused.
        chain: kinematics.Chain of a machine with rotary axes: the control runs its joints evenly through every block, and
            the moves are what the tip and the tool's axis do then, in as many pieces as it takes; rotary words are degrees
            in either unit, and the work offset turns nothing.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.  The spindle speed is negative while M4 turns it backwards.  What a move relies on
        before the text has said it, and a length offset that is not that of the tool in the spindle, are remarks.
    Raises:
        ReadError: the controller would refuse the text or might do something else; `.rows` holds the line.

    >>> moves = read_program("G21 G54\\nG0 X1 Y2 Z3\\nG1 X9 F100\\nM2", work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.line.tolist()
    ([9.0, 2.0, 3.0], [2, 3])
    """
    blocks = blocks_of(text)
    controller = Controller(work_offsets, tool_lengths, RULES, chain, tool_radii, coolants)
    end = controller.run(executed(blocks))
    if end is not None:
        refuse_text_after(blocks, end)
    elif not is_closed_by_percent(blocks):
        raise refusal(Complaint("the text stops without a program end", "end it with M2 or M30"), blocks[-1])
    del blocks                                     # larger than all that is made of them
    return controller.posted_moves()


class Controller:
    """The modal state, block after block, and the moves made so far."""

    def __init__(self, work_offsets, tool_lengths, rules, chain=None, tool_radii=None, coolants=None):
        """`rules`: rs274_modes.Rules of the control.   chain: kinematics.Chain; None: three axes.   tool_radii: {number: mm}.

        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; None: M7, M8 and M9 alone.
        """
        self.own_coolants = coolants or {}
        self.rules, self.code_of, self.actions = rules, self._with_own(rules.code_of), ACTIONS | dict(rules.actions)
        self.chain, self.rotaries = chain, () if chain is None else tuple(c.lower() for c in chain.rotaries)
        self.turned = self.turned_before = (nan,) * len(self.rotaries)      # degrees; where the move under way began
        self.minutes = 0.0                  # that it takes
        self.is_tip = False                 # tool-centre-point control: X Y Z are the tip in the part, whatever the rotaries do
        self.ends_tip = ""                  # word that ends it, beside the code that began it
        self.asked_plane = None             # of G68.2, that G53.1 has not taken up
        self.tilted = None                  # values.frames.Frame of a tilted plane in the WCS, between G68.2 and G69
        self.unnamed = frozenset()          # axes that a control wants named before the next cut
        self.asked_tip = None               # M68 has asked for it, M66 has not come yet
        self.moving = MOVING_LETTERS.union(self.rotaries)
        self.taken_by_motion = {"": TAKEN_ALWAYS | self.moving} | {
            code.name: TAKEN_ALWAYS | set("xyz") | set(self.rotaries) | code.takes
            for code in (self.code_of("g", k) for k in range(4))} | {
            name: TAKEN_ALWAYS | set("xyz") | self.code_of("g", int(name[1:])).takes for name in rules.cycles} | {
            name: TAKEN_ALWAYS | set("xyzk") for name in SYNCHRONISED}
        self.work_offsets = work_offsets
        self.tool_offsets = {n: NO_OFFSET[:2] + (float(v),) if np.ndim(v) == 0 else tuple(map(float, v))
                             for n, v in tool_lengths.items()}
        self.tip = UNKNOWN                  # in the active WCS
        self.unit_mm = None                 # the text has to say it
        self.bounds = rules.bounds[0]
        self.motion = ""
        self.cycle, self.return_level = None, "G98"     # rs274_cycles.Cycle in force
        self.pitch_mm = 0.0                 # of the move that comes, where the feed is tied to the spindle
        self.is_rigid = not rules.needs_rigid           # taps may go down: M29 was said
        self.plane = Plane.XY
        self.is_absolute, self.is_center_absolute, self.is_inverse_time = True, False, False
        self.wcs, self.offset = "G54", tuple(work_offsets.get("G54", UNKNOWN))
        self.is_foreign_wcs = bool(work_offsets) and "G54" not in work_offsets
        self.tool_offset, self.is_length_on = NO_OFFSET, False
        self.local, self.programmed = NO_OFFSET, NO_OFFSET      # G52; see `_correct_programmed`
        self.length_of, self.length_fault = 0, None     # tool whose offset is in force, 0 nobody's; (amount, advice)
        self.path_tolerance_mm = self.rounded_mm = rules.path_tolerance_mm      # in force; where corners are rounded
        self.unsaid, self.remarks = set(rules.modes), []
        self.feed, self.speed, self.speed_line, self.turning = 0.0, 0.0, 0, 0
        self.selected, self.tool = None, 0
        self.names, self.operation = [], -1
        self.block, self.line, self.call_line, self.is_machine_move = None, 0, 0, False
        self.radii = tool_radii or {}
        self.shifted, self.contour, self.is_leaving = None, [], False   # cutter_compensation.Shifted; its Elements so far; G40
        self.register = 0                   # whose radius shifts the moves that are added
        self.ended = False
        self.rows = array("d")              # COLUMNS a move
        self.joint_rows = array("d")        # of a machine with rotaries: angles before and after, minutes, length, zero
        self.stops = []                     # posted.Stop
        self.coolant, self.used_offsets = 0, {}     # values.coolants.BITS; names of work offsets, as an ordered set

    # words ------------------------------------------------------------------------------------------

    def run(self, steps):
        """Execute (block, words) one after the other; the block that ends the program, None where none does.

        Raises:
            ReadError: see `read_program`.
        """
        for block, words in steps:
            try:
                self.execute(block, words)
            except Complaint as complaint:
                raise refusal(complaint, block) from None
            if self.ended:
                return block
        return None

    def execute(self, block, words):
        """Do what one block says."""
        self.block, self.line, self.call_line, self.is_machine_move = block, block.number, block.call_line, False
        for comment in block.comments:
            self._note_operation(comment)
        codes, values = [], {}
        for letter, value in words:
            if letter in "gm":
                codes.append(self.code_of(letter, value))
                continue
            if letter in values:
                raise Complaint(f"two {letter.upper()} words", "leave one of them")
            values[letter] = value
            if letter in BY_LETTER:
                codes.append(BY_LETTER[letter])
        steps = self._steps(codes, values)
        if self.shifted is not None:
            self._refuse_beside_contour(steps)
        for code in steps:
            self.unsaid.discard(code.group)
            self.unsaid.discard(code.says)
            self.actions[code.group](self, code.name, values)
        if self.is_machine_move and MOVE not in steps:
            raise Complaint("G53 without a move", "G53 goes with G0 or G1 and axis words")
        if self.is_leaving:
            raise Complaint("G40 without a straight way in its block: controls differ in where they go then",
                            "write G40 G1 X Y, straight away from the contour")

    def _steps(self, codes, values):
        """The block's codes in the order of execution, with the move where there is one."""
        motion = next((code.name for code in codes if code.group == "motion"), "")
        of_axes = [code.name for code in codes if not code.takes.isdisjoint("xyz")]
        is_move = motion or not (of_axes or self.moving.isdisjoint(values))
        if len(of_axes) + bool(motion) > 1:
            raise Complaint(f"{' and '.join([*of_axes, motion][:2])} share the axis words", "write two blocks")
        taken = self.taken_by_motion[motion or self.motion] if is_move else TAKEN_ALWAYS
        if not values.keys() <= taken:
            _refuse_unused(values.keys() - taken.union(*(code.takes for code in codes)))
        if is_move:
            codes.append(MOVE)
        return in_order(codes) if len(codes) > 1 else codes

    def _note_operation(self, comment):
        named = OPERATION.match(comment)
        if named:
            name = named[1].strip().lower()
            if name not in self.names:
                self.names.append(name)
            self.operation = self.names.index(name)

    def _with_own(self, code_of):
        """The control's codes, and the machine's own M-codes of coolants.

        Raises:
            PostError: the control takes one of these for something else.
        """
        own = {float(name[1:]): Code(name, "coolant") for name in self.own_coolants}
        for number, code in own.items():
            with suppress(Complaint):
                if code_of("m", number).group != "coolant":
                    raise PostError(f"{code.name} is no coolant on this control: write the machine's own M-code into its file")
        return code_of if not own else lambda letter, number: (
            own[number] if letter == "m" and number in own else code_of(letter, number))

    # modes ------------------------------------------------------------------------------------------

    def set_feed_mode(self, name, values):
        """G93, G94: either forgets the feed, even where it changes nothing."""
        self.is_inverse_time, self.feed = name == "G93", 0.0

    def set_feed(self, name, values):
        if values["f"] < 0:
            raise Complaint("a feed below zero", "write a positive F")
        # LinuxCNC takes F before G20 or G21 of the same block, so in the unit that was active until then
        self.feed = values["f"] if self.is_inverse_time else values["f"] * self.length_unit_mm()

    def set_speed(self, name, values):
        if values["s"] < 0:
            raise Complaint("a spindle speed below zero", "write M4 for the other sense")
        self.speed, self.speed_line = values["s"], self.line

    def select_tool(self, name, values):
        self.selected = self._known_tool(values["t"])

    def change_tool(self, name, values):
        """The tool selected last comes into the spindle, which stops; the length offset stays."""
        self._refuse_under_tip(name)
        if self.selected is not None:
            self.tool = self.selected
        self.turning = 0
        self._compare_length()
        self._stand_still(name)

    def turn_spindle(self, name, values):
        self.turning = {"M3": 1, "M4": -1, "M5": 0}[name]
        self._stand_still(name)

    def set_coolant(self, name, values):
        """M9 ends all but what the machine ends by codes of its own."""
        on, off = self.own_coolants.get(name) or COOLANTS[name]
        self.coolant = (self.coolant | on) & ~off

    def do_once(self, name, values):
        """G4, G53, and G52: it takes back a shift that another program has left, or sets the tool in the spindle right."""
        if name == "G53" and not self.is_absolute:
            raise Complaint("G53 while G91 is active", "write G90 first")
        self.is_machine_move = name == "G53"
        if self.is_machine_move:
            self._refuse_under_tip(name)
        if name == "G4":
            self._wait(values)
        if name == "G52":
            self._shift_zero(values)

    def _wait(self, values):
        seconds = self.rules.dwell_unit_s * values["p"] if "p" in values else values.get("x", -1.0)
        if seconds < 0 or {"p", "x"} <= values.keys():
            raise Complaint("a dwell without its time", "write G4 P and the time")
        self._stand_still("G4", seconds)

    def _shift_zero(self, values):
        """The machine stands still, and so does the tip; what is programmed from here on is seen from another zero."""
        shift = tuple(values[c] * self.length_unit_mm() if values.get(c) else values.get(c, nan) for c in "xyz")
        own = (*self.tool_offsets.get(self.tool, NO_OFFSET)[:2], 0.0) if self.rules.moves_z_alone else NO_OFFSET
        if shift != NO_OFFSET and not all(abs(a - b) < SAME_SHIFT_MM for a, b in zip(shift, own)):
            raise Complaint("G52 that shifts the zero, or leaves it shifted in some axes",
                            "write G52 X0. Y0. Z0., and set the zero by a work offset")
        self.local = shift
        self._correct_programmed()

    def _correct_programmed(self):
        """What a programmed place lacks to the tip's: the local zero, less the tool's offset in axes that G43 leaves."""
        beside = self.tool_offset[:2] if self.rules.moves_z_alone else (0.0, 0.0)
        self.programmed = tuple(a - b for a, b in zip(self.local, (*beside, 0.0)))

    def set_plane(self, name, values):
        self.plane = PLANES[name]

    def set_units(self, name, values):
        mm, inch = self.rules.bounds
        self.unit_mm, self.bounds = (MM_PER_INCH, inch) if name == "G20" else (1.0, mm)

    def set_length(self, name, values):
        """G43, G43.1, G43.4, G49: the machine stands still, the tip's coordinate changes; G43.4 takes it under control."""
        if name == "G49" and self.ends_tip == "G49":
            self._switch(False)
            self.ends_tip = ""
        if self.tilted is None or name == "G43.4":
            self._refuse_under_tip(name)
        old = self.tool_offset
        self.length_of, self.tool_offset = {"G43": self._tool_offset, "G43.1": self._given_length, "G43.4": self._tool_offset,
                                            "G49": lambda values: (0, NO_OFFSET)}[name](values)
        self.is_length_on = self.length_of > 0 or name == "G43.1"
        self.tip = tuple(t + (a - b) for t, a, b in zip(self.tip, old, self.tool_offset))
        self._correct_programmed()
        self._compare_length()
        if name == "G43.4":
            self._switch(True)
            self.ends_tip = "G49"

    def set_wcs(self, name, values):
        """The machine stands still, the tip's coordinates change."""
        self._refuse_under_tip(name)
        if name != self.wcs:
            new = tuple(self.work_offsets.get(name, UNKNOWN))
            self.tip = tuple(t + (o - n) for t, o, n in zip(self.tip, self.offset, new))
            self.wcs, self.offset = name, new
            self.is_foreign_wcs = bool(self.work_offsets) and name not in self.work_offsets

    def _refuse_under_tip(self, name):
        if self.tilted is not None:
            raise Complaint(f"{name} in a tilted plane: controls differ in what they do then", "write G69 before")
        if self.is_tip:
            raise Complaint(f"{name} under tool-centre-point control: controls differ in what they do then", "switch it off before")

    def tilt_plane(self, name, values):
        """G68.2 says where a tilted plane lies, G53.1 takes the tool to stand on it, G69 ends it.  Nothing moves.

        X Y Z its zero, I J K its angles about Z, the new X and the new Z.  Which way G53.1 would turn the rotary axes is the
        control's choice: they must stand so already.
        """
        if name == "G69":
            if self.tilted is not None:
                if self.is_length_on:
                    raise Complaint("G69 while a tool length is in force", "write G49 before")
                self.tip = tuple(self.tilted.out(np.array([self.tip]))[0].tolist())
                self.tilted = None
                self._switch(False)
            return
        if name == "G68.2":
            if self.tilted is not None or self.is_tip or self.is_length_on or not self.rotaries:
                raise Complaint("G68.2 in another tilted plane, under a tool length, or without rotary axes",
                                "write G49 and G69 before; read with the machine's rotary axes")
            if not set("xyzijk") <= values.keys():
                raise Complaint("G68.2 without all of X Y Z I J K", "write its zero and its three angles")
            self.asked_plane = _plane_of([values[c] * self.length_unit_mm() for c in "xyz"], *(values[c] for c in "ijk"))
            return
        if self.asked_plane is None:
            raise Complaint("G53.1 without a tilted plane", "write G68.2 before")
        if not isfinite(sum(self.turned)):
            raise Complaint("G53.1 while nobody knows where the rotary axes stand", "name every rotary axis by G53 G0 before")
        axis = self.chain.forward([[0.0, 0.0, 0.0, *np.radians(self.turned)]])[1][0]
        if np.abs(axis - self.asked_plane.rotation[:, 2]).max() > PLANE_RAD:
            raise Complaint("G53.1 would turn the rotary axes, and which way is the control's choice",
                            "name the angles that hold the tool square to the plane by G53 G0 before")
        self._switch(True)
        self.tilted, self.asked_plane = self.asked_plane, None
        self.tip = tuple(self.tilted.into(np.array([self.tip]))[0].tolist())

    def switch_kinematics(self, name, values):
        """M428, M429; or M68 E3 Q1 (Q0) and M66 E0 L0, which waits until that is done.  The machine stands still."""
        if name == "M68":
            if values.get("e") != 3 or values.get("q") not in (0, 1):
                raise Complaint("M68 for anything but the kinematics", "write M68 E3 Q1 or M68 E3 Q0")
            self.asked_tip = values["q"] == 1
        elif name == "M66":
            if self.asked_tip is None or values.get("e") != 0 or values.get("l") != 0:
                raise Complaint("M66 that waits for no change of kinematics", "write M66 E0 L0 behind M68 E3")
            self._switch(self.asked_tip)
            self.asked_tip = None
        else:
            self._switch(name == "M428")

    def _switch(self, to_tip):
        """The tip's coordinates as they are counted from here on."""
        if not self.rotaries:
            raise Complaint("tool-centre-point control without rotary axes", "take it out, or read with the machine's rotary axes")
        if to_tip == self.is_tip:
            return
        if to_tip and not (self.is_length_on or self.asked_plane):
            raise Complaint("tool-centre-point control without a tool length", "write G43 H with the tool's number before")
        place, length = np.add(self.tip, self.offset if self.is_tip else self._shift()), self.tool_offset[2]
        known = isfinite(sum(place) + sum(self.turned))
        if known and to_tip:
            place = self.chain.forward([[*place, *np.radians(self.turned)]], length)[0][0]
        elif known:
            place = self.chain.placed([place], [np.radians(self.turned)], length)[0, :3]
        self.is_tip = to_tip
        shift = self.offset if to_tip else self._shift()
        self.tip = tuple(float(p - s) for p, s in zip(place, shift)) if known else UNKNOWN

    def set_path_control(self, name, values):
        """G61, G61.1, G64: blocks are joined within Q, which is P where it is left out, then blended.

        Blends are computed for P, but begin on a servo cycle: up to another P, or CYCLE_MM, counts.
        """
        if name == "G64" and not values.get("p", 0.0) > 0:
            raise Complaint("G64 without P lets the machine leave the path by any amount",
                            "write the tolerance: G64 P0.01")
        if values.get("q", 0.0) < 0:
            raise Complaint("a tolerance below zero", "write a positive Q, or Q0")
        p = values["p"] * self.length_unit_mm() if name == "G64" else 0.0
        self.path_tolerance_mm = p + max(p, CYCLE_MM) + values.get("q", values["p"]) * self.length_unit_mm() if p else 0.0

    def set_corner_mode(self, name, values):
        """G61 stops at every corner; what G64 does there is set in the control."""
        self.path_tolerance_mm = 0.0 if name == "G61" else nan

    def go_home(self, name, values):
        """G28: rapid to the machine's reference, its zero, in the axes named; only from where they stand."""
        self._refuse_under_tip(name)
        axes = [c for c in "xyz" if c in values]
        if not axes or self.is_absolute or any(values[c] for c in axes):
            raise Complaint("G28 by way of another place", "write G91 G28 Z0. (and X0. Y0.), then G90")
        self._rely_on(("canned cycle",))
        shift = self._shift()
        start, end = self.tip, tuple(-s if c in axes else t for c, s, t in zip("xyz", shift, self.tip))
        self._add(Kind.RAPID, start, end, UNKNOWN, 0, 0.0)

    def set_distance(self, name, values):
        self.is_absolute = name == "G90"

    def set_arc_distance(self, name, values):
        self.is_center_absolute = name == "G90.1"

    def cancel_cycle(self, name, values):
        if self.cycle is not None and self.cycle.name in TAPS:
            self.turning, self.is_rigid = 0, not self.rules.needs_rigid
        self.motion, self.cycle = "", None

    def tie_spindle(self, name, values):
        """M29: the tapping cycle behind it is rigid."""
        if "s" not in values:
            raise Complaint("M29 without S", "write the spindle's speed in its block")
        self.is_rigid = True

    def set_return_level(self, name, values):
        self.return_level = name

    def set_motion(self, name, values):
        self.motion = name
        if name not in EVERY:
            self.cycle = None

    def stop(self, name, values):
        self.ended = name in ("M2", "M30")
        if self.ended:
            self._refuse_coolant_that_runs_on()
        self._stand_still(name)

    def _refuse_coolant_that_runs_on(self):
        """The end of a program ends what M9 ends; a machine's own coolant runs on until its own word."""
        runs_on = self.coolant & ~self.own_coolants.get("M9", COOLANTS["M9"])[1]
        if runs_on:
            words = [word for word, (on, off) in self.own_coolants.items() if off & runs_on]
            name = next(name for name, bits in BITS.items() if bits & runs_on)
            raise Complaint(f"the program ends while the coolant {name} runs", f"write {' or '.join(words)} before the end")

    def _stand_still(self, name, seconds=0.0):
        self.stops.append(Stop(row=len(self.rows) // COLUMNS, line=self.line, word=name, seconds=seconds))

    # cutter compensation ----------------------------------------------------------------------------

    def compensate(self, name, values):
        """G41 and G42: the contour that follows is run beside, on its left or right; G40 leads away from it."""
        if name == "G40":
            self.is_leaving = self.shifted is not None
            return
        self._refuse_contour_here(name)
        if "d" not in values and self.rules.compensation.needs_register:
            raise Complaint(f"{name} without D takes the register that was last in force", "write D with the tool's number")
        register = int(values.get("d", 0)) or self.tool
        if register not in self.radii:
            raise Complaint(f"{name} while the radius in D{register} is not known", "read it with the radii of the tool table")
        if register != self.tool:
            self._remark("wrong_radius_offset", round(abs(self.radii[register] - self.radii.get(self.tool, 0.0)), 6),
                         f"D{register} is in force with T{self.tool} in the spindle: write D{self.tool}")
        self.shifted = Shifted(side=1.0 if name == "G41" else -1.0, radius_mm=self.radii[register], register=register,
                               line=self.line)

    def _refuse_contour_here(self, name):
        """What controls do then differs, or is another compensation's."""
        for is_so, what, advice in (
                (self.shifted is not None, "another in force", "write G40 before"),
                (self.plane != Plane.XY, f"the {self.plane.name} plane", "write G17"),
                (self.is_inverse_time, "G93", "write G94"),
                (self.is_tip and self.tilted is None, "tool-centre-point control", "switch it off before"),
                (not self._is_along_z(), "a tool that is not along Z", "turn the part until it is, or tilt the plane to it"),
                (self.cycle is not None, "a canned cycle", "write G80 before")):
            if is_so:
                raise Complaint(f"{name} with {what}", advice)

    def _is_along_z(self):
        """Whether the tool is along the words' Z: in a tilted plane, with the rotaries at 0, or where the part alone has turned."""
        if self.tilted is not None or not any(self.turned):
            return True
        if not isfinite(sum(self.turned)):
            return False
        with suppress(PostError):
            return self.chain.off_z(np.radians(self.turned)) < PLANE_RAD
        return False

    def _refuse_beside_contour(self, steps):
        other = [code.name for code in steps if code.group not in ("motion", "move", "feed", "cutter compensation", "distance")
                 and PLANES.get(code.name) != self.plane]
        if other:
            raise Complaint(f"{other[0]} while the cutter compensation of line {self.shifted.line} is on", "write G40 before")

    def _follow(self, kind, start, end, center, feed):
        """A block between G41 and G40: kept until the one behind it is known."""
        element = Element(complex(*start[:2]), complex(*end[:2]), (start[2], end[2]), feed, self.block,
                          None if kind <= Kind.FEED else complex(*center[:2]), 1.0 if kind == Kind.ARC_CCW else -1.0)
        if element.start == element.end and element.center is None:
            raise Complaint("a block without a way in X or Y while cutter compensation is on", "write G40 before it")
        if self.turned != self.turned_before:
            raise Complaint("a rotary axis that turns while cutter compensation is on", "write G40 before it")
        self.tip = end
        if not self.is_leaving:
            self.contour.append(element)
            return
        self.is_leaving = False
        if not self.contour:
            raise Complaint("G40 before the compensated contour has begun", "write the contour between G41 and G40")
        check_way_out(self.contour[-1], element, self.shifted.radius_mm)
        made = beside(self.contour, self.shifted, self.rules.compensation)
        self._run([*made, element._replace(start=made[-1].end)])
        self.shifted, self.contour = None, []

    def _run(self, elements):
        """Moves of the cutter's middle, each said by its own block."""
        self.register = self.shifted.register
        for e in elements:
            self.block, self.line, self.call_line = e.block, e.block.number, e.block.call_line
            start, end = ((p.real, p.imag, z) for p, z in zip((e.start, e.end), e.z))
            kind = Kind.FEED if e.feed else Kind.RAPID
            center = UNKNOWN
            if e.center is not None:
                kind, center = Kind.ARC_CCW if e.turn > 0 else Kind.ARC_CW, (e.center.real, e.center.imag, start[2])
            self.minutes = e.length_mm / e.feed if e.feed else 0.0
            self._add(kind, start, end, center, 0, e.feed)
        self.register = 0

    # moves ------------------------------------------------------------------------------------------

    def move(self, name, values):
        if self.motion in EVERY:
            self._drill(values)
            return
        if self.motion in SYNCHRONISED:
            self._tap(values)
            return
        if not self.motion:
            raise Complaint("axis words, but no G0 G1 G2 G3 is active", "write the motion code in this block")
        kind, start = KINDS[self.motion], self.tip
        self._refuse_half_way()
        if self.tilted is not None and not set(self.rotaries).isdisjoint(values):
            raise Complaint("a rotary word in a tilted plane", "write G69 before rotary axes turn")
        if self.unsaid:
            self._rely_on(relied_on(kind, values, self.is_machine_move))
        self._remark_offsets(needs_length=kind != Kind.RAPID or "z" in values and not self.is_machine_move)
        if not self.is_machine_move:
            self.used_offsets[self.wcs] = True
        end = self._machine_end(values) if self.is_machine_move else self._end(values)
        if kind != Kind.RAPID:
            self._require_known(start, end)
        if kind <= Kind.FEED:
            center, turns, length_mm = UNKNOWN, 0, hypot(*(e - s for s, e in zip(start, end)))
        else:
            end, center, turns, length_mm = self._arc(kind == Kind.ARC_CW, start, end, values)
        feed = self._feed(length_mm, values) if kind != Kind.RAPID else 0.0
        if self.rotaries:
            self.turned = self._turned_end(kind, values)
            self.minutes = self._minutes(kind, length_mm)
        if self.shifted is not None:
            if turns or self.is_leaving and kind > Kind.FEED:
                raise Complaint("an arc of more than a turn, or one with G40", "write single arcs, and G40 with G1")
            self._follow(kind, start, end, center, feed)
            return
        self._add(kind, start, end, center, turns, feed)

    def _refuse_half_way(self):
        """No move between two blocks that belong together."""
        if self.asked_plane is not None:
            raise Complaint("a move between G68.2 and G53.1", "write G53.1 before, so that the tool stands square to the plane")
        if self.asked_tip is not None:
            raise Complaint("a move while M68 E3 changes the kinematics", "write M66 E0 L0 before, which waits for it")

    def _remark_offsets(self, needs_length):
        """A zero or a tool length that is not the setup's, once."""
        if self.is_foreign_wcs and not self.is_machine_move:
            self._remark("wrong_work_offset", 0.0, f"{self.wcs} is in force, the setup's zero is "
                                                   f"{' '.join(self.work_offsets)}: write that")
            self.is_foreign_wcs = False
        if self.length_fault and needs_length:
            self._remark("wrong_length_offset", *self.length_fault)
            self.length_fault = None

    def _drill(self, values):
        """One hole of a canned cycle."""
        self._refuse_half_way()
        self._refuse_cycle_here()
        if self.unsaid:
            self._rely_on(relied_on_by_cycle(values))
        self._remark_offsets(needs_length=True)
        self.used_offsets[self.wcs] = True
        context = (self.unit_mm, self.wcs, self.offset, self.tool, self.tool_offset, self.local, self.return_level)
        cycle = begun(self.motion, self.cycle, self.tip[2], context)
        end, unit_mm = self._end(values), self.length_unit_mm()
        height = lambda letter: values[letter] * unit_mm + self.programmed[2] if letter in values else None
        cycle = with_words(cycle, cycle is not self.cycle, values, height("z"), height("r"))
        self.cycle = cycle = cycle._replace(q=values["q"] * unit_mm) if "q" in values else cycle
        if self.motion in ("G83", "G73") and not cycle.q > 0:
            raise Complaint(f"{self.motion} with a peck of nothing", "write Q above 0")
        self._require_known(self.tip, (*end[:2], cycle.z))
        tied_mm = self._tied_mm() if cycle.name in TAPS else 0.0
        for kind, place in way_of(cycle, self.tip, end[:2], self.return_level == "G99", self.rules.peck_clearance_mm):
            length_mm = hypot(*(e - s for s, e in zip(self.tip, place)))
            feed = self._feed(length_mm, values) if kind != Kind.RAPID else 0.0
            self.minutes = length_mm / feed if feed else 0.0
            self.pitch_mm = tied_mm if kind != Kind.RAPID else 0.0
            self._add(kind, self.tip, place, UNKNOWN, 0, feed)
            if cycle.p and kind == Kind.FEED and cycle.name == "G82":
                self._stand_still("G4", self.rules.dwell_unit_s * cycle.p)
        self.pitch_mm = 0.0

    def _tied_mm(self):
        """Way a turn of a tapping cycle, below 0 where the spindle turns backwards on the way down."""
        if not self.is_rigid:
            raise Complaint(f"{self.motion} without M29: it would count on a holder that gives way", "write M29 S before it")
        if not self.speed > 0:
            raise Complaint(f"{self.motion} without a spindle speed", "write S before it")
        self.turning = int(TAPS[self.motion])
        return TAPS[self.motion] * self._feed(0.0, {}) / self.speed

    def _tap(self, values):
        """G33.1 down and back, G331 down, G332 back: along Z by K a turn of the spindle."""
        self._refuse_cycle_here()
        self._rely_on(relied_on(Kind.FEED, values, False))
        self._remark_offsets(needs_length=True)
        self.used_offsets[self.wcs] = True
        start, end = self.tip, self._end(values)
        self._require_known(start, end)
        if "z" not in values or start[:2] != end[:2] or not values.get("k"):
            raise Complaint(f"{self.motion} without Z or K, or with a way across", "go over the hole by G0, then write Z and K")
        k_mm = values["k"] * self.length_unit_mm()
        if self.motion != "G33.1":
            self.turning = 1 if k_mm > 0 else -1
        elif k_mm < 0 or not self.turning:
            raise Complaint("G33.1 with K below 0, or while the spindle stands", "K is a length: M3 or M4 says the hand")
        if not self.speed > 0:
            raise Complaint(f"{self.motion} without a spindle speed", "write S before it")
        self.pitch_mm, feed = self.turning * abs(k_mm), abs(k_mm) * self.speed
        for a, b in ((start, end), (end, start)) if self.motion == "G33.1" else ((start, end),):
            self.minutes = abs(b[2] - a[2]) / feed
            self._add(Kind.FEED, a, b, UNKNOWN, 0, feed)
        self.pitch_mm = 0.0
        if self.motion == "G332":
            self.turning = 0

    def _refuse_cycle_here(self):
        """What cycles do then differs from control to control."""
        for is_so, what, advice in (
                (not self.is_absolute, "G91", "write G90"), (self.is_inverse_time, "G93", "write G94"),
                (self.plane != Plane.XY, f"the {self.plane.name} plane", "write G17"),
                (self.is_machine_move, "G53", "G53 goes with G0 or G1"),
                (self.is_tip and self.tilted is None, "tool-centre-point control", "switch it off before"),
                (not isfinite(sum(self.turned)), "a rotary axis nobody knows the place of", "name every rotary axis by G0 first")):
            if is_so:
                raise Complaint(f"a canned cycle with {what}", advice)

    def _turned_end(self, kind, values):
        """Degrees of the rotaries at the end of the move."""
        base = [0.0 if self.is_absolute or self.is_machine_move else t for t in self.turned]
        turned = tuple([b + values[c] if c in values else t for c, b, t in zip(self.rotaries, base, self.turned)])
        if kind != Kind.RAPID and not isfinite(sum(turned) + sum(self.turned)):
            unknown = " ".join(c.upper() for c, a, b in zip(self.rotaries, self.turned, turned) if not isfinite(a + b))
            raise Complaint(f"a cutting move while nobody knows where {unknown} stands", "name every rotary axis by G0 first")
        if kind != Kind.RAPID and turned != self.turned and not (self.is_tip or self.is_inverse_time):
            raise Complaint("a cutting move that turns rotary axes under G94 without tool-centre-point control",
                            "switch it on before (M428, G43.4 H), or state times by G93: F would be of X Y Z alone")
        if kind > Kind.FEED and turned != self.turned:
            raise Complaint("an arc while a rotary axis turns", "write chords: the joints, not the tip, would run on the arc")
        if kind > Kind.FEED and any(turned) and self.is_tip and self.tilted is None:
            raise Complaint("an arc while a rotary axis is off 0 under tool-centre-point control",
                            "write chords: controls differ in its plane then")
        if any(self.tool_offset[:2]) and any(turned):
            raise Complaint("an angle head while a rotary axis is off 0", "leave the rotary axes at 0")
        return turned

    def _minutes(self, kind, length_mm):
        """What a cutting block takes: F is one over it under G93, else along X Y Z, or of the rotaries where these stand."""
        if kind == Kind.RAPID:
            return 0.0
        if self.is_inverse_time:
            return 1.0 / self.feed
        turned_deg = hypot(*(b - a for a, b in zip(self.turned_before, self.turned)))
        return length_mm / self.feed or turned_deg * self.length_unit_mm() / self.feed

    def _add(self, kind, start, end, center, turns, feed):
        """One move as it is made; arcs that lean in the WCS, where no plane holds them, as chords."""
        if kind > Kind.FEED and (self.tilted is not None or any(self.turned)):
            ways = [tuple(map(float, point)) for point in Arc(start, end, center, self.plane, kind, turns).chords(CHORD_MM)]
            minutes = self.minutes / len(ways)
            for before, after in zip([start, *ways], ways):
                self.minutes = minutes
                self._add(Kind.FEED, before, after, UNKNOWN, 0, feed)
            return
        machine = [t + s for t, s in zip(end, self._shift())]
        self.tip = end
        if self.tilted is not None:
            start, end = self.tilted.out(np.array([start, end])).tolist()
        self.rows.extend((kind, *start, *end, *center, self.plane if kind > Kind.FEED else 0, turns, feed,
                          self.turning * self.speed, self.tool, self.is_length_on, *machine, self.line,
                          self.operation, self.path_tolerance_mm, self.speed_line, self.call_line, self.coolant, self.pitch_mm,
                          self.register))
        if self.rotaries:
            length_mm = self.tool_offsets[self.tool][2] if self.tool else self.tool_offset[2]
            self.joint_rows.extend((*self.turned_before, *self.turned, self.minutes, length_mm, *self.offset,
                                    self.tool_offset[2] if self.is_tip else nan))
            self.turned_before, self.minutes = self.turned, 0.0

    def _shift(self):
        """Machine less WCS coordinates."""
        return tuple([o + t for o, t in zip(self.offset, self.tool_offset)])

    def _end(self, values):
        unit_mm = self.length_unit_mm()
        if self.is_absolute:
            return tuple([values[c] * unit_mm + p if c in values else t for c, t, p in zip("xyz", self.tip, self.programmed)])
        return tuple([t + values.get(c, 0.0) * unit_mm for c, t in zip("xyz", self.tip)])

    def _machine_end(self, values):
        if KINDS[self.motion] > Kind.FEED:
            raise Complaint("G53 with an arc", "G53 goes with G0 or G1")
        unit_mm, shift = self.length_unit_mm(), self._shift()
        return tuple([values[c] * unit_mm - s if c in values else t for c, t, s in zip("xyz", self.tip, shift)])

    def _arc(self, is_clockwise, start, end, values):
        """(end, centre, extra turns, length in mm); an end rounding away from the start is put onto it."""
        first, second, third = self.plane.axes
        a, b = (start[first], start[second]), (end[first], end[second])
        c = self._center(is_clockwise, a, b, values)
        sweep = sweep_rad(a, b, c, is_clockwise)
        turns = self._turns(values)
        end, center = list(end), list(start)
        if is_same_point(a, b):
            end[first], end[second] = a
        center[first], center[second] = c
        around_mm = hypot(a[0] - c[0], a[1] - c[1]) * (sweep + tau * turns)
        return tuple(end), center, turns, hypot(around_mm, end[third] - start[third])

    def _center(self, is_clockwise, start, end, values):
        axes, unit_mm = self.plane.axes, self.length_unit_mm()
        first, second, third = ("ijk"[axis] for axis in axes)
        if "r" in values:
            if values.keys() & {"i", "j", "k"}:
                raise Complaint("R and I J K in one arc", "give the radius or the centre")
            return center_from_radius(start, end, values["r"] * unit_mm, is_clockwise, self.bounds)
        if third in values or not (first in values or second in values):
            raise Complaint(f"an arc in the {self.plane.name} plane without its centre",
                            f"give {first.upper()} and {second.upper()}, or R; no {third.upper()}")
        if self.is_center_absolute and not (first in values and second in values):
            raise Complaint("half a centre under G90.1", f"give both {first.upper()} and {second.upper()}")
        base = (0.0, 0.0) if self.is_center_absolute else start
        center = tuple(b + values.get(letter, 0.0) * unit_mm for b, letter in zip(base, (first, second)))
        check_radii(start, end, center, self.bounds)
        return center

    def _turns(self, values):
        turns = values.get("p", 1.0)
        if turns < 1 or turns != int(turns):
            raise Complaint(f"P{turns:g} turns", "P is 1 or another whole number above")
        return int(turns) - 1

    def _feed(self, length_mm, values):
        if self.is_inverse_time and "f" not in values:
            raise Complaint("a cutting block without F under G93", "G93 needs F in every G1 G2 G3 block")
        if not self.feed > 0:
            raise Complaint("a cutting move, but no feed is set", "write F")
        return self.feed * length_mm if self.is_inverse_time else self.feed

    def _require_known(self, start, end):
        if not isfinite(sum(start) + sum(end)):
            unknown = " ".join(n for n, s, e in zip("XYZ", start, end) if not isfinite(s + e))
            raise Complaint(f"a cutting move while nobody knows where {unknown} stands",
                            "go to a named place by G0 first")

    # what is held against moves ---------------------------------------------------------------------

    def _remark(self, kind, amount_mm, advice):
        """About the move that comes next."""
        self.remarks.append(Remark(kind=kind, amount_mm=amount_mm, row=len(self.rows) // COLUMNS, advice=advice))

    def _rely_on(self, modes):
        """A move hangs on modes: those that the text has not said are remarked once."""
        for mode in [mode for mode in modes if mode in self.unsaid]:
            word, what = self.rules.words.get(mode) or UNSAID[mode]
            self._remark("unknown_start", 0.0, f"{word} is missing: {what} is as the program before left it; write "
                                               f"{word} before this move")
            self.unsaid.discard(mode)

    def _compare_length(self):
        """Hold the length offset in force against the tool in the spindle."""
        self.length_fault = None
        if not (self.is_length_on and self.tool) or self.length_of == self.tool:
            return
        own = self.tool_offsets[self.tool]
        off_mm = max(abs(a - b) for a, b in zip(own, self.tool_offset))
        if self.length_of or off_mm > SAME_LENGTH_MM:
            said = f"H{self.length_of}" if self.length_of else f"G43.1 Z{self.tool_offset[2]:g} mm"
            self.length_fault = off_mm, (f"{said} is in force with T{self.tool} in the spindle, whose length is "
                                         f"{own[2]:g} mm: write G43 H{self.tool}")

    # small facts ------------------------------------------------------------------------------------

    def length_unit_mm(self):
        """Of the words, as G20 or G21 has it."""
        if self.unit_mm is None:
            raise Complaint("a length before G20 or G21 was said", "write G21 or G20 in a block above")
        return self.unit_mm

    def _known_tool(self, number):
        if number and number not in self.tool_offsets:
            raise Complaint(f"tool {number:g} is not in the tool table",
                            f"it lists {', '.join(str(n) for n in sorted(self.tool_offsets)) or 'no tools'}")
        return int(number)

    def _tool_offset(self, values):
        """(tool whose offset it is, offset) of a G43."""
        tool = self._known_tool(values.get("h", 0.0))
        if self.rules.takes_own_length:
            tool = tool or self.tool
        elif "h" not in values:
            raise Complaint("G43 without H takes the offset that was last in force", "write H with the tool's number")
        return tool, self.tool_offsets[tool] if tool else NO_OFFSET

    def _given_length(self, values):
        if "z" not in values:
            raise Complaint("G43.1 without Z", "write G43.1 Z length")
        return 0, (0.0, 0.0, values["z"] * self.length_unit_mm())

    def posted_moves(self):
        """All moves as one value."""
        table = np.frombuffer(self.rows).reshape(-1, COLUMNS)
        (kind, start, end, center, plane, turns, feed, speed, tool, is_length_on, machine, line, operation, tolerance,
         speed_line, call_line, coolant, pitch, register) = np.split(
            table, (1, 4, 7, 10, 11, 12, 13, 14, 15, 16, 19, 20, 21, 22, 23, 24, 25, 26), axis=1)
        read = PostedMoves(
            kind=kind[:, 0], start_mm=start, end_mm=end, center_mm=center, plane=plane[:, 0], turns=turns[:, 0],
            feed_mm_per_min=feed[:, 0], spindle_rpm=speed[:, 0], tool=tool[:, 0],
            length_offset_on=is_length_on[:, 0], machine_end_mm=machine, line=line[:, 0],
            operation=operation[:, 0], operations=tuple(self.names), ended=self.ended,
            path_tolerance_mm=tolerance[:, 0], pitch_mm=pitch[:, 0], speed_line=speed_line[:, 0], call_line=call_line[:, 0],
            coolant=coolant[:, 0], radius_register=register[:, 0], work_offsets=tuple(self.used_offsets),
            remarks=tuple(self.remarks), stops=tuple(self.stops))
        if not self.rotaries:
            return read
        blocks = self._joint_blocks(start, end, machine)
        del table, kind, start, end, center, plane, turns, feed, speed, tool, is_length_on, machine, line, operation, tolerance
        del speed_line, call_line, coolant, pitch, register
        self.rows = self.joint_rows = None         # of a million moves 300 MB, before as much comes of them
        return read.through_joints(self.chain, blocks)

    def _joint_blocks(self, start, end, machine):
        """JointBlocks of all moves."""
        r = len(self.rotaries)
        before, after, minutes, length, origin, tip_length = np.split(
            np.frombuffer(self.joint_rows).reshape(-1, 2 * r + 6), (r, 2 * r, 2 * r + 1, 2 * r + 2, 2 * r + 5), axis=1)
        is_tip = np.isfinite(tip_length)
        return JointBlocks(start_mm=np.where(is_tip, start + origin, machine - (end - start)),
                           end_mm=np.where(is_tip, end + origin, machine), start_deg=before, end_deg=after,
                           length_mm=length[:, 0], origin_mm=origin, minutes=minutes[:, 0], tip_length_mm=tip_length[:, 0])


def _refuse_unused(letters):
    if letters:
        raise Complaint(f"no code in this block uses {' '.join(sorted(letters)).upper()}",
                        "remove it, or add the code it belongs to")


def _plane_of(zero_mm, i_deg, j_deg, k_deg):
    """Frame of a plane by its zero and its angles about Z, the new X and the new Z."""
    turned = fixed.matmul(fixed.matmul(turned_about(2, i_deg), turned_about(0, j_deg)), turned_about(2, k_deg))
    return Frame(rotation=turned, origin_mm=zero_mm)


ACTIONS = {
    "tilted plane": Controller.tilt_plane,
    "kinematics": Controller.switch_kinematics,
    "feed mode": Controller.set_feed_mode, "feed": Controller.set_feed, "speed": Controller.set_speed,
    "select tool": Controller.select_tool, "tool change": Controller.change_tool,
    "spindle": Controller.turn_spindle, "coolant": Controller.set_coolant,
    "plane": Controller.set_plane, "units": Controller.set_units,
    "cutter compensation": Controller.compensate, "tool length": Controller.set_length,
    "work offset": Controller.set_wcs, "path control": Controller.set_path_control,
    "corner mode": Controller.set_corner_mode, "reference": Controller.go_home,
    "distance": Controller.set_distance, "arc distance": Controller.set_arc_distance,
    "canned cycle": Controller.cancel_cycle, "rigid tapping": Controller.tie_spindle, "return level": Controller.set_return_level,
    "non-modal": Controller.do_once, "motion": Controller.set_motion,
    "move": Controller.move, "stopping": Controller.stop,
}
