"""Operations whose tool leans, solved for a machine: what its X, Y, Z and rotary words must be, block by block.

The control runs joints evenly from block to block (no tool-centre-point control): X Y Z are where the spindle nose is to
stand, less zero and tool length, so that with the rotaries at 0 they are the tip's own.  Such a program holds for one zero, one
place on the table and one tool length; all three stand in it as a comment.  Feeds are inverse times.
"""

import math

import numpy as np

from cuspline.program.arcs import CHORD_SHARE, Arc
from cuspline.program.joint_paths import Tolerance, joint_path
from cuspline.program.joint_times import block_seconds, driven_seconds, rounded_seconds
from cuspline.program.program import TILT_RAD, Kind, Plane
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PostError
from cuspline.values.frames import Frame
from cuspline.values.units import MM

JOINT_SHARE = 0.5           # of the path tolerance: how far tip and cutting edge may leave the plan between two blocks
CORNER_SHARE = 0.9          # of it: how far the tip may leave a corner between two blocks, where the plan is and no chord is off
STANDS_RAD = 1e-6           # between the tool and Z
LEANING_BLEND_SHARE = 0.25  # of it, for G64 P, which counts corners of X Y Z alone
LAST_DIGITS = math.sqrt(3.0)  # of X, Y and Z together: so much longer than it is a block may come out


def leans(moves):
    """Whether the tool leaves the spindle's direction anywhere."""
    return bool((~(moves.tilt_rad <= TILT_RAD)).any())


class PlainMoves:
    """An operation with the spindle upright: words are the tip's places."""

    notes, is_tip = (), False
    joint_s = None              # seconds through the joints of a tool that leans
    frame = None                # Frame in the WCS that its words are in; None: the WCS

    def __init__(self, operation, rotaries):
        self.operation, moves = operation, operation.moves
        self.moves, self.start_mm, self.starts_mm = moves, moves.start_mm, moves.starts_mm
        self.turned_deg = np.zeros((len(moves) + 1, len(rotaries)))

    @property
    def at_mm(self):
        """(n + 1, 3) words where each move begins, and where the last ends."""
        return np.vstack([self.start_mm, self.moves.end_mm])

    def write(self, writer, first, end, dialect):
        """Moves `first` to `end`, the spindle's speed named where it changes."""
        for begin, stop in at_one_speed(self.operation, writer, first, end, dialect):
            self._write(writer, begin, stop)

    def _write(self, writer, first, end):
        m = self.moves
        columns = (m.kind, m.end_mm, m.center_mm, m.plane, m.feed_mm_per_min)
        for row in zip(*(column[first:end].tolist() for column in columns)):        # plain numbers are written faster
            writer.move(*row)


def at_one_speed(operation, writer, first, end, dialect):
    """(first, end) of stretches of moves at one speed of the spindle, which is named before each is handed out."""
    changes = [k for k, _ in operation.rpm_changes if first < k < end]
    for begin, stop in zip([first, *changes], [*changes, end]):
        if operation.rpm_changes:
            dialect.turn_at(writer, operation.rpm_at(begin))
        yield begin, stop


class JointRun:
    """An operation laid out in joints, block by block; block 0 is where it begins."""

    def __init__(self, operation, machine, tip_mm=None):
        """
        Args:
            tip_mm: how far the tip may leave its line between blocks; left out: as far as cutting edges may, anywhere.
        Raises:
            PostError: a rewind in the cut, a limit, an axis that cannot be held: by the move, the axis and the value.
        """
        moves, cutter, control = operation.moves, operation.tool.cutter, machine.control
        self.operation, self.name = operation, operation.name
        self.length_mm, self.chain = operation.tool.length_mm, machine.kinematics
        self.decimals_deg = control.decimals_deg
        self.least_mm = LAST_DIGITS * MM[control.units] / 10 ** control.decimals
        self.tips, axes, move = _straight(moves, CHORD_SHARE * control.path_tolerance_mm)
        off_mm = JOINT_SHARE * control.path_tolerance_mm
        within = Tolerance(off_mm if tip_mm is None else tip_mm, off_mm / math.hypot(cutter.radius_mm, cutter.flute_length_mm))
        self.path = self._laid(self.tips + np.array(machine.wcs_origin_mm), axes, within, move, moves.kind[move] == Kind.RAPID)
        self.rewinds = set(np.flatnonzero(np.isin(self.path.row, self.path.rewinds)).tolist())     # blocks, all of them rapids
        self.joints, self.move = self.path.joints, move[self.path.row]
        self.degrees = np.degrees(self.joints[:, 3:])
        self.is_feed = moves.kind[self.move] != Kind.RAPID
        self.feed = moves.feed_mm_per_min[self.move]
        self.first = np.searchsorted(self.move[1:], np.arange(len(moves) + 1)) + 1      # block with which each move begins

    def _laid(self, tips, axes, within, move, off_cut):
        try:
            path = joint_path(self.chain, tips, axes, within, length_mm=self.length_mm, rows=move, off_cut=off_cut)
            in_cut = path.rewinds[~off_cut[path.rewinds]]
            if len(in_cut):
                raise PostError(f"row {move[in_cut[0]]}: the rotaries come to the end of their range in the cut: let "
                                "the tool leave it before, and begin again", rows=move[in_cut])
            self.chain.refuse_beyond_limits(path.joints, move[path.row])
        except PostError as error:
            raise PostError(f"operation {self.name}: {error}", rows=error.rows) from None
        return path

    def blocks(self, writer, first, end, dialect):
        """Numbers of the blocks of moves `first` to `end`, the spindle's speed named before those where it changes."""
        for begin, stop in at_one_speed(self.operation, writer, first, end, dialect):
            yield from range(self.first[begin], self.first[stop])

    @property
    def turns(self):
        """Whether a rotary axis turns on the way."""
        return bool(np.ptp(self.joints[:, 3:], axis=0).any())

    @property
    def is_linked(self):
        """(n - 1,) bool: a cutting block that goes on from another."""
        return self.is_feed[1:] & np.concatenate([[False], self.is_feed[1:-1]])

    @property
    def wanted_s(self):
        """(n - 1,) seconds of every block after the first, the tip at its feed; 0 of rapids.

        A block shorter than the words' last digit may be posted as long as that is.
        """
        path, whole = self.path, np.zeros(len(self.tips))
        whole[1:] = np.sqrt((np.diff(self.tips, axis=0) ** 2).sum(axis=1))
        begin = np.concatenate([[0.0], np.where(np.diff(path.row) > 0, 0.0, path.share[:-1])])
        length = np.maximum(whole[path.row] * (path.share - begin), self.least_mm)
        wanted = 60.0 * length / np.where(self.is_feed, self.feed, 1.0)
        return np.where(self.is_feed, wanted, 0.0)[1:]


class SolvedMoves:
    """An operation solved in joints."""

    is_tip = False

    def __init__(self, operation, machine):
        """
        Raises:
            PostError: see JointRun.
        """
        self.run = run = JointRun(operation, machine)
        path_tolerance_mm = machine.control.path_tolerance_mm
        self.words_mm = run.joints[:, :3] - machine.wcs_origin_mm - np.array([0.0, 0.0, run.length_mm])
        self.seconds = self._seconds(path_tolerance_mm)
        self.start_mm, self.starts_mm = self.words_mm[0], self.words_mm[run.first - 1]
        self.turned_deg = run.degrees[run.first - 1]
        driven_s = self.driven_s(LEANING_BLEND_SHARE * path_tolerance_mm)
        self.joint_s = driven_s if run.turns else None
        units = machine.control.units
        self.notes = ("SOLVED FOR THE ZERO AT MACHINE " + " ".join(
            f"{letter}{value / MM[units]:.4f}" for letter, value in zip("XYZ", machine.wcs_origin_mm))
            + f" AND A TOOL OF {run.length_mm / MM[units]:.4f} {units.upper()}; WITH ANY OTHER IT CUTS ELSEWHERE",
            f"ABOUT {driven_s:.0f} S FROM BLOCK TO BLOCK")

    @property
    def at_mm(self):
        """(n + 1, 3) words where each move begins, and where the last ends."""
        return self.starts_mm

    @property
    def frame(self):
        """Frame in the WCS that the words are in, while nothing turns and the tool is along Z.

        Raises:
            PostError: something turns, or the tool leans.
        """
        run, angles = self.run, self.run.joints[0, 3:]
        if run.turns or run.chain.off_z(angles) > STANDS_RAD:
            raise PostError(f"operation {run.name}: the control would shift its contour across Z, and the tool is not along it: "
                            "leave compensation out, or choose a machine that turns the part, or whose control takes planes")
        axes = run.chain.linear_axes(angles)
        return Frame(rotation=axes.rotation, origin_mm=axes.out((axes.into(run.tips[:1]) - self.words_mm[:1]))[0])

    def driven_s(self, blend_mm):
        """How long the control takes, with this P of G64."""
        return float(driven_seconds(self.run.chain, self.run.joints, self.seconds[1:], blend_mm).sum())

    def _seconds(self, path_tolerance_mm):
        """(n,) of every block, 0 of rapids: the tip at its feed, or slower where a joint cannot."""
        run, cuts = self.run, self.run.is_feed[1:]
        seconds = block_seconds(run.chain, run.joints, run.wanted_s, run.is_linked)
        seconds = rounded_seconds(run.chain, run.joints, np.where(cuts, seconds, 0.0), run.length_mm,
                                  LEANING_BLEND_SHARE * path_tolerance_mm, CORNER_SHARE * path_tolerance_mm)
        seconds = np.where(cuts, block_seconds(run.chain, run.joints, seconds, run.is_linked), 0.0)
        return np.concatenate([[0.0], seconds])

    def write(self, writer, first, end, dialect):
        """Blocks of moves `first` to `end`, under G93, back to G94."""
        run, is_inverse = self.run, False
        for k in run.blocks(writer, first, end, dialect):
            if k in run.rewinds:
                self._rewind(writer, k, dialect)
                continue
            is_feed = run.is_feed[k]
            if is_feed and not is_inverse:
                writer.block("G93")
                is_inverse = True
            writer.joint_move("G1" if is_feed else "G0", self.words_mm[k], run.degrees[k],
                              ("F" + writer.inverse_time(self.seconds[k]),) if is_feed else ())
        if is_inverse:
            writer.block("G94")
            writer.feed = None

    def _rewind(self, writer, k, dialect):
        """A rapid that the rotaries cannot follow: to the top of the machine, round, and down to where it leads."""
        turn_at_top(writer, self.run.degrees[k], dialect)
        dialect.approach(writer, self.words_mm[k])
        writer.motion, writer.here_mm = "G0", self.words_mm[k]


def turn_at_top(writer, degrees, dialect):
    """The spindle up, then the rotaries round."""
    dialect.up(writer)
    writer.forget_position()
    dialect.in_machine(writer, *writer.turned(degrees))


def _straight(moves, tolerance_mm):
    """Poses of straight moves: (n, 3) tips, (n, 3) axes, (n,) the move each ends or lies on; arcs are chords."""
    axes = moves.axis / np.sqrt((moves.axis ** 2).sum(axis=1))[:, None]
    tips, leaning, move = [moves.start_mm], [axes[0]], [0]
    for k in range(len(moves)):
        points = [moves.end_mm[k]]
        if moves.kind[k] >= Kind.ARC_CW:
            points = Arc(tips[-1], moves.end_mm[k], moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k]).chords(tolerance_mm)
        before = leaning[-1]
        for n, point in enumerate(points, 1):
            tips.append(point)
            leaning.append(axes[k] if n == len(points) else _between(before, axes[k], n / len(points)))
            move.append(k)
    return np.array(tips), np.array(leaning), np.array(move)


def _between(a, b, share):
    """On the great circle from a to b."""
    across = np.cross(a, b)
    sine = np.sqrt((across * across).sum())
    whole = fixed.arctan2(sine, (a * b).sum())
    if sine < TILT_RAD:
        return a
    return (fixed.sin((1 - share) * whole) * a + fixed.sin(share * whole) * b) / sine
