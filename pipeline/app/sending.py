"""A program sent to a control that runs it while it comes: over a serial line or a socket, held by XOFF and XON or by "ok".

    here    G1 X1     G1 X2     G1 X3           G1 X4
    control                 XOFF .......... XON                     its memory is full, then has room again
    control ok        ok        ok              ok                  Grbl: one a line; here no more waits there than it holds
"""

import os
import re
import select
import socket
import termios
import time
from collections import deque
from contextlib import closing, contextmanager, suppress

from cuspline.values import interruption
from cuspline.values.amounts import counted
from cuspline.values.errors import InputError

XON, XOFF = b"\x11", b"\x13"
TCP = re.compile(r"tcp://([^:/]+|\[[0-9a-fA-F:]+\]):(\d{1,5})")
VERIFIED = "VERDICT: VERIFIED"
GRBL_HOLDS_BYTES = 127          # of its serial buffer of 128 bytes, which must never be full (Grbl's interface documentation)
PIECE_BYTES = 64                # at once, so that XOFF is heard in time
LOOK_S = 0.2
LINGER_S = 2.0                  # that the other side may be silent before the socket is closed


def sent(text, to, *, baud=9600, handshake="xon", patience_s=60.0, say=lambda text: None):
    """Send a program.

    Args:
        text: of the program, ASCII.
        to: "tcp://host:port", or the path of a serial device.
        baud: of a serial device; 8 bits, no parity, 1 stop bit.
        handshake: "xon": the control holds with XOFF and goes on with XON; "ok": it answers every line, as Grbl does.
        patience_s: how long the control may hold, or owe an answer.
        say: called with how far it is.
    Returns:
        lines that were sent.
    Raises:
        InputError: nobody is there, the control hangs up, refuses a line or stays silent; the line is named.
    """
    lines = [line + "\n" for line in text.removesuffix("\n").split("\n")]
    with _opened(to, baud) as line:
        (_send_answered if handshake == "ok" else _send_held)(lines, line, patience_s, say)
    return len(lines)


def refuse_unverified(text, name):
    """Only what was verified leaves, unless whoever sends it says otherwise.

    Raises:
        InputError: the header does not say so.
    """
    if VERIFIED not in text:
        raise InputError(f"{name}: its header does not say {VERIFIED}: build or verify it first, or send it with --unverified")


@contextmanager
def _opened(to, baud):
    """A _Line."""
    found = TCP.fullmatch(to)
    try:
        if found:
            with closing(socket.create_connection((found[1].strip("[]"), int(found[2])), timeout=10.0)) as link:
                link.settimeout(None)
                yield _Line(link.fileno(), link.recv, link.sendall)
                _taken(link)
            return
        if to.startswith("tcp:"):
            raise InputError(f"--to {to}: write tcp://host:port")
        device = os.open(to, os.O_RDWR | os.O_NOCTTY)
    except (OSError, OverflowError) as error:
        raise InputError(f"--to {to}: {getattr(error, 'strerror', None) or error}: name a control that listens") from None
    try:
        _raw(device, baud, to)
        yield _Line(device, lambda most: os.read(device, most), lambda piece: _written(device, piece))
        termios.tcdrain(device)
    finally:
        os.close(device)


def _taken(link):
    """Let the other side take what is under way: to close on words of its own that nobody read would throw that away."""
    link.settimeout(LINGER_S)
    with suppress(OSError):
        link.shutdown(socket.SHUT_WR)
        while link.recv(1024):
            pass


def _raw(device, baud, to):
    """A serial device that passes bytes on as they are: what XON and XOFF mean is ours to say."""
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise InputError(f"--baud {baud}: no serial line runs at that; 9600, 19200, 38400 and 115200 are usual")
    try:
        settings = termios.tcgetattr(device)
    except termios.error:
        raise InputError(f"--to {to}: it is no serial line: name its device, as /dev/ttyUSB0, or tcp://host:port") from None
    settings[0], settings[1], settings[3] = 0, 0, 0
    settings[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    settings[4] = settings[5] = speed
    settings[6][termios.VMIN], settings[6][termios.VTIME] = 1, 0
    termios.tcsetattr(device, termios.TCSANOW, settings)


def _written(device, piece):
    while piece:
        piece = piece[os.write(device, piece):]


class _Line:
    """Bytes there and back."""

    def __init__(self, number, read, write):
        self.number, self.read, self.write = number, read, write

    def heard(self, wait_s):
        """What the control has said meanwhile; b"" nothing.

        Raises:
            ConnectionError: it has hung up.
        """
        interruption.stop_if_asked()
        ready, _, _ = select.select([self.number], [], [], wait_s)
        if not ready:
            return b""
        told = self.read(1024)
        if not told:
            raise ConnectionError
        return told


def _send_held(lines, line, patience_s, say):
    """All lines; none while XOFF is in force."""
    is_held, since = False, time.monotonic()
    for number, text in enumerate(lines, 1):
        piece = text.encode("ascii")
        try:
            while piece:
                told = line.heard(LOOK_S if is_held else 0.0)
                for byte in (bytes([b]) for b in told):
                    if byte in (XON, XOFF) and is_held != (byte == XOFF):
                        is_held, since = byte == XOFF, time.monotonic()
                if not is_held:
                    line.write(piece[:PIECE_BYTES])
                    piece = piece[PIECE_BYTES:]
                elif time.monotonic() - since > patience_s:
                    raise InputError(f"line {number}: the control has held for {patience_s:g} s: look what it waits for")
        except OSError:
            raise InputError(f"line {number}: the control has hung up") from None
        if number % 1000 == 0:
            say(f"{number:,} of {counted(len(lines), 'line')}")


def _send_answered(lines, line, patience_s, say):
    """All lines; no more of them wait in the control than its buffer holds, and every one is answered."""
    waiting, heard, answered = deque(), b"", 0

    def one_answer():
        nonlocal heard, answered
        until = time.monotonic() + patience_s
        while b"\n" not in heard:
            heard += line.heard(LOOK_S)
            if time.monotonic() > until:
                raise InputError(f"line {answered + 1}: the control has not answered for {patience_s:g} s: look what it waits for")
        told, _, heard = heard.partition(b"\n")
        told = told.strip().decode("ascii", "replace")
        if told.startswith(("error", "ALARM")):
            raise InputError(f"line {answered + 1}: {lines[answered].strip()}: the control says {told}: nothing more was sent")
        if told == "ok":
            waiting.popleft()
            answered += 1

    try:
        for number, text in enumerate(lines, 1):
            piece = text.encode("ascii")
            while waiting and sum(waiting) + len(piece) > GRBL_HOLDS_BYTES:
                one_answer()
            line.write(piece)
            waiting.append(len(piece))
            if number % 1000 == 0:
                say(f"{number:,} of {counted(len(lines), 'line')}")
        while waiting:
            one_answer()
    except OSError:
        raise InputError(f"line {answered + 1}: the control has hung up") from None
