#!/usr/bin/env python3
"""Server with the interface of `hydroid live` (PAGE.md) and a simulated boat, for work on the page and for its tests.

Example: python3 mock.py --port 8600 --token secret [--hostile]
Typed commands while it runs: silent, restart, hostile, nulls, weird, lost, trouble, new, empty, quit. Each is a switch.
"""

import argparse
import copy
import json
import math
import pathlib
import random
import socket
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

CRATES = pathlib.Path(__file__).parents[2] / "crates"
PAGE = CRATES / "hydroid-live/src/page/assets"
SHARED = CRATES / "hydroid-web/src"

FILES = {
    "/": (PAGE / "index.html", "text/html; charset=utf-8"),
    "/page.css": (PAGE / "page.css", "text/css; charset=utf-8"),
    "/page.js": (PAGE / "page.js", "text/javascript; charset=utf-8"),
    "/plots.js": (SHARED / "plots.js", "text/javascript; charset=utf-8"),
    "/uplot.js": (SHARED / "uplot.js", "text/javascript; charset=utf-8"),
    "/uplot.css": (SHARED / "uplot.css", "text/css; charset=utf-8"),
    "/licence.txt": (SHARED / "uplot-licence.txt", "text/plain; charset=utf-8"),
}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
HOSTILE = "<img src=x onerror=alert(1)>"
ACTIONS = {"record", "stop-recording", "freeze", "learn", "identify", "adopt", "roll-back", "experiment", "steer", "stop"}
EXPERIMENTS = ["zigzag-20", "circle", "chirp", "prbs", "acceleration", "auto"]
FENCE = {"north": [-50, 50], "east": [-80, 80]}
PATH = [[-30, -55], [-30, 50], [-5, 58], [5, 50], [5, -45], [30, -55], [32, 40]]
HORIZONS = [0.5, 1, 2, 5, 10]
SPREAD = {"u": 0.05, "v": 0.02, "r": 0.012}


def clamp(x, low=-1.0, high=1.0):
    return min(max(x, low), high)


def wrap(angle):
    return math.remainder(angle, 2 * math.pi)


class Boat:
    """Surge, sway and yaw of a small boat in a weak current, with a helmsman who stays inside the fence."""

    def __init__(self, seed=1):
        self.random = random.Random(seed)
        self.north, self.east, self.psi = -20.0, -40.0, 0.3
        self.u = self.v = self.r = 0.0
        self.throttle = self.rudder = 0.0
        self.goal = (20.0, 30.0)

    def derivative(self, u, v, r, bias=1.0):
        return (
            bias * 1.5 * self.throttle - 0.45 * u - 0.18 * u * abs(u),
            -0.9 * v - 0.25 * u * r,
            bias * 0.4 * self.rudder * (0.25 + u) - 1.3 * r,
        )

    def towards(self, goal, throttle):
        bearing = math.atan2(goal[1] - self.east, goal[0] - self.north)
        self.rudder = clamp(1.2 * wrap(bearing - self.psi) - 0.6 * self.r)
        self.throttle = throttle
        return math.hypot(goal[0] - self.north, goal[1] - self.east)

    def helmsman(self, t):
        near = self.towards(self.goal, 0.55 + 0.25 * math.sin(t / 7)) < 6
        self.rudder = clamp(self.rudder + 0.35 * math.sin(t / 3))
        if near:
            self.goal = (self.random.uniform(-38, 38), self.random.uniform(-65, 65))

    def step(self, dt):
        du, dv, dr = self.derivative(self.u, self.v, self.r)
        self.u += du * dt + self.random.gauss(0, 0.01)
        self.v += dv * dt + self.random.gauss(0, 0.004)
        self.r += dr * dt + self.random.gauss(0, 0.004)
        self.psi = wrap(self.psi + self.r * dt)
        self.north += (self.u * math.cos(self.psi) - self.v * math.sin(self.psi) + 0.05) * dt
        self.east += (self.u * math.sin(self.psi) + self.v * math.cos(self.psi) + 0.12) * dt

    def ahead(self, bias):
        """States at the horizons, with the commands of now and a model whose gains are wrong by `bias`."""
        n, e, psi, u, v, r = self.north, self.east, self.psi, self.u, self.v, self.r
        states, t, dt = [], 0.0, 0.1
        for horizon in HORIZONS:
            while t < horizon - 1e-9:
                du, dv, dr = self.derivative(u, v, r, bias)
                u, v, r, psi, t = u + du * dt, v + dv * dt, r + dr * dt, psi + r * dt, t + dt
                n += (u * math.cos(psi) - v * math.sin(psi)) * dt
                e += (u * math.sin(psi) + v * math.cos(psi)) * dt
            states.append({"north": n, "east": e, "psi": psi, "u": u, "v": v, "r": r})
        return states


class World:
    """The session behind the page: what hydroid would know, and what the actions change."""

    def __init__(self, warm=240.0):
        self.lock = threading.RLock()
        self.boat = Boat()
        self.start = time.time() - warm
        self.t = 0.0
        self.said, self.track, self.rows = [], [], []
        self.recording_since = self.lost_since = self.identifying_since = self.experiment_since = None
        self.experiment = self.offered = None
        self.model, self.learning, self.can_roll_back, self.steering = "boat.hydroid.toml", True, False, False
        self.leg, self.adapted_by = 0, 0.0
        self.histograms = {"throttle": [0.0] * 20, "rudder": [0.0] * 20}
        self.say("info", "autopilot found: ArduPilot (boat), system 1")
        while self.t < warm:
            self.step(0.1)
        self.say("info", "guard: shadow test passed after 45 s, error 0.071 against 0.104 m/s: predictions are those of the adapted model")
        self.say("warning", "GPS_RAW_INT.lat: 3 outliers rejected within 10 s")

    def say(self, level, text):
        entry = {"id": len(self.said) + 1, "time": self.start + self.t, "level": level, "text": text}
        self.said.append(entry)
        self.said = self.said[-200:]
        return entry

    def step(self, dt):
        boat, self.t = self.boat, self.t + dt
        if self.experiment:
            elapsed = self.t - self.experiment_since
            boat.throttle, boat.rudder = 0.6, 0.6 * (1 if int(elapsed / 5) % 2 else -1)
            if abs(boat.north) > 42 or abs(boat.east) > 70:
                boat.towards((0, 0), 0.6)
            if elapsed > 40:
                self.say("info", f"experiment {self.experiment} is finished")
                self.experiment = None
        elif self.steering:
            if boat.towards(PATH[self.leg], 0.7) < 5:
                self.leg = (self.leg + 1) % len(PATH)
        else:
            boat.helmsman(self.t)
        boat.step(dt)
        self.adapted_by += dt if self.learning else 0.0
        if self.identifying_since is not None and self.t - self.identifying_since > 6:
            self.identifying_since = None
            self.offered = {"name": "recorded-1.toml", "text": "cross-validated NRMSE u 0.08, v 0.14, r 0.05: good, good, good"}
            self.say("info", "identified recorded-1.toml; it can be adopted")
        for name, value in (("throttle", boat.throttle), ("rudder", boat.rudder)):
            self.histograms[name][min(int((value + 1) * 10), 19)] += dt
        noise = boat.random.gauss
        row = [self.start + self.t, *(getattr(boat, k) + noise(0, 0.3 * s) for k, s in SPREAD.items())]
        self.rows = (self.rows + [row + [getattr(boat, k) + noise(0, 0.35 * s) for k, s in SPREAD.items()]])[-600:]
        if round(self.t / dt) % 5 == 0:
            self.track = (self.track + [[self.start + self.t, boat.north, boat.east, boat.psi]])[-3000:]

    def errors(self):
        gain = 1 - 0.45 * (1 - math.exp(-self.adapted_by / 120))
        frozen = {k: [s * (0.5 + 0.25 * h**0.7) for h in (1, 5, 10)] for k, s in SPREAD.items()}
        return {"seconds": [1, 5, 10], "frozen": frozen, "adapted": {k: [x * gain for x in row] for k, row in frozen.items()}}

    def state(self):
        boat, now, row = self.boat, self.start + self.t, self.rows[-1]
        ahead = boat.ahead(1.05)
        growth = [0.3 + 0.09 * h**1.4 for h in HORIZONS]
        busy = self.experiment or self.steering
        total = max(sum(self.histograms["throttle"]), 1e-9)
        actions = ["stop", "stop-recording" if self.recording_since is not None else "record"]
        actions += ["freeze" if self.learning else "learn"] if self.model else []
        actions += ["identify"] if self.identifying_since is None and not self.offered else []
        actions += ["adopt"] if self.offered and not busy else []
        actions += ["roll-back"] if self.can_roll_back and not busy else []
        actions += [] if busy else ["experiment"] + (["steer"] if self.model else [])
        recording = None
        if self.recording_since is not None:
            recording = {"path": "boat-2026-11-26T21-00-00Z.mcap", "seconds": self.t - self.recording_since, "lost": 0, "trouble": ""}
        model = None
        if self.model:
            model = {"name": self.model, "learning": self.learning, "guard": "on", "predicted_by": "adapted", "can_roll_back": self.can_roll_back}
        experiment = None
        if self.experiment:
            elapsed = self.t - self.experiment_since
            text = "turning to starboard" if boat.rudder > 0 else "turning to port"
            experiment = {"name": self.experiment, "progress": elapsed / 40, "remaining_s": 40 - elapsed, "text": text}
        identifying = None
        if self.identifying_since is not None:
            identifying = {"progress": (self.t - self.identifying_since) / 6, "text": "sindy"}
        jitter = boat.random.random
        return {
            "time": now,
            "link": {
                "address": "udpin:0.0.0.0:14550", "autopilot": "ArduPilot (boat), system 1", "lost_s": None, "mode": "MANUAL",
                "armed": True, "clock_offset_s": -0.02, "round_trip_ms": 3 + jitter(), "damaged": 0, "dropped": 2,
            },
            "sensors": [
                {"name": "latitude", "column": "GPS_RAW_INT.lat", "rate_hz": 5.0, "age_s": 0.2 * jitter(), "latency_ms": 120 + 9 * jitter(), "outliers": 0.01},
                {"name": "longitude", "column": "GPS_RAW_INT.lon", "rate_hz": 5.0, "age_s": 0.2 * jitter(), "latency_ms": 120 + 9 * jitter(), "outliers": 0.01},
                {"name": "heading", "column": "ATTITUDE.yaw", "rate_hz": 10.0, "age_s": 0.1 * jitter(), "latency_ms": 12 + 3 * jitter(), "outliers": 0.0},
                {"name": "yaw rate", "column": "ATTITUDE.yawspeed", "rate_hz": 10.0, "age_s": 0.1 * jitter(), "latency_ms": 12 + 3 * jitter(), "outliers": 0.002},
                {"name": "throttle", "column": "RC_CHANNELS.chan3_raw", "rate_hz": 5.0, "age_s": 0.2 * jitter(), "latency_ms": 15.0, "outliers": None},
            ],
            "motion": {
                "north": boat.north, "east": boat.east, "psi": boat.psi, "u": boat.u, "v": boat.v, "r": boat.r,
                "position_deviation": 0.35 + 0.05 * jitter(), "current": [0.05, 0.12], "provisional": False,
            },
            "recording": recording,
            "model": model,
            "offered": self.offered,
            "identifying": identifying,
            "outputs": [
                {"name": k, "unit": "rad/s" if k == "r" else "m/s", "measured": row[1 + i], "predicted": row[4 + i], "band_95": 1.2 * s}
                for i, (k, s) in enumerate(SPREAD.items())
            ] if model else [],
            "prediction": {
                "seconds": HORIZONS,
                **{k: [state[k] for state in ahead] for k in ("north", "east", "psi")},
                "position_95": growth,
                "outputs": {k: [state[k] for state in ahead] for k in SPREAD},
                "bands_95": {k: [s * (1 + 0.6 * h**0.6) for h in HORIZONS] for k, s in SPREAD.items()},
            } if model else None,
            "errors": self.errors() if model else None,
            "excitation": {
                "seconds": self.t, "needed_seconds": 300.0,
                "inputs": [{"name": k, "low": -1, "high": 1, "histogram": [x / total for x in h]} for k, h in self.histograms.items()],
                "sufficient": self.t > 300,
                "text": "Sufficient for an identification." if self.t > 300 else "Throttle below 0.2 and astern is missing; run the experiment acceleration.",
            },
            "experiment": experiment,
            "experiments": EXPERIMENTS,
            "fence": FENCE,
            "path": PATH,
            "helm": {
                "state": "experiment" if self.experiment else "steering" if self.steering else "off", "refusals": [] if model else ["a model is needed"],
                "commands": [{"name": k, "value": getattr(boat, k) if busy else 0.0, "low": -1, "high": 1} for k in ("throttle", "rudder")],
            },
            "actions": actions,
        }

    def act(self, body):
        """Status and answer of an action."""
        action = body.get("action")
        if action not in ACTIONS or (action == "experiment" and body.get("name") not in EXPERIMENTS):
            return 400, {"error": f"not understood: {json.dumps(body)}"}
        if action != "stop" and action not in self.state()["actions"]:
            return 409, {"error": f"{action} is not possible now; look at the state of the helm"}
        done = self.perform(action, body)
        self.say("info", done)
        return 200, {"done": done}

    def perform(self, action, body):
        if action == "record":
            self.recording_since = self.t
            return "recording to boat-2026-11-26T21-00-00Z.mcap"
        if action == "stop-recording":
            self.recording_since = None
            return "recording closed"
        if action in ("freeze", "learn"):
            self.learning = action == "learn"
            return "the model learns" if self.learning else "the model is frozen"
        if action == "identify":
            self.identifying_since = self.t
            return "identification of the recording has begun"
        if action == "adopt":
            self.model, self.offered, self.can_roll_back = self.offered["name"], None, True
            return f"adopted {self.model}"
        if action == "roll-back":
            self.model, self.can_roll_back = "boat.hydroid.toml", False
            return "rolled back to boat.hydroid.toml"
        if action == "experiment":
            self.experiment, self.experiment_since = body["name"], self.t
            return f"experiment {self.experiment} has begun"
        if action == "steer":
            self.steering, self.leg = True, 0
            return "steering along the path has begun"
        self.experiment, self.steering = None, False
        return "the helm is released"


def nulls(x):
    """The same structure with null for every value; lists of values become null, too."""
    if isinstance(x, dict):
        return {key: nulls(value) for key, value in x.items()}
    return [nulls(value) for value in x] if isinstance(x, list) and x and isinstance(x[0], dict) else None


def hostile(x):
    """The same structure with hostile text for every text that is not one of a fixed set of words."""
    if isinstance(x, dict):
        fixed = ("state", "guard", "predicted_by", "unit", "level", "actions", "experiments")
        return {key: value if key in fixed else hostile(value) for key, value in x.items()}
    if isinstance(x, list):
        return [hostile(value) for value in x]
    return HOSTILE + x if isinstance(x, str) else x


def weird(state):
    """Unknown fields, huge numbers, arrays of the wrong length and values of the wrong type."""
    state["unknown"] = {"deep": [1, {"x": None}]}
    state["motion"].update(north=1e300, u=-1e12, psi=1e9, current=[1])
    state["prediction"].update(seconds=[0.5, 1], north=[1, 1e300, 3, 4], position_95=[], outputs={"u": [1e300]}, bands_95=7)
    state["errors"].update(seconds=[10, 1, None, 5], frozen={"u": [0.1]}, adapted=None)
    state["outputs"] = [{"name": "u", "unit": "m/s", "measured": 1e300, "predicted": "x", "band_95": -1}, None, {"name": "__proto__", "unit": "furlong"}]
    state["sensors"] = [None, 5, {"name": {"toString": 1}, "rate_hz": 1e30, "age_s": -5}] + state["sensors"]
    state["excitation"]["inputs"] = [{"name": "a", "histogram": [1e300, -4, None]}, {"name": "b", "low": 1, "high": 1, "histogram": "x"}]
    state["helm"].update(commands=[{"name": "throttle", "value": 1e300, "low": 1, "high": -1}, {"value": 5, "low": -1, "high": 1}], refusals=[None, 7, "x" * 3000])
    state["link"].update(lost_s=1e15, damaged=1e20, clock_offset_s=-1e9)
    state["fence"] = {"radius": 1e300, "north": [1], "east": "x"}
    state["path"] = [[1], None, [1e300, 2], [3, 4], "x"]
    return state


def merge(target, patch):
    for key, value in patch.items():
        if isinstance(value, dict) and isinstance(target.get(key), dict):
            merge(target[key], value)
        else:
            target[key] = value


class Mock:
    """The server; `switches` and `patch` change what it sends, `requests` keeps the actions that it was sent."""

    def __init__(self, port=0, token="secret", warm=240.0):
        self.token, self.warm, self.port = token, warm, port
        self.switches, self.patch, self.requests, self.answer = set(), {}, [], None
        self.server = None

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}"

    def start(self):
        self.world = World(self.warm)
        self.running = running = threading.Event()
        running.set()
        self.server = ThreadingHTTPServer(("127.0.0.1", self.port), Handler)
        self.server.daemon_threads, self.server.mock, self.server.running, self.server.connections = True, self, running, set()
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
        threading.Thread(target=self.simulate, args=(self.world, running), daemon=True).start()
        return self

    def stop(self):
        self.running.clear()
        self.server.shutdown()
        self.server.server_close()
        for connection in list(self.server.connections):
            try:
                connection.shutdown(socket.SHUT_RDWR)  # also those that a browser keeps for later requests
            except OSError:
                pass

    @staticmethod
    def simulate(world, running):
        due = time.monotonic()
        while running.is_set():
            with world.lock:
                world.step(0.1)
            due += 0.1
            time.sleep(max(0.0, due - time.monotonic()))

    def state(self):
        state = copy.deepcopy(self.world.state())
        link = state["link"]
        if "lost" in self.switches:
            link.update(lost_s=7.2, mode=None, armed=None)
            for sensor in state["sensors"]:
                sensor["age_s"] = 7.3
            state["actions"] = [a for a in state["actions"] if a not in ("experiment", "steer")]
            state["helm"]["refusals"] = ["the link to the autopilot is lost: check the radio"]
        if "trouble" in self.switches and state["recording"]:
            state["recording"].update(lost=120, trouble="the disk is full: free some space")
        if "new" in self.switches:
            state.update(model=None, outputs=[], prediction=None, errors=None, path=None, fence=None)
        if "empty" in self.switches:
            return {}
        if "nulls" in self.switches:
            state = nulls(state)
        if "weird" in self.switches:
            state = weird(state)
        if "hostile" in self.switches:
            state = hostile(state)
        merge(state, self.patch)
        return state

    def history(self):
        world = self.world
        said = hostile(world.said) if "hostile" in self.switches else world.said
        return {"track": world.track, "series": {"names": list(SPREAD), "rows": world.rows}, "said": said}


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def setup(self):
        super().setup()
        self.server.connections.add(self.connection)

    def finish(self):
        self.server.connections.discard(self.connection)
        try:
            super().finish()
        except OSError:
            pass  # the connection was cut by a restart

    def handle(self):
        try:
            super().handle()
        except OSError:
            pass

    def head(self, status, kind, length=None):
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind}.items():
            self.send_header(name, value)
        if length is None:
            self.send_header("Connection", "close")
        else:
            self.send_header("Content-Length", str(length))
        self.end_headers()

    def reply(self, status, answer):
        data = json.dumps(answer).encode()
        self.head(status, "application/json", len(data))
        self.wfile.write(data)

    def do_GET(self):
        mock, path = self.server.mock, self.path.split("?")[0]
        if path in FILES:
            name, kind = FILES[path]
            data = name.read_bytes()
            self.head(200, kind, len(data))
            self.wfile.write(data)
        elif path == "/events":
            try:
                self.events(mock)
            except OSError:
                pass  # the page has gone
        else:
            self.reply(405 if path == "/action" else 404, {"error": "not here"})

    def events(self, mock):
        def send(name, data):
            self.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
            self.wfile.flush()

        self.close_connection = True
        self.head(200, "text/event-stream")
        with mock.world.lock:
            history = json.loads(json.dumps(mock.history()))
        known = max((entry["id"] for entry in history["said"]), default=0)
        send("history", history)
        while self.server.running.is_set():
            if "silent" not in mock.switches:
                with mock.world.lock:
                    state, said = mock.state(), [entry for entry in mock.world.said if entry["id"] > known]
                for entry in said:
                    known = entry["id"]
                    send("said", hostile(entry) if "hostile" in mock.switches else entry)
                send("state", state)
            time.sleep(0.1)

    def do_POST(self):
        mock = self.server.mock
        data = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        origin, site = self.headers.get("Origin"), self.headers.get("Sec-Fetch-Site")
        if self.path != "/action":
            return self.reply(405 if self.path in FILES or self.path == "/events" else 404, {"error": "not here"})
        if site == "cross-site" or (origin and origin != f"http://{self.headers.get('Host')}"):
            return self.reply(403, {"error": "request of another site"})
        if self.headers.get("Authorization") != f"Bearer {mock.token}":
            return self.reply(401, {"error": "the token is missing or wrong; hydroid prints it at its start"})
        try:
            body = json.loads(data)
            assert isinstance(body, dict) and self.headers.get("Content-Type") == "application/json"
        except (ValueError, AssertionError):
            return self.reply(400, {"error": "not a JSON object"})
        mock.requests.append(body)
        if mock.answer:
            return self.reply(*mock.answer)
        with mock.world.lock:
            self.reply(*mock.world.act(body))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=8600)
    parser.add_argument("--token", default="secret")
    parser.add_argument("--hostile", action="store_true", help="hostile names and texts")
    options = parser.parse_args()
    mock = Mock(options.port, options.token).start()
    mock.switches |= {"hostile"} if options.hostile else set()
    print(f"{mock.url}/#token={mock.token}", flush=True)
    for line in sys.stdin:
        word = line.strip()
        if word == "quit":
            return
        if word == "restart":
            mock.stop()
            time.sleep(3)
            mock.start()
        elif word:
            mock.switches ^= {word}
            print("on:", *sorted(mock.switches), flush=True)
    threading.Event().wait()  # without a terminal: until it is killed


if __name__ == "__main__":
    main()
