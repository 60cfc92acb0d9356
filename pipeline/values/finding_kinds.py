"""Every kind of finding: what it means, how it comes about, how to fix it.  docs/findings.md says the same."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FindingKind:
    """One kind of finding in the operator's words."""

    group: str
    meaning: str        # half a sentence
    example: str        # what would raise it
    fix: str            # what to do about it


def _group(name, kinds):
    """{kind: FindingKind} of rows (meaning, example, fix)."""
    return {kind: FindingKind(group=name, meaning=meaning, example=example, fix=fix)
            for kind, (meaning, example, fix) in kinds.items()}


KINDS = {
    **_group("The cut surface", {
        "gouge": (
            "the cutter goes deeper into the part than the finish allows",
            "A finishing pass along a slope is 0.02 mm too low, where the finish allows `gouge_mm = 0.003`. It is also "
            "raised where no sample point shows it, if a move cannot be proven to stay within that depth.",
            "Look at the line that is named: a word edited by hand, a wrong tool, a wrong offset. In a program of "
            "cuspline take a smaller cutter there, or a tighter profile tolerance."),
        "excess": (
            "more is left than cusp and tolerance allow, where a ball could reach",
            "A stepover of 0.8 mm leaves cusps of 0.016 mm, where scallop and profile tolerance together allow 0.0124.",
            "A smaller stepover or a smaller ball at that place. If so much may stay: a larger `scallop_mm`, or "
            "`--accept excess`."),
        "missing_area": (
            "a region that a ball could reach was never finished",
            "A pass was deleted, or the part has a face that no setup names: at least 1 mm² stands more than five times "
            "as high as is allowed.",
            "Add the face to a setup, or the operation that finishes it."),
        "face_not_cut": (
            "a face that a setup names, and most of which is not cut, since no cutter of the shop gets there",
            "A ring groove of 3 mm between upright walls, and no cutter narrower than 3 mm; a counterbore of 6 mm, and no flat "
            "cutter as small; a face that looks away from the tool.",
            "Add a cutter that is narrow enough to the file of `--cutters` (where none is named, `small_mills` and `small_balls` "
            "have been considered), give the face to a setup that looks at it, or, if it is made elsewhere, take it out of the "
            "setup's `faces`. Less than half of a face, or an inner corner that stays rounder than drawn, is no finding: report "
            "and verify.json list both under what is not reached."),
        "tab_cut": (
            "a tab that a contour was to leave does not stand",
            "`Contour(tabs=4)` states bridges of 4 x 1 mm, and a move edited by hand goes through one of them.",
            "Look at the lines that run along the contour near that place: they rise by the tab's height."),
        "engraving_beside": (
            "a groove that is engraved beside its line",
            '`Engrave(text="A7")`, and a word of a move in the letter is 0.1 mm off.',
            'Correct the move, or the line that is stated.'),
        "engraving_depth": (
            "a groove deeper or less deep than stated",
            'A tip at Z11.75, where 0.2 mm below a face at Z12 are stated.',
            "Correct the height of the moves, or `depth_mm`; it may be off by the finish's `profile_tolerance_mm`."),
        "engraving_width": (
            "a groove whose cutter makes it wider or narrower than planned",
            'A cutter of 90 degrees in the place of one of 60.',
            'Put the cutter in that the plan names, or plan again with this one.'),
        "engraving_missing": (
            "a line, or a part of one, that is not engraved",
            "A letter's moves were deleted.",
            'Put the moves back, or take the line out of the operation.'),
        "edge_break_width": (
            "a broken edge that is wider or narrower than stated",
            "`Deburr(width_mm=0.2)`, and a tip 0.05 mm lower, or a cutter worn by as much.",
            "Correct the height of the moves or the tool's measures; the width may be off by the finish's `profile_tolerance_mm`."),
        "edge_break_missing": (
            "an edge, or a part of one, that was to be broken and is sharp",
            "The moves of `Deburr` along one edge were deleted.",
            "Put the moves back, or leave the edges out of the operation."),
        "out_of_tolerance": (
            "a dimension of the design is out of its limits on the simulated stock",
            "The design states `Diameter(faces=\"bore\", fit=\"H7\")` for 20 mm, and the bore's path leaves 20.03.",
            "Look at the operation that finishes these faces: a cutter or reamer of another size, a wrong offset. Where the limits "
            "do not hold the drawn size, draw the solid at their middle."),
        "surface_not_proven": (
            "a tool that leans or turns in the cut, whose moves or whose leavings nothing proves",
            "A side-and-face cutter turns its axis in the cut: how deep its moves come has no proven bound.",
            "Finish with a ball, a bull nose or a flat cutter, or let the tool keep its direction. Before accepting it, look at "
            "the spacing of the samples in the report."),
        "idle_operation": (
            "an operation takes nothing off the stock",
            "A rest operation names a ball that leaves no less than the one before, or roughing is listed twice.",
            "Leave the operation out, or choose other faces or a smaller tool for it."),
    }),
    **_group("Collisions", {
        "rapid_through_stock": (
            "a rapid goes through material",
            "`G0 X80` at Z2 while stock of 5 mm stands between.",
            "Retract to the clearance height before the rapid, or make it a feed move."),
        "rapid_too_low": (
            "a rapid passes too close over stock",
            "`G0 X80` passes 0.2 mm above the stock; the machine's `rapid_clearance_mm` is 0.5.",
            "Lift the rapid by the amount that is named, or go there at feed. A machine's file may state another "
            "`rapid_clearance_mm`."),
        "holder_contact": (
            "holder, spindle housing or head come too near to stock or part",
            "A ball of 6 mm with 20 mm stick-out works at the foot of a wall 30 mm high.",
            "More stick-out by at least the amount that is named, a slimmer holder, or a longer cutter."),
        "shank_contact": (
            "neck or shank touch stock or part",
            "A slot deeper than the flutes are long, cut by a cutter whose shank is as wide as its flutes.",
            "A cutter with longer flutes, more reach or a thinner neck; or rough the region before."),
        "fixture_contact": (
            "the tool or the machine's head touch a fixture, the table or what carries it",
            "A link between two passes runs through a clamp that the setup names under `fixtures`; a head that leans comes "
            "down on the table beside the part.",
            "Move the clamp, raise the part on the table, lift the path over it, or take a longer tool."),
        "clearance_not_proven": (
            "a contact is neither shown nor excluded",
            "A shank passes so close to a fin of stock thinner than 0.0005 mm that no bound decides it.",
            "Keep shank and holder farther from the stock there: more reach, a thinner shank, a wider slot; for a "
            "rapid, more height. Look at the place before accepting it."),
    }),
    **_group("Cutting", {
        "plunge": (
            "a cutter goes down into stock more steeply or faster than it can",
            "A flat cutter without teeth in the middle goes straight down into solid stock.",
            "Enter by a ramp, a helix or from outside. If the cutter can do it, state `is_centre_cutting`, `ramp_deg` or "
            "`plunge_mm_per_tooth` in the tool library."),
        "overload": (
            "a cutter takes heavier chips than it stands",
            "A full slot as deep as the cutter's diameter, where its `slot_depth_mm` is half of that.",
            "Rough there before, or take a smaller stepdown or stepover. If the cutter can do it, state `slot_depth_mm`. A drill "
            "takes chips along its axis alone: lift it before it goes across."),
        "chip_load": (
            "a feed per tooth far beyond what the material takes",
            "`F4000` where `F400` was meant: more than twice the material's feed per tooth (`cuspline materials`).",
            "Lower F, or raise S."),
        "process_limit": (
            "a cut takes more force, torque or power than spindle or cutter stand",
            "Roughing takes 9 kW where the machine's file states `power_kw = 7.5` for its spindle; or a cutter is pushed "
            "aside with 400 N, where its `bending_n` is 250; or a drill of 20 mm needs 25 Nm.",
            "Take a smaller stepdown or stepover, or a lower feed per tooth, in the operation that is named; drill a smaller hole "
            "first; mill the thread. It is checked where the machine's file or the tool library state the limit and the material's "
            "cutting force is known."),
        "deep_hole": (
            "a drill goes down too far before it lets its chips out",
            "A hole of 5 mm, 40 mm deep, drilled by G81; without `unpecked_mm` 4 diameters are allowed.",
            "Drill in pecks (G83, G73), or state `unpecked_mm` of a drill that is cooled through its inside."),
        "thread_missing": (
            "a thread of the design that nothing cuts",
            "The design states `threads={\"m6\": \"M6\"}`, and no operation taps or mills the hole.",
            "Tap it or mill it (`Tap`, `ThreadMill`), or take it out of the design's threads."),
        "thread_hole": (
            "the hole that a thread is cut into is none, too narrow or too wide",
            "M6 is tapped where a drill of 5.2 mm was, for another pitch; or before the hole is drilled.",
            "Drill it before, with the drill of this thread: its nominal diameter less the pitch."),
        "thread_bottom": (
            "a tap goes deeper than its hole is at the full width",
            "A hole 11 mm deep, and the tap of M4 sent 11.5 mm down.",
            "Drill deeper, or tap less deep: the threads of the chamfer count too."),
        "thread_pitch": (
            "a tap or thread mill goes down by another pitch than the thread's, or its feed is not tied to the spindle",
            "`F750` at `S1000` for M6, whose pitch is 1 mm; or G1 in place of G84.",
            "Write F as pitch times S, or K as the pitch; tap by G84, G74, G33.1 or G331."),
        "thread_hand": (
            "a thread runs the other way round",
            "G74 where the design's thread is right-hand; a thread mill going round clockwise on its way up.",
            "Take the other word, M3 for M4, or the tap of that hand; let the helix run the other way."),
        "thread_diameter": (
            "a tap of another size, or a milled thread wider or narrower than its class allows",
            "A thread mill runs on a radius 0.1 mm too large: the pitch diameter of M6 comes to 5.55 mm, 6H ends at 5.5.",
            "Correct the radius of its path, or the diameter that the tool library states."),
        "thread_depth": (
            "the full thread is not as deep as stated",
            "8 mm are stated, the tap's chamfer ends 7 mm below the mouth.",
            "Go deeper by the amount that is named, or state less `depth_mm`."),
        "thread_beside": (
            "a tap or thread mill is not where a thread is",
            "A tap goes down 0.2 mm beside the axis of its hole, or where the design states no thread.",
            "Move it to its hole; or state the thread in the design."),
        "spindle_out_of_range": (
            "a spindle speed that machine or cutter do not allow",
            "`S24000` on a spindle that ends at 18 000 rpm, or with a cutter whose `max_rpm` is lower.",
            "Correct the S word; feed per tooth changes with it."),
        "feed_out_of_range": (
            "a feed that the machine does not run",
            "`F30000` on a machine whose axes run 12 000 mm/min.",
            "Correct the F word."),
        "path_tolerance": (
            "the text lets the control leave the path farther than the finish allows",
            "`G64 P0.05` in a program whose finish allows gouges of 0.003 mm; or no G64 at all on LinuxCNC.",
            "Write `G64 P… Q…` with a smaller tolerance before the moves. On a Fanuc control set the parameter, and state "
            "it as `path_tolerance_mm` in the machine's file."),
        "chatter": (
            "the edge is in the cut over more than the depth at which the tool begins to chatter",
            "A ball of 8 mm whose limit is 3.5 mm takes a layer of 1 mm on a plane and on a slope of 68°: 1.0 and 3.4 mm; where "
            "plane and slope meet it is 5.9 mm for a moment.",
            "Take a smaller stepdown, or begin the slope from above. It is checked for tools whose `chatter` the library states, "
            "in materials whose cutting force is known."),
        "following_error": (
            "the drives leave the path farther than the control may, where the surface is left",
            "Axes with `time_constant_s = 0.033` cut a corner of a finishing pass at 1600 mm/min by 0.3 mm; the machine's "
            "`path_tolerance_mm` is 0.01.",
            "Lower F to the value that is named. It is checked where the machine's file states `time_constant_s` of X, Y and Z; "
            "`cuspline calibrate` measures it."),
        "late_blocks": (
            "the control waits in the cut for blocks that have not arrived",
            "Blocks of 0.05 mm at 2000 mm/min come at 9600 baud, 25 bytes each: the control runs 660 in a second, the line carries "
            "38. The cutter stands in the cut and leaves marks.",
            "Lower F to the value that is named, write fewer blocks (a larger `profile_tolerance_mm`, arcs), or take a faster "
            "line. It is checked where the machine's file states `feeding`."),
        "no_spindle": (
            "a feed move while the spindle stands, or turns backwards",
            "`M3` is missing after a tool change; or M5 while the flutes still touch the stock.",
            "Start the spindle (`M3 S…`) before the move; retract before it is stopped."),
        "ends_in_cut": (
            "the program ends, or the spindle is switched, in the cut",
            "`M30` stands right behind the last finishing pass, without a retract.",
            "Retract to the top of the machine before the end."),
    }),
    **_group("Offsets, modes and travels", {
        "no_length_offset": (
            "a move near the stock without a tool length offset",
            "`G43 H3` is missing after `T3 M6`.",
            "Write G43 with the tool's number before the first move down."),
        "wrong_length_offset": (
            "the length offset in force is not that of the tool in the spindle",
            "`G43 H2` with T3 in the spindle.",
            "Write the H number of the tool. It is raised even where both lengths are equal today."),
        "wrong_radius_offset": (
            "the radius by which a contour is shifted (G41, G42) is not that of the tool in the spindle",
            "`G41 D6` with T5 in the spindle.",
            "Write the D number of the tool. It is raised even where both radii are equal today."),
        "wrong_work_offset": (
            "a move in another work coordinate system than the setup's",
            "`G55` in the program of a setup whose zero is G54.",
            "Write the setup's own work offset."),
        "unknown_start": (
            "a move relies on a place or a mode that the program has not stated",
            "The header lacks G90, or the tool moves to the part before any Z was stated: both would be as the program "
            "before has left them.",
            "State the mode in the header; retract with G53 (LinuxCNC) or G28 (Fanuc) before the first move across."),
        "travel_exceeded": (
            "an axis is sent beyond its travel",
            "A pass ends at machine X 512 mm; the axis ends at 500.",
            "Move the part on the table, take another tool length, or cut the part in several setups."),
        "tool_change_low": (
            "a tool is changed too near to stock or part",
            "M6 without a retract before it.",
            "Write `G53 G0 Z0` (LinuxCNC) or `G91 G28 Z0.` (Fanuc) before M6. A machine's file may state "
            "`tool_change_z_mm`."),
        "stop_low": (
            "the program stops, for good or for a while, with the tool too near",
            "M0 to measure the part, with the tip 3 mm above it; the machine's `stop_clearance_mm` is 25.",
            "Retract before the stop."),
        "not_ended": (
            "the program does not say that it ends",
            "The file was cut off on its way to the control: M2 or M30 is missing.",
            "Post or copy the file again; end a program by hand with M2 or M30."),
    }),
    **_group("Files and the control's memory", {
        "program_too_long": (
            "the file is larger than the control's program memory",
            "A program of 400 kB for a control with 252 kB.",
            "Feed it through the control's buffer, take a larger scallop, or a post that splits programs at restart "
            "points."),
        "line_too_long": (
            "a line is longer than the control takes",
            "A comment of 300 characters for LinuxCNC, which takes 252.",
            "Split the block or shorten the comment."),
        "wrong_tool_table": (
            "the control's tool table does not hold the tools that were judged",
            "T3 was measured again: `tools.tbl` now has another length than `tools.json`.",
            "Correct the one that is wrong and build again, so that the programs are judged with the tool that cuts."),
        "changed_file": (
            "a file, or the job in the manifest, is not the one that was published",
            "A feed was edited in `setup-1.ngc` by hand: its SHA-256 is no longer that of `manifest.json`.",
            "Put the file back or build again. If the edit was on purpose: `cuspline verify outputs/part --accept "
            "changed_file` judges the file as it stands."),
    }),
    **_group("The check itself", {
        "verifiers_disagree": (
            "the two verifiers differ by more than their error bounds",
            "The solids show a body of excess that no sample point shows.",
            "Do not cut, and do not accept it: the verdict cannot be trusted for this program. Keep the folder and report "
            "it as a fault of cuspline."),
        "solid_off": (
            "a solid does not keep what its design states",
            "A propeller's blade, read back from STEP, is 0.05 mm thicker than its table says.",
            "Correct the table or the parameters; nothing is planned from such a solid."),
    }),
}
