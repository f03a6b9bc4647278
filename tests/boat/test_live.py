"""`hydroid live` with the simulated boat: from an unknown boat to a steered one, and hands off."""

import math
import time

from boat import HOLD, MANUAL

# Simulated seconds per second.
FAST = 2.0


def ready(hydroid):
    """Waits until commands may begin."""
    hydroid.wait(lambda s: s["motion"] and not s["helm"]["refusals"], 60, "the preflight")


def test_from_an_unknown_boat_to_a_steered_one(sea):
    boat, hydroid = sea("new", "--allow-commands", "--fence", "90", scale=FAST, seed=1, current=(0.15, 0.1))
    ready(hydroid)
    assert hydroid.act("steer")[0] == 409, "there is no model yet"
    assert hydroid.act("experiment", name="auto")[0] == 200
    hydroid.wait(lambda s: s["helm"]["state"] == "experiment", 5, "the experiment")
    farthest = 0.0
    end = time.monotonic() + 500
    while hydroid.state["helm"]["state"] == "experiment" and time.monotonic() < end:
        farthest = max(farthest, math.hypot(boat.truth.north, boat.truth.east))
        time.sleep(0.05)
    assert hydroid.state["helm"]["state"] == "off"
    assert hydroid.state["excitation"]["sufficient"], hydroid.state["excitation"]["text"]
    assert farthest < 92.0, "outside the fence"

    assert hydroid.act("identify")[0] == 200
    hydroid.wait(lambda s: s["offered"], 300, "the model")
    status, text = hydroid.act("adopt")
    assert status == 200, text
    hydroid.wait(lambda s: s["model"] and s["prediction"], 10, "predictions")

    status, text = hydroid.act("steer")
    assert status == 200, text
    hydroid.wait(lambda s: s["helm"]["state"] == "steering", 60, "steering")
    path = hydroid.state["path"]
    since = None
    end = time.monotonic() + 200.0
    while since is None or boat.truth.time - since < 30.0:
        assert time.monotonic() < end, f"{distance:.1f} m from the path at {boat.truth}"
        assert hydroid.state["helm"]["state"] == "steering", hydroid.said[-3:]
        truth = boat.truth
        distance = min(math.hypot(n - truth.north, e - truth.east) for n, e in path)
        is_sailing = distance < 5.0 and truth.u > 0.3
        since = (since or truth.time) if is_sailing else None
        time.sleep(0.05)
    assert hydroid.state["model"]["learning"]

    # The pilot takes over: no command arrives after the mode has changed, but those of the release.
    boat.mode_switch(HOLD)
    hydroid.wait(lambda s: s["helm"]["state"] == "off", 5, "hands off")
    assert any("hands off" in said["text"] for said in hydroid.said)
    boat.mode_switch(MANUAL)
    time.sleep(2.0)
    assert hydroid.state["helm"]["state"] == "off", "it began again by itself"
    assert hydroid.stop() == 130
