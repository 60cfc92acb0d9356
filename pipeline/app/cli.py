"""The command line. CAD and kernels are imported only by the commands that need them.

Exit codes: 0 verified, 1 findings, 2 bad input, 3 internal, 130 interrupted.
"""

import errno
import json as jsonlib
import os
import shlex
import sys
import traceback
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Optional

import typer

import cuspline
from cuspline.app.terminal import Stages
from cuspline.values import interruption
from cuspline.values.amounts import counted
from cuspline.values.errors import CamError, InputError
from cuspline.values.input_files import LARGEST_PROGRAM_BYTES, text_of
from cuspline.values.models import no_such, shortened

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
                  help="From a parametric design to a posted and verified program.")
FINDINGS, DIFFERENT, BAD_INPUT, INTERNAL, INTERRUPTED = 1, 1, 2, 3, 130
SHOWN = 20                # findings told on the terminal; verify.json has all
WORDS_OF_AN_INTERRUPTION = "interrupted, nothing half-written is left"
NO_ROOM, NO_LEAVE = "make room on that disk", "name another folder, or get leave to write there"
SYSTEM_ADVICE = {errno.ENOSPC: NO_ROOM, errno.EDQUOT: NO_ROOM, errno.EFBIG: NO_ROOM, errno.EACCES: NO_LEAVE,
                 errno.EPERM: NO_LEAVE, errno.EROFS: NO_LEAVE, errno.EMFILE: "close other programs, or raise ulimit -n"}
REPORT = "report.html"
WARMING = 4               # processes that compile, of up to 1 GB each
LIBRARIES = "JSON file, small_mills, small_balls or inch_mills"
LIBRARY = f"tool library: a {LIBRARIES}"
AsJson = Annotated[bool, typer.Option("--json", help="machine-readable")]


def _print_version(wanted: bool):
    if wanted:
        print(f"cuspline {cuspline.__version__}")
        raise typer.Exit()


@app.callback()
def _options(version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True,
                                                   help="print the version and end")] = False):
    pass


@app.command()
def build(
        design: Annotated[str, typer.Argument(help="name of a design, a .py file, or a .toml job for a STEP part")],
        param: Annotated[list[str], typer.Option("-p", "--param", metavar="NAME=VALUE", help="repeatable")] = [],
        params: Annotated[str, typer.Option(help="several name=value in one text, quoted as a shell reads them")] = "",
        machine: Annotated[Optional[str], typer.Option(
            help="name of a machine, or its TOML file; else the design's own")] = None,
        post: Annotated[Optional[str], typer.Option(help="another post than the machine's own, by name or .py file")] = None,
        cutters: Annotated[Optional[Path], typer.Option(help=LIBRARY)] = None,
        shop: Annotated[Optional[Path], typer.Option(help="the shop's own values and materials (TOML)")] = None,
        measured: Annotated[Optional[Path], typer.Option(help="markers as measured in their setups (CSV)")] = None,
        out: Annotated[Optional[Path], typer.Option(help="folder for the outputs")] = None,
        stage: Annotated[str, typer.Option(help="last stage: step, plan, gcode, verify or report")] = "report",
        draft: Annotated[bool, typer.Option("--draft", help="only a first look at what the program would cut, nothing proven, into "
                                            "<folder>-draft")] = False,
        accept: Annotated[list[str], typer.Option(metavar="KIND", help="kind of finding to publish with, repeatable")] = []):
    """Build one design.  STEP, plan, program, simulation, verdict, report."""
    with Stages() as stages:
        stages.show(f"{design}: reading")
        from cuspline.app.request import Request
        order, result = Request(design=design, parameters=(*_words(params), *param), machine=machine, post=post, cutters=cutters,
                                shop=shop, measured=measured, out=out, stage=stage, draft=draft,
                                accept=tuple(accept)).built(stages.say)
    _tell(order.design.name, order.last_stage, result)
    raise typer.Exit(0 if result.is_ok else FINDINGS)


def _words(text):
    """The words of a text, as a shell reads them.

    Raises:
        InputError: a quote that is not closed.
    """
    try:
        return shlex.split(text)
    except ValueError as error:
        raise InputError(f"--params {shortened(text)}: {str(error).lower()}: close every quote; a value with spaces is "
                         "written name=\"a value\"") from None


@app.command()
def faces(part: Annotated[str, typer.Argument(help="a STEP file, a design or a job file")],
          param: Annotated[list[str], typer.Option("-p", "--param", metavar="NAME=VALUE", help="of a design, repeatable")] = [],
          toml: Annotated[bool, typer.Option("--toml", help="predicates for a job file instead of Python")] = False,
          pictures: Annotated[Optional[Path], typer.Option(help="folder for pictures of the numbered faces")] = None,
          json: AsJson = False):
    """List a part's faces.  With a predicate for each that is ready to be pasted."""
    from cuspline.app.face_list import draw_faces, face_rows, solid_of
    solid = solid_of(part, param)
    _print(face_rows(solid), json, lambda f: [
        f"{f['number']}  {f['kind']}  {f['area_mm2']:g} mm²  normal {_triple(f['normal'])}  middle {_triple(f['middle_mm'])}"
        + (f"  {f['name']}" if f["name"] else "") + (f"  colour {_triple(f['color'])}" if f["color"] else "")
        + _hole_in_words(f["hole"]) + _feature_in_words(f["feature"]),
        *("  " + line for line in f["toml" if toml else "python"].split("\n"))])
    if pictures is not None:
        print(draw_faces(solid, pictures), file=sys.stderr)


def _feature_in_words(feature):
    """What `faces` says behind a face of a pocket, step, boss or chamfer."""
    if feature is None:
        return ""
    size = {"chamfer": "wide", "boss": "high"}.get(feature["kind"], "deep")
    part = "" if feature["kind"] == "chamfer" else f", {'top' if size == 'high' else 'floor'}" if feature["is_floor"] else ", wall"
    return f"  {feature['name']}{part}, {feature['size_mm']:g} mm {size}, seen along {_triple(feature['axis'])}"


@app.command()
def positions(part: Annotated[str, typer.Argument(help="a STEP file, a design or a job file")],
              param: Annotated[list[str], typer.Option("-p", "--param", metavar="NAME=VALUE", help="of a design, repeatable")] = [],
              faces: Annotated[list[str], typer.Option(metavar="NAME", help="faces of a design, repeatable; none: all that are "
                                                       "cut")] = [],
              machine: Annotated[Optional[str], typer.Option(help="machine by name or file; left out: the design's")] = None,
              cutters: Annotated[Optional[Path], typer.Option(help=LIBRARY)] = None,
              steepest: Annotated[float, typer.Option(min=10, max=90, help="degrees between a face's normal and the tool")] = 60.0,
              json: AsJson = False):
    """Find indexed positions.  The few directions from which balls of the library see a part's faces, ready to be pasted."""
    from cuspline.app.position_list import in_words, position_rows
    _print(position_rows(part, param, faces, machine, cutters, steepest), json, in_words)


def _hole_in_words(hole):
    """What `faces` says behind a wall of a hole."""
    if hole is None:
        return ""
    size = f" of {hole['diameter_mm']:g} mm" if hole["diameter_mm"] else ""
    size += f", {hole['angle_deg']:g} degrees" if hole["angle_deg"] else ""
    return (f"  {hole['kind']} hole{size}, {hole['depth_mm']:g} mm deep, mouth {_triple(hole['mouth_mm'])}, axis "
            f"{_triple(hole['axis'])}")


def _triple(values):
    return "none" if values is None else " ".join(f"{v:g}" for v in values)


@app.command()
def verify(
        folders: Annotated[list[Path], typer.Argument(help="output folders, or programs in them")],
        measured: Annotated[Optional[Path], typer.Option(
            help="markers (CSV): judge the programs as they stand on a part that sits as measured here")] = None,
        post: Annotated[Optional[str], typer.Option(
            help="the .py file of the post that wrote the programs, where it is no post of ours")] = None,
        accept: Annotated[list[str], typer.Option(metavar="KIND", help="kind of finding to pass over this time, repeatable")] = []):
    """Judge posted files on disk again.  Against the STEP beside them; the exit status is the worst of all."""
    from cuspline.app.outcome import refuse_unknown_kinds
    refuse_unknown_kinds(accept)
    worst = 0
    for folder in folders:
        try:
            worst = max(worst, _verified(folder, measured, post, accept))
        except CamError as error:
            print(f"cuspline: {folder}: {error}", file=sys.stderr)
            worst = max(worst, BAD_INPUT)
    raise typer.Exit(worst)


def _verified(folder, measured, post, accept):
    """Judge one folder, or one program in it; the exit status."""
    from cuspline.app.catalogue import tool_table_of, with_post
    from cuspline.app.judge import judge
    from cuspline.app.outcome import Result
    from cuspline.design.job import read_job, read_published
    from cuspline.design.setup_alignment import read_measured
    from cuspline.kernel import brep
    from cuspline.values.checkpoints import kept_until_done
    from cuspline.verification.file_checks import own_acceptances
    folder, only = (folder.parent, folder.name) if folder.is_file() else (folder, None)
    job, published = read_job(folder), read_published(folder)
    if post is None and job.machine.control.post.endswith(".py"):
        raise InputError(f"the programs were written by the post {job.machine.control.post}: name that file with --post; a "
                         "folder of outputs does not choose which code is run")
    job = job.model_copy(update={"machine": with_post(job.machine, post)})
    if measured is not None:
        job = job.placed(read_measured(measured))
    if only is not None:
        asked = tuple(p for p in job.posted if only in p.files)
        if not asked:
            raise InputError(f"{folder / only} is no program of {job.design}; there are "
                             + ", ".join(name for p in job.posted for name in p.files))
        job = job.model_copy(update={"posted": asked})
        published = published.of_programs([name for p in asked for name in p.files], job, tool_table_of(job.machine)[0])
    brep.refuse_unreadable(folder / job.step)
    with kept_until_done(folder) as kept, Stages() as stages:
        judged = judge(folder, job, stages.say, kept=kept, published=published)
    passed = {*own_acceptances(folder, job, published), *accept}
    refused = judged.refused(passed)
    _tell(job.design, "verify", Result(folder=folder, is_ok=not refused, findings=tuple(refused),
                                       figures=judged.figures_in_words, accepted=judged.passed_over(passed)))
    return FINDINGS if refused else 0


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
             options_metavar="DESIGN [OPTIONS]",
             help="Build variants of a design side by side.  `cuspline sweep part.py -p a=1:5:9 -p b=2,4`, with all other options "
                  "of `cuspline build`; a table of every figure, a gallery, time against cusp.")
def sweep(
        context: typer.Context,
        param: Annotated[list[str], typer.Option("-p", "--param", metavar="NAME=VALUES", help="from:to:count or value,value; "
                                                     "repeatable")] = [],
        sample: Annotated[Optional[int], typer.Option(min=1, help="only so many of all combinations, always the same ones")] = None,
        workers: Annotated[Optional[int], typer.Option(min=1, max=1024, help="processes here; left out: one a core")] = None,
        scheduler: Annotated[Optional[str], typer.Option(help="a dask.distributed scheduler, tcp://host:port")] = None,
        out: Annotated[Optional[Path], typer.Option(help="folder; left out: outputs/<design>-sweep")] = None):
    from cuspline.app.sweep_run import Sweep
    request = _request_of(context.args)
    folder = out if out is not None else Path("outputs") / f"{Path(request.design).stem}-sweep"
    done = Sweep(request=request, texts=tuple(param), sample=sample, out=folder).run(workers, scheduler, print)
    raise typer.Exit(done)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
             options_metavar="DESIGN [OPTIONS]",
             help="Build a part again whenever it is saved.  Shows it on a page of this machine; takes all options of "
                  "`cuspline build`.")
def watch(context: typer.Context,
          port: Annotated[int, typer.Option(min=0, max=65535, help="of the page; 0: any that is free")] = 0):
    from cuspline.app.watch import watched
    watched(_request_of(context.args), port, partial(print, flush=True))


def _request_of(arguments):
    """The Request that `cuspline build` would make of its arguments.

    Raises:
        click's UsageError: an option that it has not.
    """
    from cuspline.app.request import Request
    given = _command().commands["build"].make_context("cuspline sweep", list(arguments)).params
    params, own = given.pop("params"), given.pop("param")
    return Request(**{**given, "accept": tuple(given["accept"]), "parameters": (*_words(params), *own)})


@app.command()
def diff(old: Annotated[Path, typer.Argument(help="folder of outputs")],
         new: Annotated[Path, typer.Argument(help="another one")],
         json: AsJson = False,
         markdown: Annotated[bool, typer.Option("--markdown", help="for a pull request")] = False,
         picture: Annotated[Optional[Path], typer.Option(help="write what changed in plan there (SVG)")] = None):
    """Compare two folders of outputs.  Programs by their moves; exit status 0: the same, 1: something differs."""
    from cuspline.app import comparison_words
    from cuspline.app.comparison import compared
    from cuspline.app.comparison_picture import picture as drawn
    found = compared(old, new)
    drawing = drawn(found.programs) if picture is not None else ""
    if drawing:
        _write(picture, drawing, "--picture")
    if json:
        print(jsonlib.dumps(comparison_words.as_document(found), indent=1))
    elif markdown:
        print("\n".join(comparison_words.markdown(found, picture if drawing else None)))
    else:
        print("\n".join(comparison_words.text(found)))
    raise typer.Exit(0 if found.is_same else DIFFERENT)


@app.command()
def send(program: Annotated[Path, typer.Argument(help="a posted program, or one file of a set")],
         to: Annotated[str, typer.Option(help="tcp://host:port, or a serial device as /dev/ttyUSB0")],
         baud: Annotated[int, typer.Option(help="of a serial device; 8 bits, no parity")] = 9600,
         handshake: Annotated[str, typer.Option(help="xon: the control holds with XOFF, goes on with XON; ok: it answers every "
                                                "line, as Grbl")] = "xon",
         unverified: Annotated[bool, typer.Option("--unverified", help="send it though its header does not say VERIFIED")] = False):
    """Send a program to a control that runs it while it comes."""
    from cuspline.app.sending import refuse_unverified, sent
    if handshake not in ("xon", "ok"):
        raise InputError(f"--handshake {shortened(handshake)}: it must be xon or ok")
    text = text_of(program, "program", encoding="ascii", largest_bytes=LARGEST_PROGRAM_BYTES)
    if not unverified:
        refuse_unverified(text, program.name)
    with Stages() as stages:
        count = sent(text, to, baud=baud, handshake=handshake, say=stages.say)
    print(f"{program.name}: {counted(count, 'line')} sent")


@app.command()
def restart(program: Annotated[Path, typer.Argument(help="a posted program, or one file of a set")],
            point: Annotated[Optional[str], typer.Argument(
                help="restart point, as N2003, or an operation, as OP3; none: list them")] = None,
            to: Annotated[Optional[Path], typer.Option(help="write it there; none: to the screen")] = None):
    """Begin a program at one of its operations.  Or at one of the restart points among repeated passes."""
    from cuspline.posts.restart import operations_in_words, restart_points, restarted, restarted_at_operation
    text = text_of(program, "program", encoding="ascii", largest_bytes=LARGEST_PROGRAM_BYTES)
    if point is None:
        points = " ".join(f"N{k}" for k in restart_points(text))
        rows = [*(f"OP{k}  {words}" for k, words in operations_in_words(text).items()), *([points] if points else [])]
        print("\n".join(rows) or "no restart points")
        return
    is_operation = point.upper().startswith("OP")
    digits = point.upper().removeprefix("OP" if is_operation else "N")
    if not digits.isdecimal() or not digits.isascii() or len(digits) > 9:
        raise InputError(f"restart point {shortened(point)}: write it as in the program, such as N2003, or OP3")
    begun = (restarted_at_operation if is_operation else restarted)(text, int(digits))
    if to is None:
        print(begun, end="")
        return
    _write(to, begun, "--to")


@app.command()
def repost(folder: Annotated[Path, typer.Argument(help="a folder of outputs")],
           line: Annotated[Optional[int], typer.Argument(
               min=1, help="it begins at the last restart point not behind it; none: list all")] = None,
           tool: Annotated[Optional[int], typer.Option(help="number of the ball that was changed")] = None,
           diameter: Annotated[Optional[float], typer.Option(min=0.01, max=200, help="its diameter as measured, mm")] = None,
           setup: Annotated[Optional[str], typer.Option(help="its name, where the folder has several")] = None,
           to: Annotated[Optional[Path], typer.Option(help="write it there; none: to the screen")] = None):
    """Post the rest of a program for a changed ball.  From any retract on, for its diameter as measured."""
    from cuspline.app.reposting import reposted, restart_lines
    if line is None:
        for name, lines in restart_lines(folder, setup).items():
            print(f"{name}: {' '.join(map(str, lines))}")
        return
    if (tool is None) != (diameter is None):
        raise InputError("--tool and --diameter go together: which ball was changed, and what it measures")
    done = reposted(folder, line, number=tool, diameter_mm=diameter, setup=setup)
    print(f"tips moved by up to {1000 * done.moved_mm:.2f} um", file=sys.stderr)
    _hand_out(done.texts, to, "--to")


def _hand_out(texts, to, option):
    """A program's texts: one to the screen where no file is named, several into numbered files."""
    if to is None and len(texts) > 1:
        raise InputError(f"the program takes {len(texts)} files: name them by {option}")
    if to is None:
        print(texts[0], end="")
        return
    for k, text in enumerate(texts, 1):
        _write(to if len(texts) == 1 else to.with_name(f"{to.stem}-{k:02d}{to.suffix}"), text, option)


@app.command()
def monitor(folder: Annotated[Path, typer.Argument(help="a folder of outputs")],
            to: Annotated[Optional[Path], typer.Option(help="write it there; none: to the screen")] = None):
    """List what a monitor is to expect (JSON).  Of every operation: forces, power, bands in which the teeth strike."""
    from cuspline.app.monitor import expected
    text = jsonlib.dumps(expected(folder), indent=1) + "\n"
    if to is None:
        print(text, end="")
    else:
        _write(to, text, "--to")


@app.command()
def lobes(cutters: Annotated[Path, typer.Option(help="tool library (JSON), its tools with `chatter` modes")],
          tool: Annotated[int, typer.Option(help="number of the tool")],
          material: Annotated[str, typer.Option(help="work material, whose cutting force is known")],
          machine: Annotated[str, typer.Option(help="machine by name or TOML file")] = "mill_3axis",
          shop: Annotated[Optional[Path], typer.Option(help="a shop's own file (TOML)")] = None, json: AsJson = False):
    """List spindle speeds without chatter.  Those at which a tool cuts deepest in a groove, from its stability lobes."""
    from cuspline.app import catalogue
    from cuspline.process.chatter import best_speeds, limits_mm
    from cuspline.shop.cutting_forces import force_of
    from cuspline.shop.practice import shop_file
    chosen, force = catalogue.find_library(cutters).number(tool), force_of(material, shop_file(shop).forces)
    if force is None:
        raise InputError(f"no cutting force is known of {material}: give one as [[forces]] in a shop's file (--shop)")
    if chosen.chatter is None or chosen.chatter.modes is None:
        raise InputError(f"T{tool} states no modes: lobes need frequency, stiffness and damping ratio of each (`chatter.modes`)")
    always, found = limits_mm({tool: chosen}, force)[tool], best_speeds(chosen, force, catalogue.find_machine(machine).spindle)
    rows = [{"rpm": round(rpm), "depth_mm": round(depth, 4), "at_every_speed_mm": round(always, 4)} for rpm, depth in found]
    _print(rows, json, lambda r: [
        f"{r['rpm']} rpm: {r['depth_mm']:g} mm in a groove, {r['at_every_speed_mm']:g} mm at every speed"])


@app.command()
def translate(
        program: Annotated[Path, typer.Argument(help="a program in another control's words")],
        to: Annotated[str, typer.Option(help="post that writes the new words")],
        source: Annotated[Optional[str], typer.Option("--from", help="post whose words it is in; else by its name's end")] = None,
        machine: Annotated[Optional[str], typer.Option(
            help="the new control's machine, by name or TOML file: decimals, units, tolerance; else the post's own")] = None,
        from_machine: Annotated[Optional[str], typer.Option(
            help="the machine that the program is for, by name or TOML file, where it turns rotary axes")] = None,
        cutters: Annotated[Optional[Path], typer.Option(
            help="the tools (JSON), where the post writes their lengths, and for rotary axes")] = None,
        out: Annotated[Optional[Path], typer.Option(help="write it there; none: to the screen")] = None):
    """Write a program in another control's words.  The same moves, read back and compared; what is not known is refused."""
    from cuspline.app import catalogue, translation
    text = text_of(program, "program", encoding="ascii", largest_bytes=LARGEST_PROGRAM_BYTES)
    target = translation.machine_of(to) if machine is None else catalogue.with_post(catalogue.find_machine(machine), to)
    tools = None if cutters is None else {t.number: t for t in catalogue.find_library(cutters).tools}
    done = translation.translated(text, name=program.name, target=target, tools=tools,
                                  source=translation.source_of(program.name, source, from_machine))
    for note in done.notes:
        print(f"note: {note}", file=sys.stderr)
    _hand_out(done.texts, out, "--out")


@app.command()
def calibrate(machine: Annotated[str, typer.Option(help="machine by name or TOML file")] = "mill_3axis",
              feed: Annotated[float, typer.Option(min=1, max=100_000, help="mm/min")] = 1000.0,
              tool: Annotated[Optional[int], typer.Option(help="number of the tool that cuts the groove; none: the first")] = None,
              cutters: Annotated[Optional[Path], typer.Option(help=LIBRARY)] = None,
              corner_mm: Annotated[Optional[float], typer.Option(
                  min=1e-4, max=100, help="as measured: how far the groove is from its corner, along the bisector")] = None,
              out: Annotated[Optional[Path], typer.Option(help="write it there; none: to the screen")] = None):
    """Post the L-shaped test of the drives.  With the corner as measured: time constants for the machine's file."""
    from cuspline.app import catalogue
    from cuspline.app.calibrate import calibration_text, measured_text
    if corner_mm is None:
        library = catalogue.find_library(cutters)
        chosen = library.tools[0] if tool is None else library.number(tool)
        text = calibration_text(catalogue.find_machine(machine), chosen, feed)
    else:
        text = measured_text(corner_mm, feed)
    if out is None:
        print(text, end="")
    else:
        _write(out, text, "--out")


def _write(path, text, option):
    try:
        path.write_text(text)
    except OSError as error:
        raise InputError(f"{option} {path}: cannot be written ({error.strerror}); name another file") from None


@app.command()
def designs(json: AsJson = False):
    """List the designs with their parameters."""
    from cuspline.app import catalogue
    rows = []
    for name in catalogue.design_names():
        source = catalogue.find_design(name)
        fields = source.parameters.model_json_schema()["properties"]
        rows.append({"name": name, "description": (sys.modules[source.make.__module__].__doc__ or "").split("\n")[0],
                     "parameters": [_parameter_row(n, f) for n, f in fields.items()]})
    _print(rows, json, lambda r: [f"{r['name']}: {r['description']}"] + [
        f"  {p['name']} = {p['default']}  {p['range']}  {p['description']}" for p in r["parameters"]])


def _parameter_row(name, field):
    given = [f for f in field.get("anyOf", []) if f.get("type") != "null"]
    field = {**(given[0] if given else {}), **field}
    low, high = field.get("minimum", field.get("exclusiveMinimum")), field.get("maximum", field.get("exclusiveMaximum"))
    choices = field.get("enum")
    span = " | ".join(map(str, choices or [])) if low is None and high is None else (
        f"{low} .. {high}" if None not in (low, high) else f"from {low}" if high is None else f"up to {high}")
    unit = next((u for u in ("mm", "deg", "rad", "mm2") if name.endswith("_" + u)), "")
    return {"name": name, "default": field.get("default"), "unit": unit, "range": span,
            "description": field.get("description", "")}


@app.command()
def strategies(json: AsJson = False):
    """List the strategies.  What operations of a setup can do, with their parameters."""
    from cuspline.design.operations import registered
    rows = []
    for kind, strategy in sorted(registered().items()):
        fields = strategy.model_json_schema()["properties"]
        rows.append({"kind": kind, "description": " ".join((strategy.__doc__ or "").partition("\n\n")[0].split()),
                     "class": f"{strategy.__module__}.{strategy.__name__}", "picture": strategy.picture.strip("\n"),
                     "parameters": [_parameter_row(n, f) for n, f in fields.items()]})
    _print(rows, json, lambda r: [f"{r['kind']}: {r['description']}  ({r['class']})", "", *r["picture"].split("\n"), ""] + [
        f"  {p['name']} = {p['default']}  {p['range']}  {p['description']}" for p in r["parameters"]])


@app.command()
def shop(file: Annotated[Optional[Path], typer.Argument(help="a shop's own file (TOML)")] = None, json: AsJson = False):
    """List what a shop decides.  Allowances, depths of cut, clearances."""
    from cuspline.shop.practice import Practice, shop_file
    practice, fields = shop_file(file).practice, Practice.model_json_schema()["properties"]
    rows = [{**_parameter_row(n, f), "value": getattr(practice, n)} for n, f in fields.items()]
    _print(rows, json, lambda p: [f"{p['name']} = {p['value']}  {p['range']}  {p['description']}"])


@app.command()
def machines(json: AsJson = False):
    """List the machines."""
    from cuspline.app import catalogue
    rows = [catalogue.find_machine(n).model_dump(mode="json") for n in catalogue.machine_names()]
    _print(rows, json, lambda m: [f"{m['name']}: {m['description']}"] + [
        f"  {a.upper()} {m[a]['min_mm']:g} .. {m[a]['max_mm']:g} mm, {m[a]['rapid_mm_per_min']:g} mm/min, "
        f"{m[a]['acceleration_mm_per_s2']:g} mm/s2" for a in "xyz"] + [
        f"  {a.upper()} {_range_in_words(m[a])}, {m[a]['rapid_deg_per_min']:g} degrees/min, "
        f"{m[a]['acceleration_deg_per_s2']:g} degrees/s2" for a in "abc" if a in m] + [
        f"  from the part to the tool: {' '.join(m[k])}" for k in ("chain",) if k in m] + [
        f"  spindle {m['spindle']['min_rpm']:g} .. {m['spindle']['max_rpm']:g} rpm, post {m['control']['post']}, "
        f"units {m['control']['units']}"])


def _range_in_words(rotary):
    return "endless" if rotary["min_deg"] is None else f"{rotary['min_deg']:g} .. {rotary['max_deg']:g} degrees"


@app.command()
def cutters(
        library: Annotated[Optional[Path], typer.Argument(help=LIBRARIES)] = None,
        json: AsJson = False,
        foreign: Annotated[Optional[Path], typer.Option(
            "--import", help="Fusion (.json, .tools) or FreeCAD (.fctb, .fctl) library to read in")] = None,
        to: Annotated[Optional[Path], typer.Option(
            help="write it to a .json library, Fusion's .tools or .fusion.json, FreeCAD's .fctl, or the control's tool table, and "
            "beside it what was dropped")] = None,
        holder: Annotated[Optional[str], typer.Option(help="holder for imported tools that come without one")] = None,
        stick_out: Annotated[Optional[float], typer.Option(help="mm, for imported tools that come without one")] = None,
        renumber: Annotated[bool, typer.Option(help="number imported tools 1, 2, ...")] = False,
        machine: Annotated[str, typer.Option(help="whose tool table it is")] = "mill_3axis"):
    """List the tools of a library.  Import one from Fusion or FreeCAD, export one to them or to a control."""
    from cuspline.app import catalogue
    from cuspline.shop.tool_exchange import files
    mill = catalogue.find_machine(machine)
    post = catalogue.find_post(mill.control.post)
    if to is not None:
        files.refuse_target(to, Path(post.TOOL_TABLE).suffix if post.TOOL_TABLE else "")
    found = catalogue.find_library(library)
    imported = None
    if foreign is not None:
        from cuspline.shop.tool_exchange.importing import import_tools
        imported = import_tools(foreign, holder=holder, holders=[t.holder for t in found.tools],
                                stick_out_mm=stick_out, is_renumbered=renumber)
        found = imported.library
        print("\n".join(files.report_lines(imported)), file=sys.stderr)
    if to is not None:
        files.write_tools(found, to, mill.control, post.tool_table, imported)
        print(f"{to} and {files.sidecar(to).name} written", file=sys.stderr)
        return
    rows = [t.model_dump(mode="json") for t in found.tools]
    _print(rows, json, lambda t: [
        f"T{t['number']} {t['cutter']['name']}: {t['cutter']['type']}, D {t['cutter']['diameter_mm']:g} mm, "
        f"R {t['cutter']['corner_radius_mm']:g} mm, {t['cutter']['flutes']} flutes, "
        f"reach {t['cutter']['reach_mm']:g} mm, stick-out {t['stick_out_mm']:g} mm, {t['holder']['name']}"])


@app.command()
def posts(json: AsJson = False):
    """List the posts."""
    from cuspline.app import catalogue
    rows = [{"name": n, "description": (catalogue.find_post(n).__doc__ or "").split("\n")[0]}
            for n in catalogue.post_names()]
    _print(rows, json, lambda p: [f"{p['name']}: {p['description']}"])


@app.command()
def materials(file: Annotated[Optional[Path], typer.Argument(help="a shop's own file (TOML)")] = None, json: AsJson = False):
    """List the work materials.  With their cutting data, and where these come from."""
    from cuspline.shop.materials import known_materials
    from cuspline.shop.practice import shop_file
    own = shop_file(file)
    there = {**known_materials(), **{m.name: m for m in own.materials}}
    _print([m.model_dump(mode="json") for m in there.values()], json, lambda m: [
        f"{m['name']}: {m['description']}",
        f"  cutting speed {m['rough_speed_m_per_min']:g} m/min roughing, {m['finish_speed_m_per_min']:g} m/min finishing",
        f"  feed per tooth {m['feed_per_tooth_share']:g} of the diameter ({10 * m['feed_per_tooth_share']:g} mm at 10 mm), "
        f"stepdown {m['stepdown_share']:g} of the diameter, coolant {m['coolant']}",
        "  drills {:g} m/min, {:g} of the diameter a turn".format(*there[m["name"]].drilling),
        f"  source: {m['source']}", *_of_the_process(m["name"], own)])


def _of_the_process(material, own):
    """What is known of a material's resistance and of the life of edges in it, with their sources."""
    from cuspline.shop.cutting_forces import force_of
    from cuspline.shop.hole_forces import hole_force_of
    from cuspline.shop.tool_lives import life_of
    force, life = force_of(material, own.forces), life_of(material, own.lives)
    if force is not None:
        yield (f"  resists with {force.force_n_per_mm2:g} N/mm² and {force.edge_n_per_mm:g} N/mm, "
               f"{force.force_angle_deg:g} degrees to the surface")
        yield f"  source: {force.source}"
    holes = hole_force_of(material, own.hole_forces)
    if holes is not None:
        taps = "" if holes.tap_n_per_mm2 is None else f", taps {holes.tap_n_per_mm2:g} N/mm²"
        yield f"  drills meet {holes.drill_n_per_mm2:g} N/mm²{taps}"
        yield f"  source: {holes.source}"
    if life is not None:
        yield f"  edges last {life.life_min:g} min in the cut, {life.time_factor:g} times the time of aluminium"
        yield f"  source: {life.source}"


@app.command()
def findings(kind: Annotated[Optional[str], typer.Argument(help="one of them: an example, and how to fix it")] = None,
             json: AsJson = False):
    """List the kinds of findings that a verdict may have."""
    from cuspline.values.finding_kinds import KINDS
    if kind is not None and kind not in KINDS:
        raise InputError(f"{shortened(kind)}: {no_such(kind, KINDS)}")
    rows = [{"kind": name, **asdict(found)} for name, found in KINDS.items() if kind in (None, name)]
    _print(rows, json, lambda f: [f"{f['kind']}: {f['meaning']}"] + (
        [] if kind is None else [f"  example: {f['example']}", f"  fix: {f['fix']}"]))


@app.command()
def schema(document: Annotated[str, typer.Argument(help="plan, verify, manifest; machine, tools, job or shop")]):
    """Print a JSON schema.  Of plan.json, verify.json, manifest.json; of a machine's, a job's, a shop's file; of a tool library."""
    from cuspline.app.documents import DOCUMENTS, FILES, schema_of
    if document not in DOCUMENTS and document not in FILES:
        raise InputError(f"{shortened(document)}: {no_such(document, (*DOCUMENTS, *FILES))}")
    print(schema_of(document), end="")


@app.command()
def release(outputs: Annotated[Path, typer.Argument(help="folder of outputs: every published part in it goes in")],
            assets: Annotated[Path, typer.Argument(help="the release's files, a new folder")],
            tag: Annotated[str, typer.Argument(help="of the release, in the names of the files")],
            lock: Annotated[Path, typer.Option(help="packages of the environment, for the bill of materials")] = Path(
                "requirements.lock")):
    """Write the files of a release.  An archive, STEP and report a published part, a bill of materials, SHA256SUMS."""
    from cuspline.app.release import TAG, fault, write_assets
    if wrong := fault(outputs):
        raise InputError(wrong)
    if not TAG.fullmatch(tag):
        raise InputError(f"the tag {tag!r} cannot stand in a file's name: write letters, digits, . _ and -")
    if assets.exists():
        raise InputError(f"{assets} is there already: nothing is overwritten; name a new folder")
    if not lock.is_file():
        print(f"note: {lock} is not there: no bill of materials; name it by --lock", file=sys.stderr)
    print("\n".join(write_assets(outputs, assets, tag, lock if lock.is_file() else None)))


@app.command()
def new(folder: Annotated[Path, typer.Argument(help="where nothing is yet: the repository's folder")]):
    """Begin a repository of your own.  A part, a Makefile, a workflow, the lock of the environment."""
    from cuspline.app.own_repository import write_repository
    names = write_repository(folder)
    print(f"{folder}: {', '.join(names)}; `make` in it builds parts/trough.py")


@app.command()
def warm():
    """Compile the kernels once; later commands find them ready."""
    from cuspline.app.warm import compiled
    from cuspline.values.threads import thread_count
    for count, of, what in compiled(min(thread_count(), WARMING)):
        print(f"compiled kernels {count}/{of}: {what}", flush=True)


@app.command()
def doctor():
    """Check the environment for what breaks silently."""
    from cuspline.app.doctor import complaints, notes
    found = complaints()
    for what, mend in found:
        print(f"WRONG: {what}; {mend}")
    for note in notes():
        print(f"note: {note}")
    print("environment is well" if not found else f"{counted(len(found), 'fault')} in the environment")
    raise typer.Exit(BAD_INPUT if found else 0)


def _print(rows, as_json, lines):
    if as_json:
        print(jsonlib.dumps(rows, indent=1))
    else:
        print("\n".join(line for row in rows for line in lines(row)))


def _tell(name, stage, result):
    """The verdict in a few lines: its figures where it is good, and every finding, those accepted too."""
    findings, accepted, figures = result.findings, result.accepted, result.figures
    if result.left_out:
        print(f"note: {result.left_out}")
    if result.told:
        print(f"{name}: {result.told} ({result.folder})")
    elif stage in ("verify", "report"):
        passed = f" with {counted(len(accepted), 'accepted finding')}" if accepted else ""
        verdict = f"REJECTED, {counted(len(findings), 'finding')}" if findings else f"VERIFIED{passed}"
        print(f"{name}: {verdict}"
              f"{', ' + figures if figures else ''} ({result.folder})")
    elif figures:
        print(f"{name}: {figures.upper()[0]}{figures[1:]}" + (f", {counted(len(findings), 'finding')}" if findings else "")
              + f" ({result.folder})")
    else:
        print(f"{name}: {stage} made, nothing verified ({result.folder})")
    for mark, shown in (("", findings), ("accepted: ", accepted)):
        for f in shown[:SHOWN]:
            print(f"  {mark}{_in_a_line(f)}")
        if len(shown) > SHOWN:
            print(f"  {mark}and {len(shown) - SHOWN} more")
    if stage == "report" and (result.folder / REPORT).exists():
        print(f"  report: {result.folder / REPORT}")


def _in_a_line(f):
    """A finding in words."""
    place = "" if f.place_mm is None else " at " + " ".join(f"{a}{x:.3f}" for a, x in zip("XYZ", f.place_mm))
    line = (f", line {f.line}" if f.line else "") + (f", called in line {f.call_line}" if f.call_line else "")
    size = f" {f.size_in_words}" if f.size_in_words else ""
    return f"{f.kind}{size}{place}{f' in {f.operation}' if f.operation else ''}{line}: {f.advice}"


def main():
    """Entry point: ends the process with the command's exit code."""
    interruption.listen()
    code = run(sys.argv[1:])
    sys.exit(code)


def run(arguments):
    """Exit code of one command; whatever goes wrong has become one sentence on standard error.

    Args:
        arguments: words behind `cuspline`.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")       # a name of a file may be no text
    try:
        code = _command().main(list(arguments) or ["--help"], prog_name="cuspline", standalone_mode=False) or 0
        sys.stdout.flush()
        if code == INTERRUPTED:                                 # typer's answer to Ctrl-C
            raise KeyboardInterrupt
    except BaseException as error:                              # a binding may hand on Ctrl-C as any error
        code, words = (INTERRUPTED, WORDS_OF_AN_INTERRUPTION) if interruption.is_asked() else _told(error)
        print(f"cuspline: {_printable(words)}", file=sys.stderr)
        if code == INTERNAL and os.environ.get("CUSPLINE_DEBUG"):
            traceback.print_exc()
    else:
        if interruption.is_asked():                             # swallowed on the way, so the command came to its end
            print(f"cuspline: {WORDS_OF_AN_INTERRUPTION}", file=sys.stderr)
            code = INTERRUPTED
    return code


@cache
def _command():
    return typer.main.get_command(app)


def _told(error):
    """(exit code, sentence) of what ended a command."""
    if isinstance(error, SystemExit) and isinstance(error.__context__, BrokenPipeError):    # typer's answer to it
        error = error.__context__
    if isinstance(error, (typer.Abort, KeyboardInterrupt)):
        return INTERRUPTED, WORDS_OF_AN_INTERRUPTION
    if isinstance(error, CamError):
        return BAD_INPUT, str(error)
    if hasattr(error, "format_message"):                        # of the command line's parser
        return BAD_INPUT, error.format_message()
    if isinstance(error, OSError):
        return BAD_INPUT, _of_the_system(error)
    if isinstance(error, MemoryError):
        return BAD_INPUT, ("there is not enough memory for this: close other programs, coarsen the finish, or take a "
                           "smaller part")
    return INTERNAL, (f"internal error, {type(error).__name__}: {error}; run again with CUSPLINE_DEBUG=1 for details")


def _of_the_system(error):
    """What the system has refused, and how to mend it."""
    if isinstance(error, BrokenPipeError):
        sys.stdout = open(os.devnull, "w")                      # or Python would complain once more at its end
        return "whoever read the output has closed it"
    where = f"{error.filename}: " if error.filename else ""
    mend = SYSTEM_ADVICE.get(error.errno, "look whether the file or folder can be reached, read and written")
    return f"{where}{error.strerror or error}: {mend}; nothing half-written is left"


def _printable(text):
    """A message without what would move a terminal's cursor or colour it."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)
