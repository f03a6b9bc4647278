"""A client of the control service, in plain Python: it sails a lawn-mower with a boat of its own.

The client integrates the equations of the hydrofoil, adds measurement noise, starts `hydroid control`, sends one line
for each sample and applies the command of each answer. It kills the service twice and starts it again with the state
file; meanwhile the boat keeps its last command. One JSON object on standard output holds the largest deviations and
the latencies.

control_client.py HYDROID -- --controller fl [more options of hydroid control]"""

import argparse
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from manoeuvres_golden import HYDROFOIL, advance

DT, SUBSTEPS = 0.1, 4
# Time without commands after a kill, in samples.
OUTAGE = 5
# Standard deviations of the measurements: metres, radians, metres per second.
NOISE = {"x": 0.05, "y": 0.05, "psi": 0.003, "u": 0.01, "v": 0.01, "r": 0.0175}


class Service:
    def __init__(self, command, folder):
        self.began = time.perf_counter()
        self.process = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
        )
        self.answers = open(self.process.stdout.fileno(), "rb", closefd=False)

    def send(self, line):
        self.process.stdin.write(line)

    def answer(self):
        while True:
            line = self.answers.readline()
            if not line:
                raise SystemExit(f"the service ended with status {self.process.wait()}")
            # What is written in silence answers no line.
            if b'"status":"lost"' not in line:
                return line

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()

    def end(self):
        self.process.stdin.close()
        return self.process.wait()


def path_length(args):
    return args.legs * args.leg + (args.legs - 1) * math.pi * args.radius


def distance_from_path(args, x, y):
    """Distance from the legs, which point north and are two radii apart, and from the semicircles at their ends."""
    nearest = math.inf
    for leg in range(args.legs):
        east = 2 * args.radius * leg
        nearest = min(nearest, math.hypot(x - min(max(x, 0.0), args.leg), y - east))
        if leg + 1 < args.legs:
            end = args.leg if leg % 2 == 0 else 0.0
            beyond = x - end if leg % 2 == 0 else end - x
            if beyond > 0.0:
                nearest = min(nearest, abs(math.hypot(x - end, y - east - args.radius) - args.radius))
    return nearest


def quantiles(seconds):
    ordered = sorted(seconds)
    at = lambda share: round(1e6 * ordered[min(int(share * len(ordered)), len(ordered) - 1)], 1)
    return {"median": at(0.5), "p99": at(0.99), "p99_9": at(0.999), "max": at(1.0)}


def heavier_drag(factor):
    scaled = lambda matrix: [[factor * x for x in row] for row in matrix]
    return {**HYDROFOIL, "linear": scaled(HYDROFOIL["linear"]), "quadratic": scaled(HYDROFOIL["quadratic"])}


def parse():
    parser = argparse.ArgumentParser(description="A client of the control service with a boat of its own.")
    parser.add_argument("hydroid")
    parser.add_argument("--legs", type=int, default=10)
    parser.add_argument("--leg", type=float, default=240.0, help="length of a leg [m]")
    parser.add_argument("--radius", type=float, default=15.0, help="radius of the turns [m]")
    parser.add_argument("--speed", type=float, default=1.5, help="[m/s]")
    parser.add_argument("--drag", type=float, default=1.0, help="drag of the boat relative to the model")
    parser.add_argument("--start-up", type=float, default=30.0, help="time without evaluation [s]")
    parser.add_argument("--seed", type=int, default=1)
    split = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    return parser.parse_args(sys.argv[1:split]), sys.argv[split + 1 :]


def sail(args, options, folder):
    program = os.path.abspath(shutil.which(args.hydroid) or args.hydroid)
    task = ["--task", "lawn-mower", "--legs", args.legs, "--leg", args.leg, "--radius", args.radius]
    command = [program, "control", "hydrofoil", *task, "--speed", args.speed, *options]
    command = [str(word) for word in [*command, "--state", "boat.state", "--timing", "-"]]
    expected = round(path_length(args) / args.speed / DT)
    # The first kill follows an answer. The second one follows a line that is not answered.
    kills = [expected // 3, 2 * expected // 3 + 4]

    boat, noise = heavier_drag(args.drag), random.Random(args.seed)
    state, acting = [-1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0], (0.0, 0.0)
    latencies, computing, restarts, largest = [], [], [], {"cross_track": 0.0, "from_path": 0.0}
    statuses, control, predicted_by = {}, {}, {}
    service, first, k, arrived = Service(command, folder), True, 0, False
    while not arrived and k < 2 * expected:
        measured = dict(zip(("x", "y", "psi", "u", "v", "r"), state))
        sample = {"t": round(k * DT, 1), **{key: x + noise.gauss(0.0, NOISE[key]) for key, x in measured.items()}}
        line = json.dumps(sample).encode() + b"\n"
        if kills and k >= kills[0]:
            if len(kills) == 1:
                service.send(line)
            service.kill()
            kills.pop(0)
            for _ in range(OUTAGE):
                state = advance(boat, state, acting, SUBSTEPS, DT / SUBSTEPS)
            k += OUTAGE
            service, first = Service(command, folder), True
            continue
        sent = time.perf_counter()
        service.send(line)
        text = service.answer()
        read = time.perf_counter()
        answer = json.loads(text)
        if answer["t"] != sample["t"]:
            raise SystemExit(f"the answer {text} does not belong to the line {line}")
        # The first line of a service waits for its start.
        (restarts if first else latencies).append(read - (service.began if first else sent))
        first = False
        computing.append(1e-6 * answer["us"])
        for counts, key in ((statuses, "status"), (control, "control"), (predicted_by, "predicted_by")):
            if key in answer:
                counts[answer[key]] = counts.get(answer[key], 0) + 1
        if k * DT > args.start_up:
            largest["cross_track"] = max(largest["cross_track"], abs(answer["cross_track"]))
            largest["from_path"] = max(largest["from_path"], distance_from_path(args, state[0], state[1]))
        acting = (answer["command"]["PP_cmd"], answer["command"]["RD_ang"])
        arrived = answer["control"] == "arrived"
        state = advance(boat, state, acting, SUBSTEPS, DT / SUBSTEPS)
        k += 1
    return {
        "simulated_s": round(k * DT, 1),
        "arrived": arrived,
        "answers": len(latencies) + len(restarts),
        "kills": 2 - len(kills),
        "largest_cross_track_m": round(largest["cross_track"], 3),
        "largest_distance_from_path_m": round(largest["from_path"], 3),
        "status": statuses,
        "control": control,
        "predicted_by": predicted_by,
        "start_to_first_answer_ms": [round(1e3 * s, 1) for s in restarts],
        "line_to_answer_us": quantiles(latencies),
        "computing_us": quantiles(computing),
        "exit_status": service.end(),
    }


def main():
    args, options = parse()
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(sail(args, options, folder), indent=1))


if __name__ == "__main__":
    main()
