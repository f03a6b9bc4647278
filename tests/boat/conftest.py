"""Programs of the tests: the simulated boat, and `hydroid live` beside it."""

import json
import os
import pathlib
import signal
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request

import pytest
from boat import Boat

COMMAND = os.environ.get("HYDROID_COMMAND", str(pathlib.Path(__file__).parents[2] / "target/debug/hydroid"))
TOKEN = "0123456789abcdef0123456789abcdef"


def free_port(kind):
    """A port that nobody uses."""
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Hydroid:
    """`hydroid live`, or a program like it, in a folder, with the newest state of its page and everything that it says."""

    def __init__(self, folder, *arguments, program=(COMMAND, "live"), words=(), **environment):
        self.folder, self.state, self.said = folder, None, []
        self.page = free_port(socket.SOCK_STREAM)
        self.url = f"http://127.0.0.1:{self.page}"
        config = folder / "boat.toml"
        if not config.exists():
            example = subprocess.run([*program, "--print-config"], check=True, capture_output=True)
            config.write_bytes(example.stdout)
        command = [*program, *arguments, "-c", str(config)]
        if "-o" not in arguments:
            command += ["-o", str(folder / "live")]
        command += ["--page", f"127.0.0.1:{self.page}", "--token", TOKEN]
        self.log = open(folder / "live.log", "a")
        self.process = subprocess.Popen([*command, *words], stderr=self.log, env={**os.environ, **environment})
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while self.process.poll() is None:
            try:
                kind = b""
                for line in urllib.request.urlopen(self.url + "/events", timeout=30):
                    if line.startswith(b"event:"):
                        kind = line[6:].strip()
                    elif line.startswith(b"data:") and kind == b"state":
                        self.state = json.loads(line[5:])
                    elif line.startswith(b"data:") and kind == b"said":
                        self.said.append(json.loads(line[5:]))
                    elif line.startswith(b"data:") and kind == b"history":
                        self.said = json.loads(line[5:])["said"]
            except (OSError, urllib.error.URLError, ValueError):
                time.sleep(0.1)

    def act(self, action, token=TOKEN, **more):
        """Status and answer of an action."""
        body = json.dumps({"action": action, **more}).encode()
        headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
        try:
            with urllib.request.urlopen(urllib.request.Request(f"{self.url}/action", body, headers), timeout=10) as ok:
                return ok.status, json.load(ok)["done"]
        except urllib.error.HTTPError as error:
            return error.code, json.load(error)["error"]

    def wait(self, holds, seconds, what):
        """The first state for which a condition holds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            state = self.state
            if state and holds(state):
                return state
            assert self.process.poll() is None, (self.folder / "live.log").read_text()
            time.sleep(0.02)
        raise AssertionError(f"{what}: not within {seconds} s: {json.dumps(self.state)}\n{(self.folder / 'live.log').read_text()}")

    def stop(self):
        """Ends the program as ctrl-C does; its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(20)
        finally:
            self.process.kill()
            self.log.close()


@pytest.fixture
def sea(tmp_path):
    """Makes a boat that runs, armed in MANUAL, and hydroid beside it."""
    running = []

    def make(*arguments, scale=1.0, **water):
        port = free_port(socket.SOCK_DGRAM)
        boat = Boat(("127.0.0.1", port), speed=scale, **water)
        boat.utc, boat.armed = time.time(), True
        link = ("--link", f"udpin:127.0.0.1:{port}", "--time-scale", str(scale))
        hydroid = Hydroid(tmp_path, *arguments, *link)
        running.extend([hydroid, boat])
        boat.start()
        return boat, hydroid

    yield make
    for one in running:
        one.stop()
