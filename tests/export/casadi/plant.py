"""hydroid's simulation of a vessel of the repository: `cargo run -p hydroid-export --example plant -- VESSEL`."""

import os
import subprocess
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).parents[3]


class Plant:
    """A simulation that starts in a steady motion. HYDROID_PLANT names the built example (default: cargo builds it)."""

    def __init__(self, vessel, pose, outputs, command):
        program = os.environ.get("HYDROID_PLANT")
        run = [program] if program else "cargo run -q -p hydroid-export --example plant --".split()
        path = REPOSITORY / "vessels" / f"{vessel}.toml"
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen([*run, path], cwd=REPOSITORY, **pipes)
        self.answer = self.send([*pose, *outputs, *command])

    def send(self, numbers):
        self.process.stdin.write(" ".join(repr(float(number)) for number in numbers) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("the simulation has ended: its message stands on the standard error")
        self.answer = np.array([float(number) for number in line.split()])
        return self.answer

    @property
    def pose(self):
        return self.answer[:3]

    @property
    def outputs(self):
        return self.answer[3:]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait(timeout=10)
