"""What a user writes, as mypy --strict sees it; the functions are not called."""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import hydroid

Array = NDArray[np.float64]


def logs() -> None:
    log = hydroid.Log({"u [m/s]": [1.0]}, units={"u": "kn"})
    assert_type(log["u"], Array)
    assert_type(hydroid.read_logs(["a.BIN", "b.BIN"], config="hydroid.toml"), list[hydroid.Log])
    assert_type(hydroid.prepare([log, "b.csv"], outputs={"u": "speed"}, inputs=["n"])[0].t, Array)


def identification() -> None:
    found = hydroid.identify("a.csv", methods="sindy", horizon="5s", sections={"sindy": {"degree": 3}})
    assert_type(found.best, hydroid.Model | None)
    assert_type(found.models["sindy"].jacobian([1.0], [1.0]), tuple[Array, Array])
    assert_type(found.judgement["sindy"].judged.nrmse, Array)


def judged(outputs: Array, inputs: Array, commands: Array) -> Array:
    return np.repeat(outputs[-1:], len(commands), axis=0)


def evaluation() -> None:
    assert_type(hydroid.evaluate(judged, "a.csv", horizon=10), hydroid.Evaluation)


def vessels() -> None:
    assert_type(hydroid.simulate("simple", {"t": [0.0]}, current=(0.1, 0.0))["u"], Array)
    trials = hydroid.manoeuvres("simple", "zigzag", zigzag=[(10, 10), "20/20"], length=2)
    assert_type(trials.tracks[0].commands, Array | None)
    assert_type(hydroid.compare_manoeuvres("simple", "a.csv", heading="psi").tracks[0].predicted.x, Array)


def control(model: hydroid.Model) -> None:
    assert_type(hydroid.control("simple", model, points=[(0, 0), (9, 0)], task="legs").track.pose, Array)
    controller = hydroid.Controller(model, speed=2.0, guard=hydroid.Guard(window=600), adapt=True)
    assert_type(controller.step([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]).command, Array)
    planner = hydroid.Planner(model, limit={"n": (0.0, 9.0)})
    assert_type(planner.plan(model.session(), [0.0, 0.0, 0.0], np.zeros((20, 4))).cost, float)


def adaptation(model: hydroid.Model) -> None:
    adapter = hydroid.Adapter(model, guard=False)
    assert_type(adapter.step(None, [1.0]).estimate, Array)
    assert_type(adapter.predict(np.ones((20, 1)), [1, 20]).band(0.95), tuple[Array, Array])
    assert_type(adapter.state, bytes)
