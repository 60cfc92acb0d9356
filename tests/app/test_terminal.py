"""What a terminal shows while a command works, and what a log keeps of it."""

import io

import pytest

from cuspline.app.terminal import ERASE, Stages
from cuspline.values import interruption, progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    s = 0.0

    def __call__(self):
        return self.s


def stages(stream, monkeypatch, loop_begun_s=10.0):
    """Stages by a clock of their own, beside a loop of eight rows that has begun by it."""
    clock = Clock()
    clock.s = loop_begun_s
    monkeypatch.setattr(progress.time, "monotonic", clock)
    progress.begin(8)
    clock.s = 0.0
    return Stages(stream, clock), clock


def test_elsewhere_a_stage_is_a_line_as_it_begins(monkeypatch):
    log = io.StringIO()
    told, clock = stages(log, monkeypatch)
    with told:
        told.show("z_profile: reading")
        told.say("z_profile: STEP")
        clock.s = 30.0
        told.say("z_profile: plan")
    assert log.getvalue() == "  z_profile: STEP\n  z_profile: plan\n"


def test_on_a_terminal_a_stage_keeps_the_time_that_it_took(monkeypatch):
    screen = Terminal()
    told, clock = stages(screen, monkeypatch)
    told.show("reading")
    told.say("STEP")
    clock.s = 1.9
    told.say("plan")
    clock.s = 31.9
    told.__exit__()
    assert screen.getvalue() == f"{ERASE}  STEP{ERASE}  STEP\n  plan{ERASE}  plan  30 s\n"


def test_the_running_stage_shows_share_and_time_left_of_its_loop(monkeypatch):
    told, clock = stages(Terminal(), monkeypatch)
    told.say("plan")
    clock.s = 20.0
    assert told.line() == "  plan  20 s"                        # nothing of the loop is done yet
    progress.advance(2)
    assert told.line() == "  plan  20 s, 25% of this step, 30 s left"       # ten seconds for a quarter
    progress.advance(6)
    assert told.line() == "  plan  20 s"


def test_a_loop_that_is_older_than_the_stage_is_not_its_loop(monkeypatch):
    told, clock = stages(Terminal(), monkeypatch)
    progress.advance(2)
    clock.s = 15.0
    told.say("plan")
    clock.s = 18.0
    assert told.line() == "  plan  3 s"


def test_the_line_is_written_anew_while_a_stage_runs(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr("cuspline.app.terminal.EVERY_S", 0.001)
    with Stages(screen) as told:
        told.say("plan")
        while screen.getvalue().count(f"{ERASE}  plan") < 3:
            pass


def test_a_stage_does_not_begin_after_ctrl_c(monkeypatch):
    monkeypatch.setattr(interruption._Asked, "is_asked", True)
    with pytest.raises(KeyboardInterrupt):
        Stages(io.StringIO()).say("plan")
