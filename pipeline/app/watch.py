"""`cuspline watch`: a part is built again whenever a file beside it is saved; a page on this machine shows what it came to.

Two processes stay, CAD and kernels imported: one makes the solid at once and draws its edges, the other makes a draft and then
builds to the end.  A build that is outdated by another save is ended; the solid never waits for it.
"""

import os
import shutil
import signal
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from json import dumps
from multiprocessing import connection, get_context
from pathlib import Path

import numpy as np

from cuspline.app.sweep import FILES_OF_DESIGNS
from cuspline.values import fixed_math as fixed
from cuspline.values import interruption
from cuspline.values.errors import CamError, InputError

HOST, LOOK_S = "127.0.0.1", 0.2         # nobody but this machine; how often files are looked at
PATIENCE_S = 60.0                       # with a process that says nothing, before it is ended for a later save
PAGE = Path(__file__).with_name("watch.html")
SOLID, DRAFT, BUILD = "solid", "draft", "build"
TYPES = {".html": "text/html", ".svg": "image/svg+xml", ".png": "image/png", ".json": "application/json"}
WIDTH_PX, MARGIN_PX, ALONG = 640.0, 10.0, 24            # of the drawing, round it; points along an edge
ON_PAGE = np.array([[0.8660254, 0.5], [0.8660254, -0.5], [0.0, -1.0]])     # right and down, of the part's x, y and z: isometric,
                                                                           # seen from the corner above x and -y


# what the processes do -------------------------------------------------------------------------


def drawn(request, send):
    """The solid of a request: its edges as SVG, and what it is in words; `send`: unused."""
    from cuspline.app import catalogue
    from cuspline.kernel import brep
    parameters = catalogue.find_shop(request.shop, request.parameters)[1]
    design = catalogue.make_design(catalogue.find_design(str(request.design)), parameters)
    solid = brep.the_solid(design.solid, f"design {design.name}")
    low, high = brep.bounding_box_mm(solid)
    size = " x ".join(f"{b - a:.4g}" for a, b in zip(low, high))
    lines = [brep.edge_points(edge, ALONG)[0] for edge, _ in brep.edges_with_faces(solid)]
    words = f"{design.name}: {size} mm, {brep.volume_mm3(solid):.6g} mm³, {len(brep.faces_of(solid))} faces"
    return {"words": words, "svg": edges_svg(lines)}


def finished(request, send):
    """The whole build of a request; before it a draft, which is sent on the way: send(what, record)."""
    from cuspline.app.judge import told_in_words
    from cuspline.values.input_files import json_of
    say = partial(send, "stage")
    with suppress(CamError):            # the build says what is wrong
        _, first = replace(request, draft=True).built(say)
        send(DRAFT, {"words": first.figures + _kinds_in_words(first)})
    _, result = request.built(say)
    path = result.folder / "verify.json"
    figures = told_in_words(json_of(path, "verdict")) if path.is_file() else "nothing verified"
    word = "REJECTED" if not result.is_ok else "VERIFIED" if path.is_file() else "made"
    return {"words": f"{word}, {figures}{_kinds_in_words(result)}", "folder": str(result.folder)}


def _kinds_in_words(result):
    """What stands behind a verdict: the kinds of its findings."""
    kinds = ", ".join(dict.fromkeys(f.kind for f in result.findings))
    return f": {kinds}" if kinds else ""


def edges_svg(lines):
    """SVG of lines (n, 3) in mm, seen from a corner above."""
    flat = [fixed.matmul(line, ON_PAGE) for line in lines]
    low, high = (f(np.vstack(flat), axis=0) for f in (np.min, np.max))
    scale = WIDTH_PX / max(*(high - low), 1e-6)
    drawn = [(line - low) * scale + MARGIN_PX for line in flat]
    ways = "".join(f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in line.tolist())}"/>' for line in drawn)
    width, height = (high - low) * scale + 2 * MARGIN_PX
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}"><g fill="none" stroke="#1f2328" '
            f'stroke-width="1.2">{ways}</g></svg>')


def _work(pipe, does):
    """In a process: do what comes, say on the way what is being done."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            number, request = pipe.recv()
            while pipe.poll():                  # outdated by a later save
                number, request = pipe.recv()
        except EOFError:
            return
        _forget_modules(Path(str(request.design)).resolve().parent)
        try:
            pipe.send((number, "done", does(request, lambda what, told: pipe.send((number, what, told)))))
        except CamError as error:
            pipe.send((number, "wrong", str(error)))
        except Exception as error:          # of a user's own functions, of the CAD kernel
            pipe.send((number, "wrong", f"{type(error).__name__}: {error}"))


def _forget_modules(folder):
    """Modules beside the part, which it imports, are imported anew."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and Path(file).parent == folder and not name.startswith(("cuspline", "__main__", "__mp_main__")):
            del sys.modules[name]


@dataclass(eq=False)
class Helper:
    """A process that does one thing at a time."""

    does: object                    # function (request, send) -> record
    process: object = None
    pipe: object = None
    is_busy: bool = False
    is_heard: bool = False          # it has said that it is at work
    given_s: float = 0.0            # when it was given something

    def begin(self):
        context = get_context("spawn")
        self.pipe, there = context.Pipe()
        self.process = context.Process(target=_work, args=(there, self.does), daemon=True)
        self.process.start()
        there.close()

    def give(self, number, request):
        """Begin with the request of a save; a build of an earlier one is given up, imports are not."""
        if self.is_busy and (self.is_heard or time.monotonic() - self.given_s > PATIENCE_S):
            self.end()
        if self.process is None:
            self.begin()
        self.pipe.send((number, request))
        self.is_busy, self.is_heard, self.given_s = True, False, time.monotonic()

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.pipe.close()
        self.process, self.is_busy = None, False


# watching --------------------------------------------------------------------------------------


def files_beside(part):
    """{path: (time, size)} of what a part may be made of, in its folder."""
    found = {}
    for path in part.parent.iterdir():
        try:
            if path.suffix.lower() in FILES_OF_DESIGNS and path.is_file():
                found[path] = (path.stat().st_mtime_ns, path.stat().st_size)
        except OSError:             # an editor writes it anew
            continue
    return found


@dataclass(eq=False)
class Watch:
    """A part that is watched; what is known of it, for the page."""

    request: object                 # request.Request, its design a file
    say: object                     # called with lines
    helpers: dict = field(default_factory=lambda: {SOLID: Helper(drawn), BUILD: Helper(finished)})
    lock: object = field(default_factory=threading.Lock)
    known: dict = field(default_factory=lambda: {"save": 0, SOLID: {}, DRAFT: {}, BUILD: {}})
    svg: str = ""
    begun_s: float = 0.0            # when the last save was seen
    folder: Path | None = None      # of the last outputs

    def run(self, is_wanted=lambda: True):
        """Until it is not wanted any more, or Ctrl-C is pressed."""
        part, before = Path(str(self.request.design)), None
        try:
            while is_wanted():
                if (now := files_beside(part)) != before:
                    before = now
                    self._saved()
                self._heard()
                interruption.stop_if_asked()
        finally:
            for helper in self.helpers.values():
                helper.end()

    def _saved(self):
        with self.lock:
            self.known = {"save": self.known["save"] + 1, SOLID: {"state": "busy"}, DRAFT: {}, BUILD: {"state": "busy"}}
        self.begun_s = time.monotonic()
        for helper in self.helpers.values():
            helper.give(self.known["save"], self.request)

    def _heard(self):
        """Take in what the processes say."""
        busy = {helper.pipe: name for name, helper in self.helpers.items() if helper.is_busy}
        if not busy:
            time.sleep(LOOK_S)
        for pipe in connection.wait(list(busy), LOOK_S):
            name = busy[pipe]
            try:
                number, what, told = pipe.recv()
            except (EOFError, OSError):
                self.helpers[name].end()
                number, what, told = self.known["save"], "wrong", "its process was ended, by signal or for want of memory"
            if number == self.known["save"]:
                self._take(name, what, told)

    def _take(self, name, what, told):
        """What a process says of the last save."""
        took_s = round(time.monotonic() - self.begun_s, 1)
        self.helpers[name].is_heard = True
        if what == "stage":
            with self.lock:
                self.known[name] = {"state": "busy", "words": told}
            return
        if what == DRAFT:
            name, what = DRAFT, "done"
        else:
            self.helpers[name].is_busy = False
        words = told if what == "wrong" else told["words"]
        self.say(f"{name}, {took_s} s: {words}")
        with self.lock:
            self.known[name] = {"state": what, "words": words, "took_s": took_s}
            if what == "done":
                self.svg = told.get("svg", self.svg)
                self.folder = Path(told["folder"]) if "folder" in told else self.folder

    def answer(self, path):
        """(type, bytes) of what the page asks for; None: there is no such thing."""
        with self.lock:
            known, svg, folder = dict(self.known), self.svg, self.folder
        if path == "/":
            return "text/html", PAGE.read_bytes()
        if path == "/state":
            is_reported = folder is not None and (folder / "report.html").is_file()
            return "application/json", dumps({**known, "has_report": is_reported}).encode()
        if path == "/solid.svg":
            return TYPES[".svg"], svg.encode()
        name = path.removeprefix("/out/")
        if folder is None or name != os.path.basename(name) or not (file := folder / name).is_file() or name == path:
            return None
        return TYPES.get(file.suffix, "application/octet-stream"), file.read_bytes()


class _Handler(BaseHTTPRequestHandler):
    """Answers of a Watch to a browser on this machine."""

    def __init__(self, watch, *arguments):
        self.watch = watch
        super().__init__(*arguments)

    def do_GET(self):
        host = self.headers.get("Host", "").partition(":")[0]
        found = self.watch.answer(self.path.partition("?")[0]) if host in (HOST, "localhost") else None
        if found is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        kind, content = found
        self.send_response(HTTPStatus.OK)
        for name, value in (("Content-Type", f"{kind}; charset=utf-8"), ("Content-Length", str(len(content))),
                            ("Cache-Control", "no-store")):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_):
        """Nothing."""


def served(watch, port):
    """A server of a Watch, running; 0: any free port.

    Raises:
        InputError: the port is taken.
    """
    try:
        server = ThreadingHTTPServer((HOST, port), partial(_Handler, watch))
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"--port {port}: {why}; choose another one, or 0 for any that is free") from None
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def watched(request, port, say):
    """Watch a part until Ctrl-C.

    Raises:
        InputError: it is no file, or the port is taken.
    """
    part = Path(str(request.design))
    if not part.is_file():
        raise InputError(f"{part} is no file: a part is watched by its .py or .toml file")
    out = Path(request.out) if request.out is not None else Path("outputs") / part.stem
    watch = Watch(request=replace(request, out=out), say=say)
    server = served(watch, port)
    say(f"{part} is watched: http://{HOST}:{server.server_address[1]}/ shows it; Ctrl-C ends that")
    try:
        watch.run()
    finally:
        server.shutdown()
        server.server_close()
        shutil.rmtree(out.parent / f".{out.name}.part", ignore_errors=True)     # of a build that was ended
