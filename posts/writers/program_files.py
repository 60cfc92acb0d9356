"""A Program as text in a control's dialect: one file, or a numbered set.

It is split at restart points, and among plain moves where the tool stands at the clearance height.

    head        comments, known state                         )
    operation   tool, rotary axes, spindle, sub-programs,      )
                registers, start                               ) in every file of a set
    passes      restart point, calls, restart point, calls ...   as many as the store takes
    foot        spindle off, up, end
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from cuspline.posts.writers.compensated_words import CompensatedMoves
from cuspline.posts.writers.cycle_words import DrilledMoves
from cuspline.posts.writers.joint_words import PlainMoves, SolvedMoves, leans
from cuspline.posts.writers.sub_programs import (
    SubPrograms,
    Variables,
    calls_between,
    largest_rounding_mm,
    main_lines,
    restart_number,
)
from cuspline.posts.writers.tilted_words import TiltedMoves, frame_of
from cuspline.posts.writers.tip_words import TipMoves
from cuspline.posts.writers.words import COOLANT_WORD, Posted, Writer, check_lines, in_brackets
from cuspline.program.arcs import lowest_z_mm
from cuspline.program.program import TILT_RAD, Kind, Plane
from cuspline.program.sub_blocks import sub_blocks_of
from cuspline.values.errors import PostError

LARGEST_NUMBER = 99999      # of a block
SET_UP_MM = 1.0             # over the surface that cycles of their own count from, where the feed begins
HEIGHT_MM = 1e-6         # below the clearance height that is rounding
LATER_BYTES = 160           # of the store: the header's verdict is longer than the line that it replaces
LATER_SUB_BLOCKS = 8        # the program's name in its last line


class Dialect(ABC):
    """How one kind of control wants things written."""

    coolants: Mapping = COOLANT_WORD        # words by name
    point: str                  # behind a number without decimals
    end: str                    # the word that ends the program
    variables: Variables | None = None      # of sub-programs; None: repeated passes go out move by move
    comment = staticmethod(in_brackets)     # how a text is told to the operator alone
    knows_rotaries = False                  # whether it writes rotary words
    knows_radii = False                     # whether it can write arcs by their radius, R
    holds_beside = False                    # whether it can shift the zero for a tool beside the spindle's axis
    unnumbered = ("(", ";", "%", "O", "o", "N")     # how lines begin that get no block number
    one_tool_a_file = False                 # the control changes no tool: every tool has a file of its own
    tip_controls: tuple[str, ...] = ()      # words of Control.tip_control that it writes
    has_planes = False                      # indexed positions go out in tilted planes, where there is tip control
    plane_note = "A TILTED PLANE: ANY ZERO AND TOOL LENGTH WITHIN THE TRAVELS"
    states_times = True                     # of blocks (G93); without it a leaning tool goes out under tip control alone
    cycle_words: dict[str, str] = {}        # DrillCycle.word -> the control's; without it holes go out move by move
    has_drilling = False                    # whether it calls holes one by one, by `drill`, in place of `cycle_words`
    work_offsets: tuple[str, ...] | None = None     # that the control has; None: whatever a program names
    writes: type[Writer] = Writer           # how moves become its words
    knows_swivel = False                    # whether it writes Control.swivel_record and feed_parameters
    tip_rapid = "G0"                        # under tool-centre-point control; G1 where rapids do not heed the joints' speeds
    tip_blend_share = None                  # of the path tolerance, for P of G64 under it, where blends of blocks take time

    def writer(self, machine):
        """A Writer of this dialect."""
        writer = self.writes(machine, self.point, self.comment, machine.rotaries, planes_of(machine.control))
        if machine.control.block_numbers:
            writer.number_bytes = max(writer.number_bytes, len(f"N{LARGEST_NUMBER} "))
        return writer

    @abstractmethod
    def head(self, writer, program, file_number):
        """Everything before the first operation."""

    @abstractmethod
    def up(self, writer):
        """The spindle to the top of the machine."""

    def in_machine(self, writer, *words):
        """A rapid in machine coordinates: of the spindle nose without tool length, or of rotary axes."""
        writer.block("G53", "G0", *words)

    def stop(self, writer):
        """Spindle and coolant off."""
        writer.block("M5")
        for word in (writer.coolant_end, "M9"):
            if word is not None:
                writer.block(word)
        writer.coolant, writer.coolant_end = "M9", None

    def change_tool(self, writer, operation):
        """The operation's tool into the spindle, at the top of the machine."""
        writer.block(f"T{operation.tool.number}", "M6")

    def run(self, writer, operation):
        """Spindle and coolant on."""
        writer.block(f"S{operation.spindle_rpm:.0f}", spindle_word(operation))
        self.cool(writer, operation)

    def turn_at(self, writer, rpm):
        """Another speed of the spindle, which turns, in a block of its own."""
        word = f"S{rpm:.0f}"
        if word != writer.speed:
            writer.block(word)
            writer.speed = word

    def cool(self, writer, operation):
        """The operation's coolant alone: a control may have both on at once."""
        word, end = self._coolant_words(operation, writer.machine)
        if writer.coolant != word and writer.coolant_end is not None:
            writer.block(writer.coolant_end)
        elif "M9" not in (word, writer.coolant) and word != writer.coolant:
            writer.block("M9")
        writer.block(word)
        writer.coolant, writer.coolant_end = word, None if end == "M9" else end

    def _coolant_words(self, operation, machine):
        """(word that turns the operation's coolant on, word that ends it): the machine's own, else the control's.

        Raises:
            PostError: neither has one.
        """
        own, name = machine.control.coolants, operation.coolant
        if name in own:
            return own[name].on, own[name].off
        word = self.coolants.get(name)
        if word is None or (word != "M9" and word in machine.control.coolant_codes):
            raise PostError(f"operation {operation.name}: {machine.name} states no M-code of the coolant {name}: write "
                            f"[control.coolants.{name}] with on and off into its file, or choose another coolant")
        return word, "M9"

    def approach(self, writer, start_mm):
        """XY before Z, so that nothing is cut on the way."""
        rapid = writer.motion_words[Kind.RAPID]
        writer.block(rapid, *writer.words(start_mm, (0, 1)))
        before, after = writer.pending_z
        writer.block(*before, rapid, *writer.words(start_mm, (2,)), *after)
        writer.pending_z = (), ()

    def length_on(self, writer, tool):
        """The tool's length offset goes on, at the top of the machine."""
        writer.block("G43", f"H{tool.number}")

    def tip_on(self, writer, tool):
        """Tool-centre-point control on, the rotaries turned, at the top of the machine.

        Returns:
            words that stand before the first move under it, and behind.
        """
        raise PostError(f"{type(self).__name__} writes no tool-centre-point control: leave tip_control out of the machine's file")

    def tilts(self, control):
        """Whether indexed positions go out in frames of the control whose Z is the tool."""
        return self.has_planes and control.tip_control is not None

    def plane_on(self, writer, laid, place_mm):
        """The frame of an indexed position on, and to a place in it, from above along the tool.

        Args:
            laid: tilted_words.TiltedMoves.   place_mm: (3,) of the tip in the frame.
        """
        raise PostError(f"{type(self).__name__} writes no tilted planes")

    def plane_frame(self, run, plane_deg):
        """Frame in the WCS that the words of an indexed position are in, its zero the WCS's.

        Args:
            run: joint_words.JointRun.   plane_deg: about Z, the new X and the new Z.
        """
        return frame_of(plane_deg)

    def tip_off(self, writer):
        """Back to joints, wherever the tool stands."""
        raise PostError(f"{type(self).__name__} writes no tool-centre-point control: leave tip_control out of the machine's file")

    def end_tip(self, writer, plane_off):
        """G49 ends tip control and length, `plane_off` the frame of an indexed position; what follows says its tool anew."""
        writer.block("G49")
        if writer.is_tilted:
            writer.block(plane_off)
        writer.forget_position()
        writer.is_tip, writer.is_tilted, writer.tool = False, False, None

    def dwell(self, seconds):
        """The word that says how long, behind G4 and in a canned cycle."""
        return f"P{seconds:.3f}"

    def wait(self, writer, seconds):
        """A dwell in a block of its own."""
        writer.block("G4", self.dwell(seconds))

    def halt(self, writer, is_optional):
        """A stop, from which the operator goes on."""
        writer.block("M1" if is_optional else "M0")

    def compensation(self, writer, number, is_on):
        """Words of the straight block with which the control begins, or ends, to run beside a contour by a tool's D register."""
        raise PostError(f"{type(self).__name__[1:]} has no cutter compensation (G41, G42): leave compensation out of the contour")

    def before_taps(self, writer, rpm):
        """What stands before the first word of a tapping cycle."""

    def tap(self, writer, cycle, rpm, top_z_mm):
        """Down and up again by the pitch, the spindle tied to the feed, where the control has no word for it in `cycle_words`.

        Args:
            cycle: drilling.DrillCycle; the tool stands over the hole at its retract_z_mm.   top_z_mm: where it goes next.
        """
        raise PostError(f"{type(self).__name__[1:]} has no rigid tapping: mill the thread (thread_mill), or choose a machine that "
                        "taps")

    def drills(self, cycle):
        """Whether the control's own call makes a drilling.DrillCycle that is no tap."""
        return self.has_drilling and cycle.retract_z_mm - SET_UP_MM > cycle.bottom_z_mm + HEIGHT_MM

    def drill(self, writer, cycle, top_z_mm):
        """One hole by the control's own call, where it `has_drilling`; the tool stands over it, `top_z_mm`: where it goes next."""
        raise PostError(f"{type(self).__name__[1:]} calls no drilling cycles")

    def foot(self, writer):
        """The end of the program; what must stand behind it is in `writer.tail`."""
        self.stop(writer)
        self.up(writer)
        writer.block(self.end)

    def optional_stop(self, writer):
        """Where the operator may look before the next tool, at the top of the machine."""
        self.halt(writer, True)

    def numbered(self, lines, control):
        """All lines of a file as the control wants them: with block numbers, where its file says so."""
        if not control.block_numbers:
            return lines
        out, number = [], 0
        for line in lines:
            is_block = not line.startswith(self.unnumbered)
            number = (number + control.block_numbers) % LARGEST_NUMBER if is_block else number
            out.append(f"N{number} {line}" if is_block else line)
        return out

    def sub_program(self, writer, label, comment, blocks):
        """Define a sub-program, in the lines or in the tail."""
        raise PostError(f"{type(self).__name__} writes no sub-programs")

    def call(self, label, numbers):
        """The block that calls it."""
        raise PostError(f"{type(self).__name__} writes no sub-programs")

    def setting(self, block, comment):
        """The block that sets a register, with what it is."""
        return f"{block} {self.comment(comment)}"


def spindle_word(operation):
    """M3; of left-hand taps and of what turns backwards M4."""
    return "M4" if operation.is_backwards or any(cycle.pitch_mm < 0 for cycle in operation.cycles) else "M3"


def planes_of(control):
    """Planes in which a control runs arcs, by its machine's file."""
    return tuple(plane for plane in Plane if plane.name in control.arc_planes)


def posted(program, machine, dialect):
    """Write a Program.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
        dialect: Dialect.
    Returns:
        Posted.
    Raises:
        PostError: see the posts.
    """
    files = _Files(program, machine, dialect)
    for number, operation in enumerate(program.operations, 1):
        if operation.passes is not None and files.subs is not None and not leans(operation.moves):
            files.add_passes(operation, number)
        else:
            files.add_moves(operation, number)
    return files.posted()


class _Files:
    """Files closed so far and the one being written."""

    def __init__(self, program, machine, dialect):
        if machine.rotaries and not dialect.knows_rotaries:
            raise PostError(f"{machine.name} has the rotary axes {' and '.join(machine.rotaries)}, and the post "
                            f"{machine.control.post} writes no rotary words: choose another post, or a machine without them")
        if dialect.work_offsets is not None and program.wcs not in dialect.work_offsets:
            raise PostError(f"{program.setup}: {program.wcs} is no work offset of the post {machine.control.post}: choose one of "
                            f"{', '.join(dialect.work_offsets)}")
        if machine.control.arc_centres == "R" and not dialect.knows_radii:
            raise PostError(f"{machine.name}: the post {machine.control.post} writes arcs by their centres alone: leave out "
                            "arc_centres")
        tip = machine.control.tip_control
        if tip is not None and tip not in dialect.tip_controls:
            raise PostError(f"{machine.name}: tip_control {tip} is no word of the post {machine.control.post}, which knows "
                            f"{' and '.join(dialect.tip_controls) or 'none'}: correct the machine's file")
        for name, is_asked in (("swivel_record", machine.control.swivel_record is not None),
                               ("feed_parameters", machine.control.feed_parameters)):
            if is_asked and not dialect.knows_swivel:
                raise PostError(f"{machine.name}: {name} is a Sinumerik's, and the post is {machine.control.post}: leave it out")
        self.program, self.machine, self.dialect = program, machine, dialect
        has_subs = dialect.variables is not None and machine.control.sub_programs
        self.subs = SubPrograms(program, dialect.variables) if has_subs else None
        if self.subs is not None and self.subs.templates and machine.control.block_numbers:
            raise PostError(f"{machine.name}: block_numbers would stand among the numbers of restart points: leave them out, or "
                            "write sub_programs = false")
        if self.subs is not None and self.subs.templates and machine.control.arc_centres == "R":
            raise PostError(f"{machine.name}: sub-programs write arcs by their centres: leave out arc_centres, or write "
                            "sub_programs = false")
        self.texts, self.arcs_as_lines, self.largest_rounding_mm, self.joint_s = [], 0, 0.0, {}
        foot = dialect.writer(machine)
        dialect.foot(foot)
        self.foot_bytes, self.foot_sub_blocks = (size([*foot.lines, *foot.tail], foot) for size in (_bytes, _sub_blocks))
        self._open()

    def _open(self):
        self.writer = self.dialect.writer(self.machine)
        self.defined, self.under_way = set(), None
        self.counted, self.counted_bytes, self.counted_sub_blocks = (0, 0), 0, 0        # lines and tail; what they take
        self.dialect.head(self.writer, self.program, len(self.texts) + 1)

    def _close(self):
        self._leave_tip()
        self.dialect.foot(self.writer)
        lines = self.dialect.numbered(self.writer.lines + self.writer.tail, self.machine.control)
        check_lines(lines, self.machine)
        self.texts.append("\n".join(lines) + "\n")
        self.arcs_as_lines += self.writer.arcs_as_lines
        self.largest_rounding_mm = max(self.largest_rounding_mm, self.writer.largest_rounding_mm)

    def posted(self):
        """All files."""
        self._close()
        return Posted(texts=tuple(self.texts), arcs_as_lines=self.arcs_as_lines,
                      largest_rounding_mm=self.largest_rounding_mm, joint_s=self.joint_s)

    def add_moves(self, operation, number):
        """An operation move by move; where the store is full, a new file begins at the clearance height."""
        moves = operation.moves
        self._refuse_what_cannot_be_held(operation)
        laid = self._laid(operation)
        if laid.joint_s is not None:
            self.joint_s[number] = laid.joint_s
        if self.dialect.one_tool_a_file and self.writer.tool not in (None, operation.tool.number):
            self._close()
            self._open()
        before = self.writer.state()
        self._begin(operation, number, is_alone=operation.is_from_top, laid=laid)
        self._enter(laid, 0)
        high = np.flatnonzero(self._heights_mm(operation, moves.starts_mm) >= 0)
        bounds = [0, *(() if operation.cycles else high[high > 0].tolist()), len(moves)]     # holes are not torn apart
        for first, end in zip(bounds[:-1], bounds[1:]):
            self._write(laid, operation, first, end)
            # the first stretch of a program stays where it is: nothing before it could be closed
            if (first or number > 1) and not self._is_within_store():
                self.writer.go_back_to(before)
                self._close()
                self._open()
                self._begin(operation, number, is_alone=True, laid=laid, first=first)
                self._enter(laid, first)
                self._write(laid, operation, first, end)
            before = self.writer.state()

    def _write(self, laid, operation, first, end):
        """Moves `first` to `end`, and where the program stands still among them."""
        at, last = first, end == len(operation.moves)
        for pause in operation.pauses:
            if not (first <= pause.move < end or last and pause.move == end) or not (pause.move or pause.is_spindle_on):
                continue
            laid.write(self.writer, at, pause.move, self.dialect)
            at = pause.move
            self._pause(operation, pause, goes_on=at < len(operation.moves))
        laid.write(self.writer, at, end, self.dialect)

    def _pause(self, operation, pause, goes_on):
        """Stand still; a stop may have switched off what ran, and all is said again behind it."""
        writer, dialect = self.writer, self.dialect
        if pause.is_at_top:
            dialect.up(writer)
        if not pause.is_spindle_on:
            dialect.stop(writer)
        self._stand(pause)
        if goes_on and not (pause.seconds and pause.is_spindle_on):
            dialect.run(writer, operation)
            writer.speed = f"S{operation.spindle_rpm:.0f}"
            writer.motion = writer.feed = None

    def _stand(self, pause):
        if pause.seconds:
            self.dialect.wait(self.writer, pause.seconds)
        else:
            self.dialect.halt(self.writer, pause.is_optional)

    def _laid(self, operation):
        """PlainMoves, DrilledMoves, CompensatedMoves, SolvedMoves, TipMoves or TiltedMoves of an operation.

        Raises:
            PostError: its spindle changes its speed, or it pauses, where that is not written; it leans, and the control has no
                words for it.
        """
        if operation.pauses and (operation.cycles or operation.compensated):
            raise PostError(f"operation {operation.name}: it stops or dwells among its moves, which goes without cycles and "
                            "without cutter compensation: leave them out")
        if operation.rpm_changes and (operation.cycles or operation.compensated):
            raise PostError(f"operation {operation.name}: the speed of the spindle changes among its moves, which goes without "
                            "cycles and without cutter compensation: give it one speed")
        if operation.compensated and self.machine.control.arc_centres == "R":
            raise PostError(f"operation {operation.name}: cutter compensation goes with arcs by their centres: "
                            "leave compensation out")
        laid = self._laid_leaning(operation) if leans(operation.moves) else PlainMoves(operation, self.machine.rotaries)
        if operation.compensated:
            if isinstance(laid, TipMoves):
                raise PostError(f"operation {operation.name}: cutter compensation of a tool that leans does not go with "
                                f"{self.machine.control.tip_control}: leave compensation out")
            return CompensatedMoves(laid, operation)
        if not operation.cycles:
            return laid
        if isinstance(laid, TipMoves):
            raise PostError(f"operation {operation.name}: taps and dwells of a tool that leans do not go with "
                            f"{self.machine.control.tip_control}: mill the thread (thread_mill), or leave the dwell out")
        return DrilledMoves(laid, operation, self.machine.control.canned_cycles, self.machine.control.resolution_mm)

    def _laid_leaning(self, operation):
        """The same of a tool that leans, move by move."""
        if operation.level_mm is not None and self.dialect.tilts(self.machine.control):
            return TiltedMoves(operation, self.machine, self.dialect)
        if self.machine.control.tip_control is None:
            if not self.dialect.states_times:
                raise PostError(f"operation {operation.name}: the post {self.machine.control.post} states no times of blocks, "
                                f'which joints need: write tip_control = "{self.dialect.tip_controls[0]}" into the machine file')
            return SolvedMoves(operation, self.machine)
        share, control = self.dialect.tip_blend_share, self.machine.control
        if operation.rpm_changes and not control.changes_speed_at_tip:
            raise PostError(f"operation {operation.name}: the speed of the spindle changes among its moves, which does not go "
                            f"with {control.tip_control}: give it one speed")
        return TipMoves(operation, self.machine, self.dialect.states_times, share and share * control.path_tolerance_mm)

    def _enter(self, laid, first):
        """To where move `first` begins."""
        if laid.is_tip:
            laid.begin(self.writer, first, self.dialect)
        else:
            self._go_to_start(laid.starts_mm[first] if first else laid.start_mm)

    def _leave_tip(self):
        if self.writer.is_tip:
            self.dialect.tip_off(self.writer)

    def _refuse_what_cannot_be_held(self, operation):
        """A tilted axis without rotaries; an angle head, which holds its tool its own way, with them."""
        _refuse_tilted(operation, self.machine)
        if self.machine.rotaries and operation.tool.head is not None:
            raise PostError(f"operation {operation.name}: T{operation.tool.number} is in an angle head, which goes with no rotary "
                            f"axes; {self.machine.name} has {' and '.join(self.machine.rotaries)}")
        if any(operation.tool.offset_mm[:2]) and not self.dialect.holds_beside:
            raise PostError(f"operation {operation.name}: T{operation.tool.number} is beside the spindle's axis, and the post "
                            f"{self.machine.control.post} does not shift the zero for it: choose a tool in the spindle, or "
                            "another post")

    def add_passes(self, operation, number):
        """An operation as calls; where the store is full, a new file begins at a restart point."""
        passes = operation.passes
        self.under_way = None
        if operation.rpm_changes or operation.pauses:
            raise PostError(f"operation {operation.name}: the speed of the spindle changes, or it stops or dwells, among repeated "
                            "passes: give it one speed and no stops")
        self._refuse_what_cannot_be_held(operation)
        for span in calls_between(passes):
            if self._try(operation, number, span):
                continue
            self._close()
            self._open()
            if not self._try(operation, number, span):
                raise PostError(f"operation {operation.name}: from one restart point to the next it needs more than "
                                f"the {self._store_in_words()} that {self.machine.name} "
                                "stores; put restart points closer together")
        # arcs and feeds of the sub-programs have left another state than the writer knows
        self.writer.plane = self.writer.feed = None
        self.largest_rounding_mm = max(self.largest_rounding_mm,
                                       largest_rounding_mm(operation.moves, passes, self.writer))

    def _try(self, operation, number, span):
        """Write the passes of one span; False and nothing written where the file would be too long for the store."""
        writer, before = self.writer, self.writer.state()
        if self.under_way is not operation:
            self._begin(operation, number, is_alone=True, laid=PlainMoves(operation, self.machine.rotaries))
            self._prepare(operation, operation.passes)
            self.under_way = operation
            if self.texts:
                writer.comment(f"FROM RESTART POINT N{restart_number(number, operation.passes.items[span[0]].number)}")
        writer.lines += main_lines(operation.passes, span, self.subs, number, self.dialect.call, writer)
        is_within = self._is_within_store()
        if not is_within:
            writer.go_back_to(before)
        return is_within

    def _store_in_words(self):
        control = self.machine.control
        more = "" if control.program_store_sub_blocks is None else f" or {control.program_store_sub_blocks} sub-blocks"
        return f"{control.program_store_bytes} bytes{more}"

    def _is_within_store(self):
        """The file fits the store, were it closed now; after a False, a new file must be opened.

        Every line is counted once: what is counted does not change until the file is closed.
        """
        lines, tail, control = self.writer.lines, self.writer.tail, self.machine.control
        new = [*lines[self.counted[0]:], *tail[self.counted[1]:]]
        self.counted_bytes += _bytes(new, self.writer)
        self.counted = len(lines), len(tail)
        is_within = self.counted_bytes + self.foot_bytes + LATER_BYTES <= control.program_store_bytes
        if control.program_store_sub_blocks is None:
            return is_within
        self.counted_sub_blocks += _sub_blocks(new, self.writer)
        return is_within and self.counted_sub_blocks + self.foot_sub_blocks + LATER_SUB_BLOCKS <= control.program_store_sub_blocks

    def _prepare(self, operation, passes):
        """Sub-programs not yet in this file, registers, and the start."""
        for template in passes.templates:
            if template not in self.defined:
                self.defined.add(template)
                self.dialect.sub_program(self.writer, self.subs.label(template), self.subs.comment(template),
                                         self.subs.body(template, self.writer))
        for block, comment in self.subs.settings(passes, self.writer):
            self.writer.block(self.dialect.setting(block, comment.upper()))
        self._go_to_start(np.array(passes.start_mm))

    def _begin(self, operation, number, is_alone, laid, first=0):
        """Tool change at the top of the machine, rotaries, spindle and length offset before anything moves down.

        laid: PlainMoves or SolvedMoves.   first: move with which it begins here.
        """
        writer, tool, spindle = self.writer, operation.tool, self.machine.spindle
        for rpm in (operation.spindle_rpm, *(rpm for _, rpm in operation.rpm_changes)):
            if not spindle.min_rpm <= rpm <= spindle.max_rpm:
                raise PostError(f"operation {operation.name}: {rpm:.0f} rpm, the spindle of "
                                f"{self.machine.name} runs {spindle.min_rpm:.0f} to {spindle.max_rpm:.0f} rpm")
        self._check_heights(operation)
        self._leave_tip()
        writer.comment(f"OPERATION {number}: {operation.name.upper()}, T{tool.number} {tool.cutter.name.upper()}")
        writer.comment(self._in_figures(operation, number))
        for line in laid.notes:
            writer.comment(line)
        is_off = writer.tool != tool.number or is_alone      # an operation with restart points brings all that it needs
        if is_off:
            self.dialect.stop(writer)
            self.dialect.up(writer)
            is_optional = self.machine.control.optional_stops and number > 1 and writer.tool is not None
            if is_optional:
                self.dialect.optional_stop(writer)
            for pause in operation.pauses if first == 0 else ():
                if pause.move == 0 and pause.is_at_top and not (is_optional and pause.is_optional):
                    self._stand(pause)
            if None in writer.turn_words:       # nobody knows where they stand: they turn while nothing is in the spindle
                self._turn(laid.turned_deg[first], is_at_top=True)
            self.dialect.change_tool(writer, operation)
            self.dialect.length_on(writer, tool)
            writer.tool = tool.number
            writer.turn_words = [None] * len(writer.rotaries)
        self._turn(laid.turned_deg[first], is_at_top=None in writer.turn_words)
        for pause in operation.pauses if first == 0 else ():
            if not (pause.move or pause.is_at_top or pause.is_spindle_on):
                if not is_off:
                    self.dialect.stop(writer)
                is_off = True
                self._stand(pause)
        self.dialect.run(writer, operation)
        writer.speed = f"S{operation.spindle_rpm:.0f}"
        writer.forget_position()
        writer.plane = writer.feed = None       # a program may begin here

    def _in_figures(self, operation, number):
        """What the operator looks for: speed, feeds, lowest tip, in the control's unit; minutes, and those still to come."""
        writer, feeds = self.writer, operation.moves.feed_mm_per_min
        cuts = feeds[feeds > 0] if (feeds > 0).any() else np.zeros(1)
        slow, fast = (writer.number(v * writer.scale, 1).lstrip("+") for v in (cuts.min(), cuts.max()))
        words = [f"S{operation.spindle_rpm:.0f}", f"F{slow}" + (f" TO {fast}" if fast != slow else ""),
                 "LOWEST TIP Z" + writer.length(lowest_z_mm(operation.moves), 3)]
        if operation.coolant in self.machine.control.coolants:
            words.append(f"COOLANT {operation.coolant.replace('_', ' ').upper()} "
                         f"{self.machine.control.coolants[operation.coolant].on}")
        times = [o.time_s for o in self.program.operations[number - 1:]]
        if None not in times:
            words += [f"{times[0] / 60:.1f} MIN", f"{sum(times) / 60:.1f} MIN LEFT"]
        return ", ".join(words)

    def _turn(self, degrees, is_at_top):
        """Rotaries to their angles, at the top of the machine; all of them are named after a tool change."""
        writer = self.writer
        before = list(writer.turn_words)
        words = writer.turned(degrees)
        if not is_at_top and (words or any(degrees)):       # at an angle, no way across is clear but the top
            self.dialect.up(writer)
            writer.turn_words = before
            words = writer.turned(degrees)
        if words:
            self.dialect.in_machine(writer, *words)

    def _heights_mm(self, operation, places_mm):
        """(n,) how far places are above the height from which rapids across run: along Z, or the axis of an indexed position."""
        if operation.level_mm is None:
            return places_mm[:, 2] - self.program.clearance_z_mm + HEIGHT_MM
        return (places_mm * operation.moves.axis[0]).sum(axis=1) - operation.level_mm + HEIGHT_MM

    def _check_heights(self, operation):
        """An operation starts and ends above the work."""
        moves = operation.moves
        for what, place in (("starts", moves.start_mm), ("ends", moves.end_mm[-1] if len(moves) else moves.start_mm)):
            low = -self._heights_mm(operation, place[None])[0]
            if low > 0:
                clearance = self.program.clearance_z_mm if operation.level_mm is None else operation.level_mm
                raise PostError(f"an operation {what} at Z{clearance - low - HEIGHT_MM:.3f}, below the clearance height "
                                f"Z{clearance:.3f}: begin and end operations above the work")

    def _go_to_start(self, start_mm):
        self.dialect.approach(self.writer, start_mm)
        self.writer.here_mm = start_mm


def _refuse_tilted(operation, machine):
    """A machine without rotary axes holds every tool upright; written out, a tilted axis would be cut upright."""
    if machine.rotaries:
        return
    tilt = operation.moves.tilt_rad
    rows = np.flatnonzero(~(tilt <= TILT_RAD))
    if len(rows):
        raise PostError(f"operation {operation.name}: the tool axis leans {np.degrees(tilt[rows[0]]):.3f} degrees from "
                        f"the spindle in move {rows[0]}, and in {len(rows) - 1} others; {machine.name} has no rotary "
                        "axes: plan it with the axis along Z, or turn the part to it in a setup of its own", rows=rows)


def _sub_blocks(lines, writer):
    """At most, of lines with their block numbers."""
    return sub_blocks_of(lines) + (len(lines) if writer.number_bytes else 0)


def _bytes(lines, writer):
    """Of ASCII lines with their ends and block numbers."""
    return sum(len(line) + 1 + writer.number_bytes for line in lines)
