"""`cuspline sweep`: the same table whoever builds the variants, nothing built twice, nothing lost."""

import csv
import json
import os
import pickle
import signal
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Callable

import pytest
from built_parts import ran
from sweep_stubs import StubRequest

from cuspline.app import sweep, sweep_page, sweep_workers
from cuspline.app.request import Request
from cuspline.app.sweep import Variant, grid
from cuspline.app.sweep_run import Sweep
from cuspline.values.errors import InputError

TROUGH = Path(__file__).parents[2] / "pipeline/app/repository/trough.py"
AXES = ("a=1:3:3", "b=2,4")


def stub_variants(out, **given):
    """The grid of AXES, built by the stub."""
    made = []
    for number, values in enumerate(grid(AXES)):
        name = sweep.folder_name(values)
        request = StubRequest(parameters=tuple(f"{n}={v}" for n, v in values), out=out / "variants" / name, **given)
        made.append(Variant(number=number, values=values, request=request, inputs_sha256="x",
                            row_file=out / "rows" / f"{name}.json"))
    return made


def table_of(variants, rows):
    """CSV of rows that came in any order."""
    rows = {v.number: row for v, row in rows}
    return sweep.csv_text([rows[v.number] for v in variants])


@pytest.fixture(scope="module")
def one_by_one(tmp_path_factory):
    """The table that this process comes to alone."""
    variants = stub_variants(tmp_path_factory.mktemp("alone"))
    return table_of(variants, [(v, sweep.built(v)) for v in variants])


# the grid --------------------------------------------------------------------------------------


def test_the_grid_is_every_combination_the_last_axis_first():
    assert grid(AXES) == [(("a", a), ("b", b)) for a in "123" for b in "24"]
    assert grid(()) == [()]


def test_a_sample_is_always_the_same_part_of_the_grid_in_its_order():
    whole, some = grid(["a=1:9:9", "b=1:9:9"]), grid(["a=1:9:9", "b=1:9:9"], 10)
    assert some == grid(["a=1:9:9", "b=1:9:9"], 10) and len(set(some)) == 10
    assert [v for v in whole if v in some] == some and grid(AXES, 99) == grid(AXES)
    assert len(grid(["a=1:9:100000", "b=1:9:100000", "c=1:9:100000"], 3)) == 3       # never laid out whole


@pytest.mark.parametrize("axes, words", [
    (["a"], "not of the form"), (["a="], "not of the form"), (["a=1,,2"], "empty or stands twice"), (["a=1,1"], "stands twice"),
    (["a=x:2:3"], "must be numbers"), (["a=1:2"], "a range is name=from:to:count"),
    (["a=1:5:2.5"], "a range is name=from:to:count"), (["a=1:2:1"], "a count of 2 to"), (["a=1:1:3"], "ends that differ"),
    (["a=1", "a=2"], "given twice"), (["a=1:2:1000", "b=1:2:1000"], "1,000,000 variants: at most 100,000")])
def test_axes_that_cannot_be_meant_are_refused(axes, words):
    with pytest.raises(InputError, match=words):
        grid(axes)


# building --------------------------------------------------------------------------------------


def test_two_processes_one_of_them_killed_come_to_the_same_table_byte_for_byte(one_by_one, tmp_path):
    fatal = tmp_path / "fatal"
    fatal.mkdir()
    (fatal / "once").touch()
    variants = stub_variants(tmp_path / "sweep", deadly=("a", "2", str(fatal)))
    rows = list(sweep_workers.in_processes(variants, 2, 1))
    assert list(fatal.iterdir()) == []                  # it was killed
    assert table_of(variants, rows) == one_by_one
    assert [v.row() is not None for v in variants] == [True] * 6


def test_a_process_that_is_killed_from_outside_while_it_waits_or_works_is_replaced(one_by_one, tmp_path):
    variants, pool, rows = stub_variants(tmp_path), sweep_workers._Pool(threads=1, needs="sweep_stubs"), []
    try:
        pool.begin()
        for variant, row in pool.run(list(variants)):
            rows.append((variant, row))
            if len(rows) in (2, 4):
                process, = pool.workers.values()
                os.kill(process.pid, signal.SIGKILL)
                process.join()
    finally:
        pool.end()
    assert table_of(variants, rows) == one_by_one


def test_processes_that_die_before_they_begin_cost_no_variant_a_try(one_by_one, tmp_path):
    variants, pool = stub_variants(tmp_path), sweep_workers._Pool(threads=1, needs="sweep_stubs")
    try:
        pool.begin()
        for _ in range(sweep_workers.TRIES + 1):
            (beginning, process), = pool.workers.items()
            process.kill()
            process.join()
            while beginning.poll():             # it may have been quick
                try:
                    beginning.recv()
                except EOFError:
                    break
            pool._begun(beginning)
        assert table_of(variants, list(pool.run(list(variants)))) == one_by_one and pool.tries == {}
    finally:
        pool.end()


def test_a_sweep_whose_processes_cannot_begin_says_so(tmp_path):
    with pytest.MonkeyPatch.context() as change:
        change.setattr(sweep_workers, "STILLBORN", 2)
        pool = sweep_workers._Pool(threads=1, needs="no_such_module_of_a_sweep")
        pool.begin()
        with pytest.raises(InputError, match="2 processes of the sweep have ended one after the other"):
            list(pool.run(stub_variants(tmp_path)))
        pool.end()


def test_a_variant_that_kills_every_process_is_a_fault_and_the_others_are_built(one_by_one, tmp_path):
    fatal = tmp_path / "fatal"
    fatal.mkdir()
    for k in range(sweep_workers.TRIES):
        (fatal / str(k)).touch()
    variants = stub_variants(tmp_path / "sweep", deadly=("a", "2", str(fatal)))[1:3]        # of these one has a = 2
    rows = dict((v.number, row) for v, row in sweep_workers.in_processes(variants, 1, 1))
    assert rows[1]["verdict"] == sweep.VERIFIED
    assert (rows[2]["verdict"], rows[2]["why"]) == (sweep.FAULT, "its process was ended 3 times, by signal or for want of memory")
    assert variants[1].row() is None                    # tried again by the next sweep


def test_rows_stand_until_their_inputs_change_or_their_outputs_are_gone(tmp_path):
    variant = stub_variants(tmp_path)[0]
    assert variant.row() is None
    row = sweep.built(variant)
    assert variant.row() == row and replace(variant, inputs_sha256="y").row() is None
    (tmp_path / row["folder"] / "manifest.json").unlink()
    assert variant.row() is None
    variant.row_file.write_text('{"inputs_')
    assert variant.row() is None


def test_a_rejected_variant_leaves_no_verified_one_of_other_inputs_beside_it(tmp_path):
    variant = stub_variants(tmp_path)[3]
    variant.request.out.mkdir(parents=True)
    assert sweep.built(variant)["folder"].endswith("-rejected") and not variant.request.out.exists()


def test_an_interrupted_sweep_leaves_nothing_half_written_and_keeps_what_stands(tmp_path, monkeypatch):
    def stopped(self, missing, workers, scheduler):
        yield missing[0], sweep.built(missing[0])
        (self.out / "variants/.b.part").mkdir()
        (self.out / "rows/b.77.part").touch()
        raise KeyboardInterrupt
    monkeypatch.setattr(Sweep, "_built", stopped)
    monkeypatch.setattr(Sweep, "_checked", lambda self: stub_variants(tmp_path))
    with pytest.raises(KeyboardInterrupt):
        Sweep(request=None, texts=(), sample=None, out=tmp_path).run(None, None, print)
    assert sorted(p.name for p in (*tmp_path.glob("variants/*"), *tmp_path.glob("rows/*"))) == ["a=1+b=2", "a=1+b=2.json"]
    assert stub_variants(tmp_path)[0].row() is not None


# tables and page -------------------------------------------------------------------------------


def test_the_table_holds_figures_by_where_they_stand_and_says_what_failed(one_by_one):
    rows = list(csv.DictReader(one_by_one.splitlines()))
    assert [(r["a"], r["b"]) for r in rows] == [(a, b) for a in "123" for b in "24"]
    assert [r["verdict"] for r in rows] == ["verified", "verified", "verified", "rejected", "refused", "refused"]
    assert rows[0]["plan.setups.setup-1.operations.finish.stepover_mm"] == repr(1 / 3) and rows[4]["why"] == "a cannot be 3"
    assert (rows[1]["verify.cusp_max_mm"], rows[1]["plan.time_s"], rows[1]["verify.findings"]) == ("0.004", "60.0", "0")
    assert not any("candidates" in name for name in rows[0])


def test_parquet_holds_the_same_numbers_where_pyarrow_is_installed(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = [sweep.built(v) for v in stub_variants(tmp_path)]
    sweep.write_parquet(rows, tmp_path / "sweep.parquet")
    there = parquet.read_table(tmp_path / "sweep.parquet").to_pydict()
    assert there["a"] == [1, 1, 2, 2, 3, 3] and there["verify.cusp_max_mm"][:2] == [0.002, 0.004]
    assert there["verify.ok"] == [True, True, True, False, None, None]


def test_the_front_is_what_nothing_beats_in_both(one_by_one):
    points = [(5, 1), (1, 5), (3, 3), (3, 2), (4, 2), (2, 5)]
    beaten = [any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points) for p in points]
    assert sorted(sweep_page.front(points)) == [k for k, is_beaten in enumerate(beaten) if not is_beaten]


def test_the_page_shows_every_variant_with_its_picture_and_what_it_came_to(tmp_path):
    rows = [sweep.built(v) for v in stub_variants(tmp_path)]
    (tmp_path / rows[0]["folder"] / "iso.png").write_bytes(b"png")
    text = sweep_page.page("a <sweep>", rows, tmp_path)
    assert "a &lt;sweep&gt;" in text and "6 variants: 2 refused, 1 rejected, 3 verified." in text
    assert text.count("<article>") == 6 and text.count("<img") == 1 and text.count("<circle") == 3
    assert "No variant was verified" in sweep_page.pareto(rows[4:])


# the command -----------------------------------------------------------------------------------


def test_a_sweep_of_a_part_is_taken_up_where_it_was_and_built_anew_when_the_part_changes(tmp_path, monkeypatch):
    """In this process, which has imported CAD already; what goes to another one goes there and back."""
    there_and_back = lambda value: pickle.loads(pickle.dumps(value))
    monkeypatch.setattr(sweep_workers, "in_processes", lambda variants, count, threads: (
        (v, there_and_back(sweep.built(there_and_back(v)))) for v in variants))
    part = tmp_path / "parts/trough.py"
    part.parent.mkdir()
    part.write_text(TROUGH.read_text())
    sweeps = lambda *axes: ran("sweep", "--stage", "step", part, "--workers", 1, "--out", tmp_path / "sweep", *axes)
    done = sweeps("-p", "depth_mm=1:2:2")
    assert done.returncode == 0, done.stderr
    assert [line.split(" ")[0] for line in done.stdout.splitlines()][:2] == ["1/2", "2/2"]
    variants = tmp_path / "sweep/variants"
    assert {p.name for p in variants.iterdir()} == {"depth_mm=1", "depth_mm=2"}
    assert json.loads((variants / "depth_mm=2/manifest.json").read_text())["parameters"]["depth_mm"] == 2.0
    table = (tmp_path / "sweep/sweep.csv").read_bytes()
    again = sweeps("-p", "depth_mm=1:2:2")
    assert again.stdout.startswith("2 variants of 2 stand already\n") and "1/2" not in again.stdout
    assert (tmp_path / "sweep/sweep.csv").read_bytes() == table
    part.write_text(part.read_text() + "# changed\n")
    stands = [v.row() for v in sweep.variants(Request(design=part, stage="step"), ("depth_mm=1:2:2",), None, tmp_path / "sweep")]
    assert stands == [None, None]


@pytest.mark.parametrize("arguments, words", [
    (["-p", "dept_mm=1,2"], "the design has no such parameter; it has length_mm"),
    (["--stag", "plan"], "No such option"), (["--accept", "gauge"], "gouge"), (["-p", "depth_mm"], "not of the form")])
def test_what_is_wrong_is_refused_before_anything_is_built(arguments, words, tmp_path):
    done = ran("sweep", TROUGH, "--out", tmp_path / "sweep", *arguments)
    assert done.returncode == 2 and words in done.stderr and not (tmp_path / "sweep").exists()


def test_a_folder_that_is_no_sweep_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    done = ran("sweep", TROUGH, "-p", "depth_mm=1,2", "--out", tmp_path)
    assert done.returncode == 2 and "no earlier sweep" in done.stderr and os.listdir(tmp_path) == ["mine.txt"]


def test_without_dask_a_scheduler_is_refused_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match="needs dask.distributed: pip install distributed"):
        list(sweep_workers.on_cluster(stub_variants(tmp_path), "tcp://127.0.0.1:1"))


def test_a_cluster_comes_to_the_same_table_one_worker_killed(one_by_one, tmp_path):
    distributed = pytest.importorskip("distributed")
    fatal = tmp_path / "fatal"
    fatal.mkdir()
    (fatal / "once").touch()
    variants = stub_variants(tmp_path / "sweep", deadly=("a", "2", str(fatal)))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        rows = list(sweep_workers.on_cluster(variants, cluster.scheduler_address))
    assert table_of(variants, rows) == one_by_one and list(fatal.iterdir()) == []


class LostScheduler:
    """As dask.distributed looks from a client whose scheduler ends after two variants; bench/sweep_faults.py ends a real one."""

    def __init__(self, address, timeout):
        self.sent = []

    def submit(self, function, variant, **given):
        self.sent.append(Future("finished" if len(self.sent) < 2 else "cancelled", partial(function, variant)))
        return self.sent[-1]

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return False


@dataclass(frozen=True, eq=False)
class Future:
    status: str
    result: Callable


def test_a_scheduler_that_goes_leaves_what_stands_and_a_sentence_and_the_sweep_goes_on(one_by_one, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=LostScheduler, as_completed=iter))
    variants, rows = stub_variants(tmp_path / "sweep"), []
    with pytest.raises(InputError, match="the scheduler has gone; what is built stands: start it again, then the same sweep"):
        for done in sweep_workers.on_cluster(variants, "tcp://127.0.0.1:1"):
            rows.append(done)
    assert [v.row() for v in variants] == [row for _, row in rows] + 4 * [None]
    assert not any(v.row_file.exists() for v in variants[2:])          # no fault is written for what nobody has built
    assert table_of(variants, rows + [(v, sweep.built(v)) for v in variants[2:]]) == one_by_one
