"""`cuspline send`: every byte arrives in order, the control is never overrun, what goes wrong is told with its line."""

import os
import socket
import threading
import time
import tty
from contextlib import suppress

import pytest
from built_parts import ran

from cuspline.app.sending import GRBL_HOLDS_BYTES, VERIFIED, XOFF, XON, sent
from cuspline.values.errors import InputError

TEXT = f"({VERIFIED}, GOUGE 0.0010)\n" + "".join(f"G1 X{k}.25 Y-{k}.5 F1200\n" for k in range(400)) + "M30\n"


def served(control):
    """(address, what it got, thread) of a control on this machine: control(connection, got)."""
    server, got = socket.create_server(("127.0.0.1", 0)), bytearray()

    def run():
        with server, server.accept()[0] as link, suppress(ConnectionError):      # whoever sends may have gone
            control(link, got)
    thread = threading.Thread(target=run)
    thread.start()
    return f"tcp://127.0.0.1:{server.getsockname()[1]}", got, thread


def all_of(link, got):
    while piece := link.recv(4096):
        got += piece


def holding(link, got):
    """A memory of 1000 bytes, emptied in rests; what comes while it holds is counted in `over`."""
    held = 0
    while piece := link.recv(256):
        got += piece
        held += len(piece)
        if held > 1000:
            link.sendall(XOFF)
            time.sleep(0.05)
            held = 0
            link.sendall(b"?" + XON)


def grbl(link, got):
    """Takes a line a moment, answers it; more than its buffer at once is an overrun."""
    held = bytearray()
    link.settimeout(5)
    while True:
        if b"\n" not in held:
            piece = link.recv(4096)
            if not piece:
                return
            held += piece
            got += piece
        assert len(held) <= GRBL_HOLDS_BYTES, len(held)
        line, _, rest = bytes(held).partition(b"\n")
        held = bytearray(rest)
        link.setblocking(False)
        try:
            more = link.recv(4096)
            held += more
            got += more
        except BlockingIOError:
            pass
        link.setblocking(True)
        link.sendall(b"error:20\r\n" if b"X250.25" in line and b"F1200" in line and grbl.refuses else b"ok\r\n")


grbl.refuses = False


@pytest.mark.parametrize("control, handshake", [(all_of, "xon"), (holding, "xon"), (grbl, "ok")])
def test_every_byte_arrives_in_order(control, handshake):
    to, got, thread = served(control)
    assert sent(TEXT, to, handshake=handshake) == TEXT.count("\n")
    thread.join()
    assert got.decode() == TEXT


def test_while_the_control_holds_nothing_is_sent():
    """It holds at once; of what was under way hardly a piece comes, the rest only after it goes on."""
    counts = []

    def control(link, got):
        got += link.recv(10)
        link.sendall(XOFF)
        link.settimeout(0.5)
        with suppress(TimeoutError):            # until half a second brings nothing
            while True:
                got += link.recv(4096)
        counts.append(len(got))
        link.settimeout(None)
        link.sendall(XON)
        all_of(link, got)
    long = TEXT * 40
    to, got, thread = served(control)
    sent(long, to)
    thread.join()
    assert counts[0] < len(long) and got.decode() == long


def gone(link, got, told):
    link.recv(10)


def silent(link, got, told):
    link.recv(10)
    told.wait(60)


def held(link, got, told):
    link.recv(10)
    link.sendall(XOFF)
    told.wait(60)


@pytest.mark.parametrize("control, handshake, words", [
    (gone, "ok", "line 1: the control has hung up"), (silent, "ok", "line 1: the control has not answered for 0.3 s"),
    (held, "xon", "the control has held for 0.3 s")])
def test_a_control_that_is_silent_or_goes_is_told_with_the_line(control, handshake, words):
    told = threading.Event()
    to, _, thread = served(lambda link, got: control(link, got, told))
    try:
        with pytest.raises(InputError, match=words):
            sent(TEXT * 200, to, handshake=handshake, patience_s=0.3)
    finally:
        told.set()
        thread.join()


def test_a_line_that_the_control_refuses_ends_it_with_its_number(monkeypatch):
    monkeypatch.setattr(grbl, "refuses", True)
    to, got, thread = served(grbl)
    with pytest.raises(InputError, match=r"line 252: G1 X250\.25 Y-250\.5 F1200: the control says error:20: nothing more was sent"):
        sent(TEXT, to, handshake="ok")
    thread.join()
    assert len(got) < len(TEXT)


def test_a_serial_line_carries_it_as_it_is():
    there, here = os.openpty()
    tty.setraw(there)
    got = bytearray()

    def control():
        while b"M30\n" not in got:
            got.extend(os.read(there, 4096))
            if len(got) < 300:
                os.write(there, XOFF)
                time.sleep(0.05)
                os.write(there, XON)
    thread = threading.Thread(target=control)
    thread.start()
    sent(TEXT, os.ttyname(here), baud=115200)
    thread.join()
    os.close(there), os.close(here)
    assert got.decode() == TEXT


@pytest.mark.parametrize("arguments, words", [
    (("--to", "tcp://127.0.0.1:1"), "refused: name a control that listens"),
    (("--to", "tcp:127.0.0.1"), "write tcp://host:port"),
    (("--to", "/dev/null"), "it is no serial line"),
    (("--to", "/nowhere"), "No such file"),
    (("--to", "tcp://127.0.0.1:1", "--handshake", "loud"), "it must be xon or ok"),
])
def test_where_nothing_can_be_sent_is_told(arguments, words, tmp_path):
    (tmp_path / "a.ngc").write_text(TEXT)
    done = ran("send", tmp_path / "a.ngc", *arguments)
    assert done.returncode == 2 and words in done.stderr, done.stderr


def test_what_is_not_verified_stays_unless_it_is_said(tmp_path):
    (tmp_path / "a.ngc").write_text(TEXT.replace(VERIFIED, "VERDICT: REJECTED"))
    done = ran("send", tmp_path / "a.ngc", "--to", "tcp://127.0.0.1:1")
    assert done.returncode == 2 and "header does not say VERDICT: VERIFIED" in done.stderr
    to, got, thread = served(all_of)
    done = ran("send", tmp_path / "a.ngc", "--to", to, "--unverified")
    thread.join()
    assert done.returncode == 0 and "a.ngc: 402 lines sent" in done.stdout and got.decode().endswith("M30\n")
