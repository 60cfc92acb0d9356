"""The store of answers: the same bits with and without it, nothing asked twice, nothing damaged believed."""

import json
import sys

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, raster, tool

from cuspline.app import catalogue, cli
from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.kernel.solids import stl_of
from cuspline.replay import replay as replaying
from cuspline.replay.scene import FoundStock
from cuspline.stock import swept
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.gouge import move_depths
from cuspline.values import checkpoints
from cuspline.values.checkpoints import NOTHING, Kept, kept_beside, told
from cuspline.verification import certificate, in_process, residuals, verdict
from cuspline.verification.verdict import Judging, Options, SetupProgram, Verdict, verify_setups

BLOCK = brep.the_solid(cq.Workplane().box(20, 16, 10, centered=False))
STOCK = StockBox(min_mm=(0, 0, -2), max_mm=(20, 16, 12))
TOOLS = {1: tool("ball", 10.0)}
COARSE = Options(spacing_mm=3.0, solid_pitch_mm=0.5, replay_pitch_mm=2.0, tessellation_mm=0.002)
SETUPS = (Setup(name="setup-1", wcs_in_words="", faces=("top",)),
          Setup(name="setup-2", wcs_in_words="", faces=("bottom",), wcs_origin_mm=(0, 16, 0), wcs_z=(0, 0, -1)))


def programs():
    """The block's top cut from above in two operations, then its bottom."""
    made = []
    for setup, height, up in zip(SETUPS, (10.0, 0.0), (1, -1)):
        moves = [rapid(-6, -0.3, 14), *raster((-6, 26), np.arange(-0.3, 17.7, 2.0), height), rapid(26, 16, 14)]
        half = (np.arange(len(moves)) > len(moves) // 2).astype(int)
        made.append(SetupProgram(
            posted=program((-6, -0.3, 40), moves, operation=half, operations=("rough", "finish")), setup=setup,
            faces=tuple(f for f in brep.faces_of(BLOCK) if up * f.middle.normal[0, 2] > 0.5)))
    return tuple(made)


def outcome(store):
    """All that comes of a judgement: the verdict's numbers, deviations, and the files of stock."""
    cut = programs()
    finish = Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003)
    found = verify_setups(cut, BLOCK, Judging(tools=TOOLS, stock=STOCK, ball_radius_mm=3.0, options=COARSE, kept=store,
                                              finish=finish))
    states = in_process.stock_states(cut, TOOLS, STOCK, [0.5, 0.5], store)
    return (json.dumps(Verdict(setups=found).as_dict()), *(v.residuals.deviation_mm.tobytes() for v in found),
            *(stl_of(s.solid) for s in states))


@pytest.fixture
def asked(monkeypatch):
    """Names of the long questions that were not answered out of a store."""
    names = []
    for source, name, modules in ((swept, "deviations_and_moves", [residuals]), (replaying, "_history", [replaying]),
                                  (swept, "stock_height_mm", [verdict, in_process]),
                                  (move_depths, "move_depths", [certificate])):
        real = getattr(source, name)

        def counted(*arguments, name=name, real=real):
            names.append(name)
            return real(*arguments)

        counted.__qualname__, counted.__module__ = name, source.__name__
        for module in modules:
            monkeypatch.setattr(module, name, counted)
    return names


def test_answers_are_the_same_bits_with_and_without_a_store_and_asked_once(tmp_path, asked):
    without = outcome(NOTHING)
    count = len(asked)
    store = Kept(tmp_path / "kept")
    asked.clear()
    assert outcome(store) == without and 10 < len(asked) <= count     # what is asked twice in one run is kept there, too
    asked.clear()
    assert outcome(store) == without and asked == []


def test_a_run_that_was_broken_off_goes_on_where_it_stopped(tmp_path, asked, monkeypatch):
    store, whole = Kept(tmp_path / "kept"), outcome(Kept(tmp_path / "other"))
    total = len(asked)
    asked.clear()

    class Killed(BaseException):
        pass

    write = Kept._write

    def killed_after_six(self, key, answer):
        write(self, key, answer)
        if len(asked) == 6:
            raise Killed

    monkeypatch.setattr(Kept, "_write", killed_after_six)
    with pytest.raises(Killed):
        outcome(store)
    monkeypatch.setattr(Kept, "_write", write)
    asked.clear()
    assert outcome(store) == whole and len(asked) == total - 6


def test_damaged_answers_are_made_anew_and_another_move_or_tool_is_asked_anew(tmp_path, asked):
    """Replay and certificate of one program; then with one file after the other spoilt, another end, another tool."""
    store, part = Kept(tmp_path / "kept"), ExactPart.of_solid(certificate.solid_in_wcs(BLOCK, SETUPS[0].frame))

    def both(kept, end=(26, 3, 9), tools=TOOLS):
        posted = program((-6, 2, 40), [rapid(-6, 2, 9.5), feed(*end), rapid(26, 16, 14)])
        history = replaying.replay(posted, tools, FoundStock(min_mm=STOCK.min_mm, max_mm=STOCK.max_mm, pitch_mm=1.0), kept=kept)
        proven = certificate.certify(posted, tools, part, tolerance_mm=0.001, kept=kept)
        heights = (getattr(history, name).tobytes() for name in ("event_row", "event_z_mm", "final_z_mm"))
        return (*heights, history.findings, history.holder_clearance_mm, proven.bound_mm.tobytes(),
                proven.place_mm.tobytes())

    want = both(store)
    assert asked == ["_history", "move_depths"] and both(store) == want == both(NOTHING)
    for path in files(store):
        path.write_bytes(path.read_bytes()[:-1] + b"?")
        asked.clear()
        assert both(store) == want and len(asked) == 1
    for change in ({"end": (26, 3, 9 + 1e-12)}, {"tools": {1: tool("ball", 10.5)}}):
        asked.clear()
        assert both(store, **change) == both(NOTHING, **change) and len(asked) == 4


def square(values):
    """Something to keep."""
    square.calls += 1
    return values ** 2, values.astype(np.int64)


@pytest.fixture
def store(tmp_path):
    square.calls = 0
    return Kept(tmp_path / "kept")


def files(store):
    return sorted(store.folder.iterdir())


@pytest.mark.parametrize("spoil", [
    lambda p: p.write_bytes(b""), lambda p: p.write_bytes(p.read_bytes()[:-40]), lambda p: p.write_bytes(b"x" * 500),
    lambda p: p.write_bytes(p.read_bytes()[:200] + b"\xff" + p.read_bytes()[201:])], ids=["empty", "short", "other", "one byte"])
def test_a_damaged_file_is_made_anew(store, spoil):
    values = np.linspace(0, 1, 50)
    want = store.of(square)(values)
    (path,) = files(store)
    spoil(path)
    have = store.of(square)(values)
    assert square.calls == 2 and all((a == b).all() and a.dtype == b.dtype for a, b in zip(have, want))
    assert store.of(square)(values) is not None and square.calls == 2


def test_a_file_under_another_questions_name_is_no_answer(store):
    one, other = np.linspace(0, 1, 5), np.linspace(0, 2, 5)
    store.of(square)(one)
    (path,) = files(store)
    content = path.read_bytes()
    path.unlink()
    store.of(square)(other)
    (path,) = files(store)
    path.write_bytes(content)
    assert (store.of(square)(other)[0] == other ** 2).all() and square.calls == 3


def test_the_folder_stays_below_its_size_and_the_newest_answers_stay(store):
    small = Kept(store.folder, largest_bytes=5000)
    for k in range(12):
        small.of(square)(np.full(100, float(k)))
    assert sum(p.stat().st_size for p in files(small)) <= 5000 and 0 < len(files(small)) < 12
    small.of(square)(np.full(100, 11.0))
    assert square.calls == 12


def test_a_folder_that_cannot_be_written_keeps_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    square.calls = 0
    for _ in range(2):
        assert Kept(tmp_path / "file" / "kept").of(square)(np.ones(3))[0].sum() == 3
    assert square.calls == 2


def test_the_key_tells_every_bit_type_and_border_apart():
    path = swept.swept_paths(program((0, 0, 5), [feed(5, 0, 1), feed(9, 3, 1)]), TOOLS)
    longer = swept.swept_paths(program((0, 0, 5), [feed(5, 0, 1), feed(9, 3 + 1e-15 * 4, 1)]), TOOLS)
    values = [1.0, np.nextafter(1.0, 2), 1, True, "1", None, (1.0,), ((1.0,),), ("ab", "c"), ("a", "bc"), np.ones(2),
              np.ones((1, 2)),
              np.ones(2, np.int64), path, longer, TOOLS[1], tool("ball", 10.5), SETUPS[0].frame, SETUPS[1].frame]
    assert len({told(v).hexdigest() for v in values}) == len(values)
    with pytest.raises(TypeError, match="object"):
        told(object())


def test_other_code_answers_anew(store, monkeypatch):
    store.of(square)(np.ones(3))
    monkeypatch.setattr(checkpoints, "code_sha256", lambda: "another version")
    store.of(square)(np.ones(3))
    assert square.calls == 2


def test_verify_uses_the_store_beside_the_folder_and_clears_it_when_it_is_done(tmp_path, monkeypatch):
    folder, seen = tmp_path / "out", []
    folder.mkdir()

    class Job:
        design, accepted, step, posted, machine = "part", (), "part.step", (), catalogue.find_machine("mill_3axis")

        @classmethod
        def model_copy(cls, update):
            return cls

    class Judged:
        figures_in_words = ""

        def refused(self, accepted):
            return ()

        def passed_over(self, accepted):
            return ()

    def judge(folder, job, say, kept, published):
        kept.of(square)(np.ones(3))
        seen.append(files(kept))
        return Judged()

    square.calls = 0
    monkeypatch.setattr("cuspline.app.judge.judge", judge)
    monkeypatch.setattr("cuspline.design.job.read_job", lambda folder: Job)
    monkeypatch.setattr("cuspline.kernel.brep.refuse_unreadable", lambda path: None)
    monkeypatch.setattr(sys, "argv", ["cuspline", "verify", str(folder)])
    with pytest.raises(SystemExit):
        cli.main()
    assert len(seen[0]) == 1 and seen[0][0].parent == kept_beside(folder).folder == tmp_path / ".out.kept"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
