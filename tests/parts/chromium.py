"""A headless Chromium driven over a pair of pipes with the DevTools protocol."""

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections import deque
from contextlib import contextmanager

import pytest

FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe")
# the protocol's pipes are file descriptors 3 and 4 of the browser
LAUNCHER = "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execv(sys.argv[3], sys.argv[3:])"
PATIENCE_S = 120        # a software renderer on a busy machine


def find_chromium():
    """Path of a Chromium or Chrome, None when there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return next((path for path in map(shutil.which, names) if path), None)


MARKS = [pytest.mark.browser, pytest.mark.xdist_group("browser"),
         pytest.mark.skipif(find_chromium() is None, reason="Chromium is not installed: apt-get install chromium")]


@contextmanager
def viewing(page, profile_dir):
    """A Browser with a report's page open; the test is skipped, with what the page says, where it can draw nothing."""
    with Browser(profile_dir) as found:
        found.open(page)
        if "no-view" in found.evaluate("document.body.className"):
            pytest.skip("this Chromium offers no WebGL2: " + found.evaluate("document.getElementById('view-message').textContent"))
        yield found


class Browser:
    """One page in one browser; a context manager.

    `errors` collects what the page complained about, `requests` every address it asked for.
    """

    def __init__(self, profile_dir, *, window=(1280, 900), flags=()):
        self.errors, self.requests, self._number, self._waiting = [], [], 0, deque()
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()
        to_read, to_write = (_above_the_protocol(fd) for fd in (to_read, to_write))
        command = [sys.executable, "-c", LAUNCHER, str(to_read), str(to_write), find_chromium(), *FLAGS, *flags,
                   f"--user-data-dir={profile_dir}", f"--window-size={window[0]},{window[1]}", "about:blank"]
        self._process = subprocess.Popen(command, pass_fds=(to_read, to_write), stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self._buffer, self._session = b"", None
        page = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self._session = None
            self.call("Browser.close")
            self._process.wait(20)
        except (TimeoutError, EOFError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        finally:
            os.close(self._write)
            os.close(self._read)

    def call(self, method, **parameters):
        """One protocol command and its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next_message()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self._note(answer)

    def evaluate(self, expression):
        """The value of a JavaScript expression; promises are awaited."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"]["exception"].get("description", "JavaScript failed"))
        return answer["result"].get("value")

    def open(self, address):
        """Loads a page and waits until it says `window.__ready`."""
        self.call("Page.navigate", url=address)
        self.wait_for("window.__ready === true")

    def wait_for(self, expression):
        """Until an expression is true."""
        end = time.monotonic() + PATIENCE_S
        while not self.evaluate(expression):
            if time.monotonic() > end:
                raise TimeoutError(f"waited {PATIENCE_S} s for {expression}; the page said {self.errors}")
            time.sleep(0.05)

    def screenshot(self, path, whole_page=False):
        """PNG of the window or of the whole page."""
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole_page)
        path.write_bytes(base64.b64decode(answer["data"]))

    def pdf(self, path):
        """What Ctrl-P would print."""
        path.write_bytes(base64.b64decode(self.call("Page.printToPDF", preferCSSPageSize=True, printBackground=False)["data"]))

    def _next_message(self):
        end = time.monotonic() + PATIENCE_S
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                raise TimeoutError(f"Chromium did not answer within {PATIENCE_S} s")
            chunk = os.read(self._read, 1 << 20)
            if not chunk:
                raise EOFError("Chromium ended")
            self._buffer += chunk
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def _note(self, event):
        name, found = event.get("method"), event.get("params", {})
        if name == "Network.requestWillBeSent":
            self.requests.append(found["request"]["url"])
        elif name == "Runtime.exceptionThrown":
            self.errors.append(str(found["exceptionDetails"].get("exception", {}).get("description")))
        elif name == "Runtime.consoleAPICalled" and found["type"] in ("error", "warning"):
            self.errors.append(" ".join(str(a.get("value")) for a in found["args"]))
        elif name == "Log.entryAdded" and found["entry"]["level"] == "error":
            self.errors.append(found["entry"]["text"])


def _above_the_protocol(descriptor):
    """The same pipe end under a number that cannot collide with 3 and 4."""
    higher = fcntl.fcntl(descriptor, fcntl.F_DUPFD, 10)
    os.close(descriptor)
    return higher
