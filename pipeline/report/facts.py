"""What the report says: verdict, facts and tables, out of plan.json, verify.json and the bundle.

Nothing is judged here: a fact is marked bad because verification found something, never because
the report compared two numbers.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.report.wording import (
    DASH,
    Lengths,
    box_size,
    counted,
    decimal,
    duration,
    file_size,
    grouped,
    number,
    percent,
    place,
    short,
    short_of_length,
    tool_name,
)
from cuspline.values.amounts import left_in_words, length

VERIFIED, ACCEPTED, REFUSED = "verified", "accepted", "refused"     # states of a verdict, and CSS classes


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The one thing that must not be misread."""

    state: str              # VERIFIED, ACCEPTED or REFUSED
    headline: str
    sentence: str


@dataclass(frozen=True, kw_only=True)
class Fact:
    """One tile of the minute's reading."""

    label: str
    value: str
    details: tuple[str, ...]
    state: str              # "good", "bad" or "": plain


@dataclass(frozen=True, kw_only=True)
class FindingRow:
    """One finding, ready for a table."""

    kind: str
    amount: str
    place: str
    place_mm: tuple | None
    where: str              # setup, operation, line
    machine: str            # the axes there, machine coordinates
    block: str              # text of that line
    advice: str
    is_accepted: bool
    reason: str             # why it was accepted, "" otherwise
    spot: dict              # setup, line, file (of a set) and place, for the viewer


def findings(verify):
    """All findings as rows, those not accepted first.

    A finding is accepted when it says so itself ("accepted": true or a reason), or when its kind
    stands in verify["accepted"], a list of kinds or a dict kind -> reason.
    """
    accepted = verify.get("accepted") or {}
    rows = [_finding_row(f, accepted) for f in verify.get("findings") or ()]
    return sorted(rows, key=lambda row: row.is_accepted)


def _finding_row(finding, accepted):
    kind = str(finding.get("kind", "finding"))
    own = finding.get("accepted", False)
    reason = own if isinstance(own, str) else accepted.get(kind, "") if isinstance(accepted, dict) else ""
    line = number(finding.get("line"))
    where = [str(finding[key]) for key in ("setup", "operation") if finding.get(key)]
    where += [f"line {line:.0f}"] if line else []
    where += [f"called in line {finding['call_line']}"] if finding.get("call_line") else []
    point = finding.get("place_mm", finding.get("place"))
    place_mm = None if place(point) == DASH else tuple(map(float, point))
    block = str(finding.get("block") or "")
    spot = {"setup": str(finding.get("setup") or ""), "line": int(line or 0), "file": block.split(": ")[0], "place": place_mm}
    return FindingRow(
        spot=spot, kind=kind.replace("_", " "), amount=_amount_in_words(finding), place=place(point),
        place_mm=place_mm, where=", ".join(where) or DASH,
        machine=place(finding.get("machine_mm")), block=block,
        advice=str(finding.get("advice") or DASH), is_accepted=bool(own) or kind in accepted, reason=str(reason))


def _amount_in_words(finding):
    """A length in mm, or what the finding is counted in."""
    if number(finding.get("amount")) is not None:
        return f"{number(finding['amount']):g} {finding.get('unit', '')}"
    amount = number(finding.get("amount_mm"))
    return length(amount) if amount else DASH


def verdict(verify):
    """Green only when verification says ok and nothing unaccepted stands beside it."""
    rows = findings(verify)
    open_rows = [row for row in rows if not row.is_accepted]
    if verify.get("ok") is True and not open_rows:
        if not rows:
            how_far = ", as far as its cutters reach" if left_in_words(verify.get("unreachable") or ()) else ""
            return Verdict(state=VERIFIED, headline="VERIFIED",
                           sentence=f"The posted program cuts the designed part{how_far}; no finding.")
        return Verdict(state=ACCEPTED, headline=f"VERIFIED, {counted(len(rows), 'accepted finding')}",
                       sentence="The posted program was released with findings accepted by name; read them below.")
    if open_rows:
        kinds = ", ".join(dict.fromkeys(row.kind for row in open_rows))
        sentence = f"Do not cut: {kinds}. What to do stands beside each finding."
        return Verdict(state=REFUSED, headline=f"NOT VERIFIED, {counted(len(open_rows), 'finding')}", sentence=sentence)
    sentence = ("Do not cut: verification did not say ok, and names no finding; build again and keep its messages."
                if "ok" in verify else "Do not cut: there is no verdict; run the verification first.")
    return Verdict(state=REFUSED, headline="NOT VERIFIED", sentence=sentence)


def accepted_left_mm(finish):
    """Material that may be left without a finding."""
    return finish.scallop_mm + finish.profile_tolerance_mm


def limits(bundle):
    """[(what, measured, accepted, state)] of the first screen: what decides the verdict, beside what it accepts."""
    verify, finish = bundle.verify, bundle.finish
    left = (f"{short_of_length(accepted_left_mm(finish))} (scallop {short_of_length(finish.scallop_mm)} + tolerance "
            f"{short_of_length(finish.profile_tolerance_mm)})")
    return [("Deepest gouge", decimal(verify.get("gouge_max_mm"), 4, "mm"), short_of_length(finish.gouge_mm),
             _state(verify, verify.get("gouge_max_mm"), "gouge")),
            ("Most material left", decimal(verify.get("cusp_max_mm"), 4, "mm"), left,
             _state(verify, verify.get("cusp_max_mm"), "excess", "missing_area"))]


def not_reached(bundle):
    """Texts of the first screen: what is accepted though no cutter comes there, it is not in the verdict's figures."""
    return [told.replace("mm2", "mm²") for told in left_in_words(bundle.verify.get("unreachable") or ())]


def operations(bundle):
    """(setup bundle, index in the setup, operation dict) for every operation of the plan, in order."""
    plans = {p.get("name"): p for p in bundle.plan.get("setups") or ()}
    return [(setup, k, op) for setup in bundle.setups
            for k, op in enumerate(plans.get(setup.name, {}).get("operations") or ())]


def tools_used(bundle):
    """[(tool dict, operation names)] without repeats, in order of first use."""
    used = {}
    for _, _, op in operations(bundle):
        tool = op.get("tool") or {}
        used.setdefault(tool_name(tool), (tool, []))[1].append(str(op.get("name", DASH)))
    return list(used.values())


def one_minute(bundle):
    """The tiles under the verdict: part, cutters, step and cusp, gouge, area, time, machine, program."""
    return (_part_fact(bundle), _cutter_fact(bundle), _cusp_fact(bundle), _gouge_fact(bundle),
            _area_fact(bundle), _time_fact(bundle), _machine_fact(bundle), _program_fact(bundle))


def _state(verify, value, *kinds):
    """"bad" when an unaccepted finding is of one of these kinds, plain when nothing was measured."""
    if any(row.kind.replace(" ", "_") in kinds and not row.is_accepted for row in findings(verify)):
        return "bad"
    return "" if number(value) is None else "good"


def _accepted(verify, *kinds):
    """What a tile says of findings of these kinds that were accepted by name."""
    count = sum(row.is_accepted for row in findings(verify) if row.kind.replace(" ", "_") in kinds)
    return (f"{count} above what is allowed, accepted by name",) if count else ()


def _part_fact(bundle):
    return Fact(label="Part", value=bundle.design, state="",
                details=(box_size(bundle.part_box_mm), bundle.material, bundle.description))


def _cutter_fact(bundle):
    names = [tool_name(tool) for tool, _ in tools_used(bundle)]
    hollow = number(bundle.plan.get("min_concave_radius_mm"))
    tightest = (f"minimum concave radius {short(hollow)} mm at {place(concave_place(bundle.plan))}"
                if hollow is not None else "nothing concave found, or not stated")
    return Fact(label="Cutters", value=", ".join(names) or DASH, details=(tightest,), state="")


def concave_place(plan):
    """Where the tightest hollow is; the key's name is not fixed by the contract."""
    for key in ("min_concave_radius_place_mm", "min_concave_place_mm", "place_mm", "place"):
        if plan.get(key) is not None:
            return plan[key]
    return None


def finishing_steps(bundle):
    """Steps of the operations that leave the final surface (no allowance, a cusp asked for)."""
    return [(op.get("name"), op.get("stepover_mm")) for _, _, op in operations(bundle)
            if number(op.get("scallop_mm")) is not None and not number(op.get("allowance_mm"))]


def _cusp_fact(bundle):
    verify = bundle.verify
    steps = sorted({short(step, "mm") for _, step in finishing_steps(bundle)})
    measured, planned = verify.get("cusp_max_mm"), bundle.finish.scallop_mm - bundle.finish.profile_tolerance_mm
    return Fact(label="Cusp, largest", value=decimal(measured, 4, "mm"),
                details=(f"accepted to {short_of_length(accepted_left_mm(bundle.finish), 'mm')}: scallop + tolerance",
                         f"planned for {short_of_length(planned, 'mm')}: scallop − tolerance",
                         f"99 % below {decimal(verify.get('cusp_p99_mm'), 4, 'mm')}",
                         f"stepover {' / '.join(steps) or DASH}", *_accepted(verify, "excess")),
                state=_state(verify, measured, "excess"))


def _gouge_fact(bundle):
    verify = bundle.verify
    return Fact(label="Gouge, deepest", value=decimal(verify.get("gouge_max_mm"), 4, "mm"),
                details=(f"accepted to {short_of_length(bundle.finish.gouge_mm, 'mm')}", *_proof(verify),
                         f"known to ±{decimal(verify.get('error_bound_mm'), 4, 'mm')}", *_accepted(verify, "gouge")),
                state=_state(verify, verify.get("gouge_max_mm"), "gouge"))


def _proof(verify):
    """How deep no move goes between the sample points either, and of which moves that is not proven."""
    proven, without = (number(_of_setups(verify, "certificate", key)) for key in ("moves", "not_covered"))
    most = decimal(verify.get("gouge_proven_mm"), 4, "mm")
    if most == DASH:
        return ("not proven between the sample points",)
    if not without:
        return (f"proven for every move: at most {most}",)
    return (f"proven for {grouped(proven)} of {counted(proven + without, 'move')}: at most {most}",
            f"no proof for {counted(without, 'move')}: {'; '.join(_reasons(verify))}")


def _reasons(verify):
    """Why moves are without a proof."""
    return dict.fromkeys(why for s in _setups_of(verify) for why in (s.get("certificate") or {}).get("not_covered") or ())


def _area_fact(bundle):
    verify = bundle.verify
    required, reached = verify.get("area_required_mm2"), verify.get("area_reached_mm2")
    left = number(verify.get("area_unreachable_mm2"))
    if left is None and number(required) is not None and number(reached) is not None:
        left = max(0.0, number(required) - number(reached))
    return Fact(label="Area reached", value=percent(reached, required, 2),
                details=(f"{grouped(reached)} of {grouped(required, 'mm²')}",
                         f"unreachable {decimal(left, 1, 'mm²')}"
                         + (f" in {counted(len(unreachable(bundle)), 'place')}, listed below" if unreachable(bundle) else ""),
                         *_accepted(verify, "missing_area")),
                state=_state(verify, reached, "missing_area"))


def _time_fact(bundle):
    setups = bundle.plan.get("setups") or ()
    times = [number(s.get("time_s")) for s in setups]
    total = sum(times) if times and None not in times else None
    assumed = dict.fromkeys(_sentence(s.get("time_assumptions")) for s in setups)
    each = [f"{s.get('name', DASH)}: {duration(s.get('time_s'))}" for s in setups] if len(setups) > 1 else []
    return Fact(label="Machine time", value=duration(total), details=(*each, *(a for a in assumed if a)), state="")


def _sentence(words):
    """Assumptions may come as one string, a list or a dict."""
    if isinstance(words, dict):
        return "; ".join(f"{key} {value}" for key, value in words.items())
    return "; ".join(map(str, words)) if isinstance(words, (list, tuple)) else str(words or "")


def _machine_fact(bundle):
    controls = ", ".join(dict.fromkeys(s.control for s in bundle.setups))
    return Fact(label="Machine", value=", ".join(dict.fromkeys(s.machine for s in bundle.setups)) or DASH,
                details=(controls, f"units {', '.join(dict.fromkeys(s.units for s in bundle.setups))}"), state="")


def _program_fact(bundle):
    programs = {s.program_file: s for s in bundle.setups}               # indexed positions share one
    lines = tuple(f"{s.program_file}: {grouped(s.program_lines)} lines, {file_size(s.program_bytes)}, "
                  f"SHA-256 {s.program_sha256[:12]}…" for s in programs.values())
    value = bundle.setups[0].program_file if len(programs) == 1 else f"{len(programs)} programs"
    return Fact(label="Program", value=value, details=lines, state="")


def unreachable(bundle):
    """[(what, area, place text, place_mm)] of surface no cutter of the plan reaches.

    Read from "unreachable" lists (items with area_mm2, place_mm, reason) in verify.json, its
    setups, and the operations of plan.json.
    """
    holders = [bundle.verify, *(bundle.verify.get("setups") or ()), bundle.plan]
    items = [("", item) for h in holders for item in _listed(h)]
    items += [(str(op.get("name", "")), item) for _, _, op in operations(bundle) for item in _listed(op)]
    rows = []
    for operation, item in items:
        point = item.get("place_mm", item.get("place"))
        what = str(item.get("reason") or item.get("why") or item.get("face") or item.get("faces") or "no cutter fits")
        what += f"; a radius of {decimal(item['stays_radius_mm'], 3, 'mm')} stays" if "stays_radius_mm" in item else ""
        spot = None if place(point) == DASH else tuple(map(float, point))
        row = (f"{operation}: {what}" if operation else what, decimal(item.get("area_mm2"), 1, "mm²"), place(point), spot)
        if row not in rows:
            rows.append(row)
    return rows


def _listed(holder):
    found = holder.get("unreachable") if isinstance(holder, dict) else None
    return [item for item in found if isinstance(item, dict)] if isinstance(found, (list, tuple)) else []


def operation_rows(bundle, units=None):
    """One dict of texts per operation, for the operations table and the setup sheet.

    Args:
        units: "mm" or "inch" of feeds, steps and heights; None: mm.
    """
    total = sum(number(op.get("time_s")) or 0.0 for _, _, op in operations(bundle))
    return [_operation_row(setup, k, op, total, Lengths(units or "mm")) for setup, k, op in operations(bundle)]


def _operation_row(setup, index, op, total_s, lengths):
    tool = op.get("tool") or {}
    return {
        "setup": setup.name, "name": str(op.get("name", DASH)), "tool": tool_name(tool),
        "spindle": decimal(op.get("spindle_rpm"), 0), "feed": feed_text(op.get("feed_mm_per_min"), lengths),
        "coolant": str(op.get("coolant") or DASH).replace("_", " "),
        "stepover": lengths.decimal(op.get("stepover_mm")), "scallop": decimal(op.get("scallop_mm"), 4),
        "tolerance": decimal(op.get("segment_tolerance_mm"), 4), "allowance": lengths.decimal(op.get("allowance_mm")),
        "length": decimal((number(op.get("length_mm")) or 0) / 1000 if op.get("length_mm") else None, 2, "m"),
        "time": duration(op.get("time_s")), "share": percent(op.get("time_s"), total_s, 0),
        "blocks": grouped(op.get("blocks")), "minimum_z": lengths.decimal(minimum_z_mm(setup, index)),
        "first_line": first_line(setup, index), "hollow": decimal(op.get("min_concave_radius_mm")),
        "hollow_place": place(concave_place(op)),
    }


def edge_rows(verify):
    """One dict of texts per operation: what its edges meet, out of verify.json's "process"."""
    return [_edge_row(str(part.get("setup", DASH)), op) for part in verify.get("setups") or ()
            for op in _process(part).get("operations") or ()]


def hole_rows(verify):
    """One dict of texts per operation that drills or taps, out of verify.json's "process"."""
    return [_hole_row(str(part.get("setup", DASH)), op) for part in verify.get("setups") or ()
            for op in _process(part).get("holes") or ()]


def along_setups(verify):
    """[(setup, verify.json's `process.along`)] of setups whose edges were looked at."""
    found = [(str(part.get("setup", DASH)), _process(part).get("along")) for part in verify.get("setups") or ()]
    return [(name, along) for name, along in found if along]


def not_checked(plan, setup):
    """What plan.json says is not known of a setup's process, in words."""
    rows = [part.get("not_checked") for part in plan.get("setups") or () if isinstance(part, dict) and part.get("name") == setup]
    return [str(words) for row in rows if isinstance(row, (list, tuple)) for words in row]


def edges_not_checked(verify):
    """What verify.json's "process" says of operations that are not looked at, one text a setup."""
    parts = [(str(part.get("setup", DASH)), _process(part).get("not_checked")) for part in verify.get("setups") or ()]
    unknown = dict.fromkeys(str(_process(part).get("forces", "")) for part in verify.get("setups") or ())
    strays = [(str(part.get("setup", DASH)), _process(part).get("drives")) for part in verify.get("setups") or ()]
    return [f"{name}: {words}" for name, words in parts if words] + [f"Forces: {words}" for words in unknown if words] + [
        f"{name}, drives: {_drives_in_words(found)}" for name, found in strays if found]


def edge_sets(verify, setup=None):
    """One text a tool and setup whose edges are changed on the way, or a set of which is counted; `setup`: of one alone."""
    rows = [(str(part.get("setup", DASH)), name, found) for part in verify.get("setups") or ()
            if setup in (None, part.get("setup")) for name, found in _edges(part).items()]
    return [f"{setup}, {name}: {decimal(found.get('minutes_in_cut'), 0)} min in the cut, "
            f"{counted(found.get('sets_of_edges', 1), 'set')} of edges" + _changes_in_words(found.get("change_before_lines"))
            for setup, name, found in rows]


def _edges(part):
    found = _process(part).get("edges")
    return found if isinstance(found, dict) else {}


def _changes_in_words(lines):
    return f", changed before line {', '.join(str(line) for line in lines)}" if lines else ""


def _drives_in_words(found):
    if not isinstance(found, dict):
        return str(found)
    return (f"they stray from the path by up to {short_of_length(found.get('deviation_mm'))} where the surface is left, of "
            f"{short_of_length(found.get('allowed_mm'))} that the control may")


def _process(part):
    found = part.get("process")
    return found if isinstance(found, dict) else {}


def _edge_row(setup, op):
    low, high = op.get("lowest_speed_m_per_min"), op.get("highest_speed_m_per_min")
    return {
        "setup": setup, "name": str(op.get("name", DASH)), "way": decimal((number(op.get("way_mm")) or 0) / 1000, 2, "m"),
        "in_cut": percent(op.get("share_in_cut"), 1.0, 0), "tip": percent(op.get("tip_share"), 1.0, 0),
        "depth": decimal(op.get("depth_mm"), 2), "line": grouped(op.get("depth_line")), "arc": decimal(op.get("immersion_deg"), 0),
        "speed": f"{decimal(low, 0)} … {decimal(high, 0)}" + _half_in_words(op.get("speeds_m_per_min")),
        "removed": decimal((number(op.get("removed_mm3")) or 0) / 1000, 2),
        "axial": decimal(op.get("axial_n"), 0), "radial": decimal(op.get("radial_n"), 0), "power": decimal(op.get("power_kw"), 2),
        "bend": decimal(op.get("deflection_mm"), 4),
        "rate": decimal(op.get("removal_cm3_per_h"), 1), "most": decimal(op.get("removal_most_cm3_per_h"), 1)}


def _hole_row(setup, op):
    return {
        "setup": setup, "name": str(op.get("name", DASH)), "tool": f"T{op.get('tool', DASH)} {op.get('does', '')}",
        "diameter": decimal(op.get("diameter_mm"), 2), "holes": grouped(op.get("holes")), "rpm": grouped(op.get("rpm")),
        "turn": decimal(op.get("feed_mm_per_turn"), 3), "torque": decimal(op.get("torque_n_m"), 2),
        "axial": decimal(op.get("axial_n"), 0), "power": decimal(op.get("power_kw"), 2), "line": grouped(op.get("line"))}


def _half_in_words(speeds):
    """The speed at the largest radius in the cut that half of the way is below."""
    return f", half below {decimal(speeds[1], 0)}" if isinstance(speeds, list) and len(speeds) == 3 else ""


def feed_text(feed, lengths=Lengths("mm")):
    """A feed, a range of feeds, or feeds by name, by the minute."""
    text = lambda value: lengths.decimal(value, 0)
    if isinstance(feed, dict):
        return ", ".join(f"{str(name).replace('_', ' ')} {text(value)}" for name, value in feed.items()) or DASH
    if isinstance(feed, (list, tuple)) and feed:
        low, high = text(min(feed)), text(max(feed))
        return low if low == high else f"{low} … {high}"
    return text(feed)


def minimum_z_mm(setup, operation):
    """Lowest tip height of an operation's cutting moves, WCS; None when it has none."""
    mine = (setup.path.operation == operation) & ~np.asarray(setup.path.is_rapid, dtype=bool)
    height = setup.frame.into(np.asarray(setup.path.points_mm)[mine])[:, 2]
    height = height[np.isfinite(height)]
    return float(height.min()) if len(height) else None


def first_line(setup, operation):
    """Program line where an operation begins."""
    lines = setup.operation_first_lines
    return str(lines[operation]) if operation < len(lines) and lines[operation] else DASH


def candidate_rows(bundle):
    """One dict of texts per cutter that was looked at, the chosen one marked."""
    rows = []
    for setup, _, op in operations(bundle):
        for candidate in op.get("candidates") or ():
            tool = candidate.get("tool")
            rows.append({"setup": setup.name, "operation": str(op.get("name", DASH)), "tool": tool_name(tool),
                         "diameter": short(candidate.get("diameter_mm"), "mm"),
                         "chosen": bool(candidate.get("chosen")), "reason": str(candidate.get("reason") or DASH)})
    return rows


def error_bound_rows(verify):
    """[(contribution, size)], the sum last."""
    parts = next((verify[k] for k in ("error_bounds_mm", "error_bounds", "bounds_mm", "bounds")
                  if isinstance(verify.get(k), dict)), {})
    total = verify.get("error_bound_mm")
    if isinstance(total, dict):
        parts, total = {**total, **parts}, None
    rows = [(str(k).removesuffix("_mm").replace("_", " "), decimal(v, 5, "mm")) for k, v in parts.items()]
    return rows + [("bound used for the verdict", decimal(total, 5, "mm"))] if number(total) is not None else rows


def stock_rows(verify):
    """[(setup, operation, file, volume, start of its hash)] of the stock kept after every operation."""
    return [(row["setup"], row["operation"], row["file"], decimal(row["volume_mm3"], 1, "mm³"), row["sha256"][:16])
            for row in verify.get("stock") or ()]


def measure_rows(bundle):
    """(header, rows): the verifiers' numbers, in total and per setup."""
    named = [(str(s.get("name") or s.get("setup") or f"setup {k + 1}"), s)
             for k, s in enumerate(bundle.verify.get("setups") or ()) if isinstance(s, dict)]
    columns = [("total", bundle.verify), *(named if len(named) > 1 else [])]
    spell = {"gouge_max_mm": ("deepest gouge", 4, "mm"),
             "gouge_proven_mm": ("no move with a proof goes deeper than", 4, "mm"),
             "excess_max_mm": ("most material left", 4, "mm"),
             "excess_proven_mm": ("proven between samples, where there is a proof: no more than", 4, "mm"),
             "cusp_max_mm": ("largest cusp", 4, "mm"), "cusp_p99_mm": ("99 % of cusps below", 4, "mm"),
             "gouge_volume_mm3": ("gouged away in all", 4, "mm³"),
             "excess_volume_mm3": ("left in all", 4, "mm³"),
             "gouge_volume_bound_mm3": ("gouged volume within ±", 4, "mm³"),
             "excess_volume_bound_mm3": ("volume left within ±", 4, "mm³"),
             "area_required_mm2": ("area required", 1, "mm²"), "area_reached_mm2": ("area reached", 1, "mm²"),
             "points_checked": ("points checked", None, "")}
    rows = [(name, [grouped(c.get(key)) if digits is None else decimal(c.get(key), digits, unit) for _, c in columns])
            for key, (name, digits, unit) in spell.items()]
    rows.append(("moves without a proven bound",
                 [grouped(_of_setups(c, "certificate", "not_covered")) for _, c in columns]))
    rows.append(("area without a proof",
                 [decimal(_of_setups(c, "sampling", "unproven_mm2"), 1, "mm²") for _, c in columns]))
    rows.append(("collisions", [grouped(len(c["collisions"])) if isinstance(c.get("collisions"), list) else DASH
                                for _, c in columns]))
    steps = [[abs(j["step_max_mm"]) for j in c.get("joints") or ()] for _, c in columns]
    if any(steps):
        rows.append(("largest mismatch between setups", [decimal(max(s, default=None), 4, "mm") for s in steps]))
    return [name for name, _ in columns], rows


def _of_setups(column, part, reasons):
    """Amounts for all reasons that a part of verify.json states, of a setup or of all setups together."""
    return sum(amount for s in _setups_of(column) for amount in ((s.get(part) or {}).get(reasons) or {}).values())


def _setups_of(column):
    return [s for s in column.get("setups") or [column] if isinstance(s, dict)]


def dimension_rows(verify):
    """One dict of texts a dimension and feature that the design states limits for."""
    return [{"name": row["name"], "place": place(row["place_mm"]), "verdict": "within" if row["ok"] else "out of tolerance",
             "sizes": [decimal(row[f"{n}_mm"], 4) for n in ("nominal", "lower", "upper", "least", "most", "fitted")]}
            for row in verify.get("dimensions") or ()]


def region_rows(verify):
    """One dict of texts a named region: area required, reached, out of reach and why; cusps and gouge in um."""
    um = lambda mm: decimal(1000 * mm, 2)
    return [{"name": row["name"], "required": decimal(row["area_required_mm2"], 1),
             "reached": percent(row["area_reached_mm2"], row["area_required_mm2"]),
             "unreachable": decimal(row["area_unreachable_mm2"], 1), "why": row["why"] or DASH, "cusp": um(row["cusp_max_mm"]),
             "most": um(row["cusp_p99_mm"]), "gouge": um(row["gouge_max_mm"])} for row in verify.get("regions") or ()]


def cusp_rows(verify):
    """One dict of texts a face and operation, in um: asked, measured, and what the formula gives for the local step."""
    rows = []
    for row in verify.get("cusps") or ():
        most, um = row["differs_most"], lambda mm: decimal(1000 * mm, 2)
        spread = lambda key: " / ".join(um(row[key][name]) for name in ("p50", "p99", "max"))
        rows.append({"face": str(row["face"]), "operation": row["operation"] or DASH, "ridges": grouped(row["ridges"]),
                     "wanted": um(row["wanted_mm"]), "measured": spread("measured_mm"), "formula": spread("formula_mm"),
                     "step": f"{decimal(row['step_mm']['p50'])} / {decimal(row['step_mm']['max'])}",
                     "agrees": percent(row["share_within_10_percent"], 1.0), "differs": um(most["by_mm"]),
                     "place": place(most["place_mm"])})
    return rows


def mesh_rows(verify):
    """[(what, value)] of the third view, by meshes; what was left out where it could not be made."""
    rows = []
    for setup in verify.get("setups") or ():
        mesh = setup.get("mesh") or {}
        if mesh.get("left_out"):
            return [("left out", mesh["left_out"])]
        if mesh:
            name = f"{setup.get('setup', DASH)}: "
            design, there, back = mesh["design"], mesh["hausdorff"]["stock_to_design"], mesh["hausdorff"]["design_to_stock"]
            faults = [f"{k.replace('_', ' ')} {v}" for k, v in design.items()
                      if v and k not in ("triangles", "smallest_angle_deg")]
            pair = lambda most, mean: f"{decimal(most, 5)} / {decimal(mean, 5)} mm"
            rows += [(name + "triangles of the design", f"{grouped(design['triangles'])}, smallest angle "
                      f"{decimal(design['smallest_angle_deg'], 2)}°, {', '.join(faults) or 'closed, manifold, no fault'}"),
                     *((f"{name}{way}, largest / mean", f"{pair(d['max_mm'], d['mean_mm'])} at {grouped(d['points'])} points")
                       for way, d in (("stock to design", there), ("design to stock", back))),
                     (name + "first verifier there, largest / mean",
                      pair(mesh["hausdorff"]["max_residual_mm"], mesh["hausdorff"]["mean_residual_mm"]))]
    return rows


def file_rows(bundle):
    """[(file, full SHA-256)] that tie this paper to the files."""
    programs = dict(row for s in bundle.setups for row in ((s.program_file, s.program_sha256), *s.continued)).items()
    return [(bundle.step_file, bundle.step_sha256), *programs,
            ("inputs (parameters, machine, cutters)", bundle.inputs_sha256),
            *([("revision of the repository", bundle.revision)] if bundle.revision else [])]
