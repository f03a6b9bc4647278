"""A model of a recording of the autopilot goes on board as it is, and steers: its inputs are outputs of the autopilot."""

import math
import os
import pathlib
import subprocess
import time

import pytest
from conftest import COMMAND

# Simulated seconds per second.
FAST = 2.0

CONTROL = """
[control]
controller = "cem"
task = "lawn-mower"
leg = 40
spacing = 20
legs = 3
radius = 9
tolerance = 8
"""


def test_a_model_of_a_recording_steers(sea, tmp_path):
    if "HYDROID_DATA" not in os.environ:
        pytest.skip("skipped: no HYDROID_DATA")
    otter = pathlib.Path(os.environ["HYDROID_DATA"]).resolve() / "fleet/formats/otter.BIN"

    def run(*arguments):
        subprocess.run([COMMAND, *arguments], cwd=tmp_path, check=True, capture_output=True)

    run("inspect", str(otter), "--write-config=boat.toml")
    run("identify", str(otter), "-c", "boat.toml", "--methods", "sindy", "-o", "out")
    with open(tmp_path / "boat.toml", "a") as file:
        file.write(CONTROL)
    model = str(tmp_path / "out/sindy.safetensors")
    boat, hydroid = sea(model, "--allow-commands", "--fence", "90", scale=FAST, seed=1)
    hydroid.wait(lambda s: s["motion"] and s["model"] and not s["helm"]["refusals"], 60, "the preflight")
    status, text = hydroid.act("steer")
    assert status == 200, text
    hydroid.wait(lambda s: s["helm"]["state"] == "steering", 60, "steering")
    path = hydroid.state["path"]
    far, seen = [], set()
    end = time.monotonic() + 200.0
    while hydroid.state["helm"]["state"] == "steering" and len(far) < 2400:
        assert time.monotonic() < end, boat.truth
        truth = boat.truth
        seen.add(truth.pulses)
        far.append(min(math.hypot(n - truth.north, e - truth.east) for n, e in path))
        time.sleep(0.05)
    # From the middle of the fence to the path, and along it.
    assert len(far) == 2400, (far[::90], (hydroid.folder / "live.log").read_text()[-600:])
    late = sorted(far[-900:])
    assert late[len(late) // 2] < 3.0, far[::90]
    assert len(seen) > 20, "both outputs follow the commands"

    # Another mixer: the outputs are not those that are wanted.
    boat.parameters["SERVO3_FUNCTION"] = 73.0
    hydroid.wait(lambda s: s["helm"]["state"] == "off", 20, "hands off")
    assert any("the mixer of the autopilot is another one" in said["text"] for said in hydroid.said), hydroid.said[-5:]
    assert hydroid.stop() == 130
