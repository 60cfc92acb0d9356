"""`cuspline watch`: every save is answered, a build that it outdates is ended, the page sees what is published and nothing else."""

import json
import threading
import time
import urllib.error
import urllib.request
from types import SimpleNamespace

import numpy as np
import pytest
from built_parts import ran
from sweep_stubs import stub_build, stub_solid

from cuspline.app.watch import BUILD, SOLID, Helper, Watch, edges_svg, files_beside, served


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """A part that is watched with stubs in place of CAD and builds: its file, the Watch, the address of its page."""
    part = tmp_path_factory.mktemp("watch") / "part.py"
    part.write_text("slow")
    watch = Watch(request=SimpleNamespace(design=part), say=lambda text: None,
                  helpers={SOLID: Helper(stub_solid), BUILD: Helper(stub_build)})
    goes_on = threading.Event()
    server = served(watch, 0)
    thread = threading.Thread(target=watch.run, args=(lambda: not goes_on.is_set(),))
    thread.start()
    yield part, watch, f"http://127.0.0.1:{server.server_address[1]}"
    goes_on.set()
    thread.join()
    server.shutdown()
    server.server_close()
    assert all(helper.process is None for helper in watch.helpers.values())


def get(address, host=None):
    with urllib.request.urlopen(urllib.request.Request(address, headers={"Host": host} if host else {}), timeout=60) as answer:
        return answer.read().decode()


def state_when(address, is_wanted):
    """The state that the page sees, once it is as wanted."""
    until = time.monotonic() + 120
    while time.monotonic() < until:
        state = json.loads(get(f"{address}/state"))
        if is_wanted(state):
            return state
        time.sleep(0.05)
    raise AssertionError(state)


def save(part, text):
    """In one step, as editors save: a file that is emptied first and then written counts as two."""
    beside = part.with_suffix(".new")
    beside.write_text(text)
    beside.replace(part)


def test_a_save_outdates_the_build_that_runs_and_the_solid_does_not_wait_for_it(watched):
    part, watch, address = watched
    state_when(address, lambda s: s["solid"].get("words") == "slow" and s["build"].get("words") == "plan setup-1")
    first = watch.helpers[BUILD].process.pid
    save(part, "still slow")
    state = state_when(address, lambda s: s["solid"].get("words") == "still slow")
    assert state["build"]["state"] == "busy" and not state["has_report"]
    state_when(address, lambda s: s["save"] == 2 and s["build"].get("words") == "plan setup-1")
    assert watch.helpers[BUILD].process.pid != first
    save(part, "quick one")
    state = state_when(address, lambda s: s["build"]["state"] == "done")
    assert (state["save"], state["build"]["words"], state["has_report"]) == (3, "VERIFIED quick one", True)
    assert (state["draft"]["state"], state["draft"]["words"]) == ("done", "draft of quick one")
    assert get(f"{address}/out/report.html") == "<p>quick one" and get(f"{address}/solid.svg") == "<svg>quick one</svg>"


def test_what_is_wrong_and_what_dies_is_said_and_the_next_save_is_built(watched):
    part, _, address = watched
    save(part, "quick wrong")
    assert state_when(address, lambda s: s["solid"].get("state") == "wrong")["solid"]["words"] == "part.py cannot be loaded"
    save(part, "crash")
    state = state_when(address, lambda s: s["solid"].get("words") == "crash" and s["build"]["state"] == "wrong")
    assert state["build"]["words"] == "its process was ended, by signal or for want of memory"
    save(part, "quick again")
    assert state_when(address, lambda s: s["build"]["state"] == "done")["build"]["words"] == "VERIFIED quick again"


@pytest.mark.parametrize("path", ["/out/../part.py", "/out/%2e%2e/part.py", "/part.py", "/out/", "/out/none.html"])
def test_nothing_but_the_outputs_is_served(path, watched):
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(watched[2] + path)


def test_the_page_answers_to_this_machine_alone(watched):
    assert "cuspline watch" in get(f"{watched[2]}/") and get(f"{watched[2]}/state", host="localhost:1")
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(f"{watched[2]}/state", host="elsewhere.example")


def test_files_that_a_part_may_be_made_of_are_watched_and_others_not(tmp_path):
    for name in ("part.py", "cells.csv", "notes.txt"):
        (tmp_path / name).write_text("")
    assert {p.name for p in files_beside(tmp_path / "part.py")} == {"part.py", "cells.csv"}


def test_edges_are_drawn_in_true_proportion_upright_up():
    """A cube seen along its diagonal: all edges equally long."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    edges = [np.stack([a, b]) for k, a in enumerate(corners) for b in corners[k + 1:] if np.abs(a - b).sum() == 1]
    text = edges_svg(edges)
    drawn = [np.array([p.split(",") for p in part.split('"')[0].split(" ")], float) for part in text.split('points="')[1:]]
    lengths = [np.linalg.norm(line[1] - line[0]) for line in drawn]
    assert len(drawn) == 12 and max(lengths) - min(lengths) < 0.2
    assert len({tuple(p) for line in drawn for p in line.round(0)}) == 7       # of eight corners, two stand behind each other
    upright = [line for edge, line in zip(edges, drawn) if edge[0][2] != edge[1][2]]
    assert all(abs(line[1][0] - line[0][0]) < 0.11 and line[1][1] < line[0][1] for line in upright)


def test_what_cannot_be_watched_is_refused(tmp_path):
    done = ran("watch", tmp_path / "none.py")
    assert done.returncode == 2 and "is no file: a part is watched by its .py or .toml file" in done.stderr
