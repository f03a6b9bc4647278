"""Closed loops, controllers on board and the planner."""

import inspect
import json
import math
import os
import pickle
import subprocess
import threading
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hydroid
from conftest import CHANNELS
from test_random import anything, refused

SHORT = {"controller": "fl", "speed": 4.0, "radius": 30.0, "seed": 3}


def command(*words):
    """The command with arguments; the test is skipped without it."""
    path = os.environ.get("HYDROID_COMMAND")
    if not path:
        pytest.skip("no HYDROID_COMMAND")
    return [path, *words]


def told(folder, *words):
    run = subprocess.run(command("control", *words, "--json", "-q"), capture_output=True, cwd=folder)
    assert run.returncode in (0, 1), run.stderr.decode()
    return json.loads(run.stdout), run.returncode


def timeless(document):
    """A document without computing times."""
    document = json.loads(json.dumps(document))
    document.pop("us_per_command", None)
    for trial in document.get("trials", []):
        trial["metrics"].pop("us_per_command")
    return document


@pytest.fixture(scope="module")
def hydrofoil():
    return hydroid.Model.load("hydrofoil")


@pytest.fixture(scope="module")
def records():
    """Runs of the vessel ``simple``, along which the commands change at random."""
    rng, dt = np.random.default_rng(1), 0.1
    vessel, logs = hydroid.Model.load("simple"), []
    low, high = np.array([vessel.ranges[name] for name in vessel.input_names]).T
    for _ in range(3):
        session = vessel.session()
        session.observe(np.array([1.0, 0.0, 0.0, 0.0])[: len(vessel.output_names)])
        rows, c = [], 0.5 * (low + high)
        for k in range(1500):
            if k % 30 == 0:
                c = rng.uniform(low, high)
                c[0] = abs(c[0])
            rows.append([k * dt, *(session.output[:3] + rng.normal(0.0, [0.005, 0.005, 0.002])), *c])
            session.advance(c)
        t, u, v, r, *inputs = np.array(rows).T
        columns = {"t [s]": t, "u [m/s]": u, "v [m/s]": v, "r [rad/s]": r, **dict(zip(vessel.input_names, inputs))}
        logs.append(hydroid.Log(columns))
    return logs


def identify(logs, file, **options):
    """The file of equations of the vessel."""
    inputs = hydroid.Model.load("simple").input_names
    found = hydroid.identify(logs, outputs="u,v,r", inputs=inputs, methods="sindy", horizon=20, **options)
    found.models["sindy"].save(file)
    return file


@pytest.fixture(scope="module")
def identified(records, tmp_path_factory):
    return identify(records, tmp_path_factory.mktemp("identified") / "sindy.safetensors")


@pytest.mark.parametrize(
    "words, options",
    [
        ("hydrofoil --controller fl --speed 4 --radius 30 --seed 3", SHORT),
        (
            "hydrofoil --controller fl --runs 3 --duration 60 --mass-variation 0.1",
            {"controller": "fl", "runs": 3, "duration": "1m", "mass_variation": 0.1},
        ),
        (
            "hydrofoil --task waypoints --points 0,0;40,0;40,30 --speed 3 --turn-speed 1.5 --candidates 40 "
            "--cost-weights 1,0.1,0.3 --current 0.1,-0.2 --gusts 10,4 --delay 0.2 --limit RD_ang=-20:20[deg] "
            "--rate-limit RD_ang=0.5 --horizon 15",
            {
                "task": "waypoints", "points": np.array([[0, 0], [40, 0], [40, 30]]), "speed": 3, "turn_speed": 1.5,
                "candidates": 40, "cost_weights": (1, 0.1, 0.3), "current": [0.1, -0.2], "gusts": (10, 4), "delay": 0.2,
                "limit": {"RD_ang": "-20:20 [deg]"}, "rate_limit": {"RD_ang": 0.5}, "horizon": np.int64(15),
            },
        ),
        (
            "hydrofoil --controller pid --task lawn-mower --legs 2 --leg 40 --speed 3 --turn-speed 1.5",
            {"controller": "pid", "task": "lawn-mower", "legs": 2, "leg": 40, "speed": 3, "turn_speed": 1.5},
        ),
        (
            "hydrofoil --controller backstepping --speed 2.5 --radius 25 --mass 1.2 --onset 30s --noise 0.5 --start 0,-1",
            {
                "controller": "backstepping", "speed": 2.5, "radius": 25, "mass": 1.2, "onset": 30.0, "noise": 0.5,
                "start": (0, -1),
            },
        ),
    ],
)
def test_the_document_is_that_of_the_command(words, options, tmp_path):
    document, status = told(tmp_path, *words.split(" "))
    loop = hydroid.control("hydrofoil", **options)
    assert timeless(loop.document) == timeless(document)
    assert loop.held == (status == 0)


def test_an_identified_model_adapts_as_with_the_command(identified, tmp_path):
    words = f"{identified} --plant simple --adapt --learner kalman --duration 20 --radius 12 --candidates 30"
    document, _ = told(tmp_path, *words.split(" "))
    options = {"adapt": True, "learner": "kalman", "duration": 20, "radius": 12, "candidates": 30}
    loop = hydroid.control("simple", identified, **options)
    assert timeless(loop.document) == timeless(document)
    # The model may be an object as well; its name is then that of the model.
    again = hydroid.control("simple", hydroid.Model.load(identified), **options)
    assert again.document["controller"]["model"] == "sindy"
    np.testing.assert_array_equal(again.track.commands, loop.track.commands)


def test_a_vessel_holds_a_circle_and_writes_its_files(tmp_path):
    loop = hydroid.control("hydrofoil", **SHORT)
    track, metrics = loop.track, loop.metrics
    assert loop.held and metrics["held"] and metrics["rms_position"] < 0.005 and loop.trials == []
    samples = len(track.t)
    assert samples == 1200 and sum(metrics["status"].values()) == samples == len(track.status)
    assert track.pose.shape == track.velocities.shape == track.reference.shape == (samples, 3)
    assert track.commands.shape == (samples, len(track.input_names))
    assert track.outputs.shape == (samples, len(track.output_names))
    # The reference is a circle of 30 m at 4 m/s, and the controlled point 1.5 m ahead is on it.
    np.testing.assert_allclose(np.hypot(*track.reference[:, :2].T), 30.0, atol=1e-9)
    np.testing.assert_allclose(track.reference_speed, 4.0)
    lead = loop.document["controller"]["lead_m"]
    point = track.pose[:, :2] + lead * np.column_stack([np.cos(track.pose[:, 2]), np.sin(track.pose[:, 2])])
    np.testing.assert_allclose(np.hypot(*(point - track.reference[:, :2]).T), track.distance, atol=1e-9)
    assert np.abs(np.hypot(*point[400:].T) - 30.0).max() < 0.05
    counted = track.distance[track.t >= metrics["from_s"] - 1e-9]
    assert math.sqrt((counted**2).mean()) == pytest.approx(metrics["rms_position"])

    loop.save(tmp_path / "run")
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["control.json", "report.html", "track.csv"]
    assert json.loads((tmp_path / "run" / "control.json").read_text()) == loop.document
    assert "north [m]" in (tmp_path / "run" / "report.html").read_text()
    frame = loop.to_pandas()
    assert list(frame["status"]) == track.status
    np.testing.assert_array_equal(frame["x [m]"], track.pose[:, 0])
    # The track is a log, and a run.
    again = hydroid.read_log(tmp_path / "run" / "track.csv")
    np.testing.assert_array_equal(again["distance"], track.distance)
    np.testing.assert_array_equal(loop.run.inputs, track.commands)
    assert "fl on Hydrofoil" in repr(loop) or "fl on" in repr(loop)


def test_equal_seeds_give_equal_tracks_on_any_number_of_threads():
    options = {"duration": 5, "candidates": 20, "runs": 3}
    one, two = (hydroid.control("hydrofoil", seed=7, threads=threads, **options) for threads in (1, 2))
    other = hydroid.control("hydrofoil", seed=8, **options)
    np.testing.assert_array_equal(one.track.commands, two.track.commands)
    assert timeless(one.document) == timeless(two.document)
    assert len(one.trials) == 3 and "3 trials" in repr(one)
    assert (one.track.commands != other.track.commands).any()


def test_a_station_is_held_by_predictive_control():
    loop = hydroid.control("hydrofoil", task="station", points=[(20, -5)], heading=30, duration=40)
    assert loop.held and np.abs(loop.track.pose[-1, :2] - [20, -5]).max() < 2.0
    assert loop.track.pose[-1, 2] == pytest.approx(math.radians(30), abs=0.3)
    with pytest.raises(ValueError, match='task="station" needs controller="cem"'):
        hydroid.control("hydrofoil", controller="fl", task="station")


@pytest.mark.parametrize(
    "options, error, words",
    [
        ({"speeed": 3}, TypeError, "speeed"),
        ({"controller": "lqr"}, ValueError, "controller.*lqr|lqr.*controller"),
        ({"task": "square"}, ValueError, "task.*square|square.*task"),
        ({"speed": "fast"}, ValueError, "speed"),
        ({"speed": object()}, TypeError, "speed: expected numbers"),
        ({"radius": -1.0}, ValueError, "radius"),
        ({"bandwidth": (1.0, 0.7)}, ValueError, 'bandwidth needs controller="fl"'),
        ({"duration": "soon"}, ValueError, "duration"),
        ({"limit": {"RD": (0, 1)}}, ValueError, "limit: the plant has no command 'RD'.*RD_ang"),
        ({"limit": (0, 1)}, ValueError, "limit: invalid type: sequence"),
        ({"mass_variation": 0.1}, ValueError, "mass_variation applies to Monte Carlo trials: add runs"),
        ({"guard": False}, ValueError, "guard is an option of the adaptation: add adapt=True"),
        ({"training_log": "a.csv"}, ValueError, "training_log is an option of the adaptation"),
        ({"learner": "kalman"}, ValueError, "learner is an option of the adaptation"),
        ({"points": [[0, 0]]}, ValueError, 'points needs task="waypoints"'),
        ({"threads": 0}, ValueError, "threads"),
        ({"delay": 0.05}, ValueError, "delay"),
    ],
)
def test_wrong_options_are_named(options, error, words):
    with pytest.raises(error, match=words):
        hydroid.control("hydrofoil", **options)


def test_plants_that_are_none_are_refused():
    with pytest.raises(TypeError, match="plant: expected a Model or a path, got int"):
        hydroid.control(3)
    with pytest.raises(TypeError, match="model: expected a Model or a path, got list"):
        hydroid.control("hydrofoil", [])
    with pytest.raises(FileNotFoundError):
        hydroid.control("none.safetensors")


def test_ctrl_c_ends_a_simulation(ctrl_c):
    with pytest.raises(KeyboardInterrupt):
        hydroid.control("hydrofoil", runs=1_000_000)


def test_progress_is_reported_and_the_lock_is_released():
    fractions, counted, stop = [], [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    hydroid.control("hydrofoil", duration=20, progress=fractions.append)
    stop.set()
    thread.join()
    assert fractions == sorted(fractions) and 0.0 < max(fractions) <= 1.0 and counted[0] > 20
    with pytest.raises(ZeroDivisionError):
        hydroid.control("hydrofoil", runs=1000, progress=lambda fraction: 1 / 0)


def test_a_guard_has_options(model, files):
    guard = hydroid.Guard(horizon=20, stride=5, window=200, factor=1.5)
    assert guard == pickle.loads(pickle.dumps(guard)) and guard.gate is None
    [run] = hydroid.prepare(files[3], **CHANNELS)
    states = []
    for given in (True, hydroid.Guard(), guard, False):
        adapter = hydroid.Adapter(model, guard=given)
        for k in range(1, 300):
            step = adapter.step(run.inputs[k - 1] if k > 1 else None, run.outputs[k])
        assert (step.predicted_by is None) == (given is False)
        states.append(adapter.state)
    # Without options the guard has its defaults; others are other guards.
    assert states[0] == states[1] and len({len(state) for state in states[1:]}) >= 2
    with pytest.raises(ValueError, match="state: expected"):
        hydroid.Adapter(model).state = states[2]
    with pytest.raises(ValueError, match="stride"):
        hydroid.Adapter(model, guard=hydroid.Guard(horizon=20, stride=30))
    with pytest.raises(TypeError, match="guard: expected True, False or a Guard, got str"):
        hydroid.Adapter(model, guard="yes")
    with pytest.raises(ValueError, match="^guard.factor: invalid type"):
        hydroid.Adapter(model, guard=hydroid.Guard(factor="large"))


def test_the_guard_of_a_loop(identified):
    options = {"adapt": True, "duration": 15, "radius": 12, "candidates": 20}
    tracks = [
        hydroid.control("simple", identified, guard=guard, **options).track.commands
        for guard in (True, hydroid.Guard(), False)
    ]
    np.testing.assert_array_equal(tracks[0], tracks[1])
    with pytest.raises(ValueError, match="guard"):
        hydroid.control("simple", identified, guard=hydroid.Guard(factor=0.5), **options)


def sail(model, controller, samples, pose=(0.0, 0.0, 0.0)):
    """The vessel under the commands of a controller: `(lines, steps)`."""
    session = model.session()
    session.observe(np.zeros(len(model.output_names)))
    x, y, psi = pose
    lines, steps = [], []
    for k in range(samples):
        u, v, r = session.output[:3]
        lines.append({"t": round(0.1 * k, 3), "x": x, "y": y, "psi": psi, "u": u, "v": v, "r": r})
        outputs = np.full(len(controller.output_names), np.nan)
        outputs[:3] = u, v, r
        steps.append(controller.step([x, y, psi], outputs))
        session.advance(steps[-1].command)
        dt, middle = 0.1, psi + 0.05 * r
        x, y = x + dt * (u * math.cos(middle) - v * math.sin(middle)), y + dt * (u * math.sin(middle) + v * math.cos(middle))
        psi += dt * r
    return lines, steps


def answers(folder, lines, *words):
    """Commands and statuses of the control service."""
    stream = "\n".join(json.dumps(line) for line in lines) + "\n"
    run = subprocess.run(command("control", *words, "-q", "-"), input=stream.encode(), capture_output=True, cwd=folder)
    assert run.returncode == 0, run.stderr.decode()
    # The neutral commands after the end of the input answer no line.
    given = [answer for answer in map(json.loads, run.stdout.splitlines()) if answer["status"] != "lost"]
    given = [answer for answer in given if "command" in answer]
    return [(answer["command"], answer["control"]) for answer in given]


def assert_equal_steps(steps, answered, names):
    assert len(answered) == len(steps)
    for (values, status), step in zip(answered, steps):
        assert list(values) == names
        np.testing.assert_allclose(list(values.values()), step.command, rtol=1e-5, atol=1e-6)
        assert status == step.status


@pytest.mark.parametrize("law", ["cem", "fl", "pid"])
def test_a_controller_gives_the_commands_of_the_service(hydrofoil, law, tmp_path):
    options = {"controller": law, "task": "waypoints", "points": [(0, 0), (60, 0), (60, 40)], "speed": 3, "seed": 5}
    controller = hydroid.Controller("hydrofoil", **options)
    lines, steps = sail(hydrofoil, controller, 80)
    words = ["hydrofoil", "--controller", law, "--task", "waypoints", "--points", "0,0;60,0;60,40"]
    words += ["--speed", "3", "--seed", "5"]
    assert_equal_steps(steps, answers(tmp_path, lines, *words), controller.input_names)


def test_commands_on_their_way_are_those_of_the_service(records, tmp_path):
    """A model with an input delay sees each command as much later, and adapts."""
    file = identify(records, tmp_path / "late.safetensors", log={"input_delay": 3})
    # No vessel is commanded by the ranges of a log.
    with pytest.raises(ValueError, match="neutral"):
        hydroid.Controller(file, radius=12)
    seen = hydroid.Planner(hydroid.Model.load(file)).limits
    stated = {
        "limit": {name: (of.low, of.high) for name, of in seen.items()},
        "neutral": {name: of.rest for name, of in seen.items()},
    }
    controller = hydroid.Controller(file, radius=12, candidates=20, adapt=True, **stated)
    again = hydroid.Controller(file, radius=12, candidates=20, adapt=True, **stated)
    vessel = hydroid.Model.load("simple")
    lines, steps = sail(vessel, controller, 60, pose=(12.0, 0.0, math.pi / 2))
    words = [str(file), "--radius", "12", "--candidates", "20", "--adapt"]
    for name, of in seen.items():
        words += ["--limit", f"{name}={of.low!r}:{of.high!r}", "--neutral", f"{name}={of.rest!r}"]
    assert_equal_steps(steps, answers(tmp_path, lines, *words), controller.input_names)
    # The state has the commands on their way.
    again.state = controller.state
    for of in (controller, again):
        steps.append(of.step([12.0, 5.0, 2.0], [1.0, 0.0, 0.1]))
    np.testing.assert_array_equal(steps[-1].command, steps[-2].command)
    np.testing.assert_array_equal(again.weights, controller.weights)


def test_a_controller_follows_its_path_and_its_state_is_kept(hydrofoil):
    options = {"task": "waypoints", "points": [(0, 0), (40, 0), (40, 30)], "speed": 2, "candidates": 40}
    controller = hydroid.Controller(hydrofoil, **options)
    assert controller.dt == 0.1 and controller.input_names == hydrofoil.input_names
    _, steps = sail(hydrofoil, controller, 600)
    arrived = next(k for k, step in enumerate(steps) if step.arrived)
    assert arrived > 300 and steps[-1].arrived
    assert max(step.distance for step in steps[100:arrived]) < 0.5
    low, high = np.array([[of.low, of.high] for of in controller.limits.values()]).T
    assert all(((low <= step.command) & (step.command <= high)).all() for step in steps)

    one, two = hydroid.Controller(hydrofoil, **options), hydroid.Controller(hydrofoil, **options)
    lines, _ = sail(hydrofoil, one, 50)
    two.state = one.state
    outputs = np.full(len(one.output_names), np.nan)
    for k in range(20):
        outputs[:3] = 2.0, 0.0, 0.01 * k
        a, b = (of.step([10.0 + 0.2 * k, 0.1, 0.0], outputs) for of in (one, two))
        np.testing.assert_array_equal(a.command, b.command)
        assert a.status == b.status
    np.testing.assert_array_equal(one.planned(3)[0], a.command)
    with pytest.raises(ValueError, match="state: expected .* got that of another"):
        hydroid.Controller(hydrofoil, **{**options, "speed": 2.5}).state = one.state
    with pytest.raises(ValueError, match="state: expected .* got a damaged one"):
        two.state = one.state[:-3]


def test_a_controller_bridges_missing_poses_and_gaps(hydrofoil):
    controller = hydroid.Controller(hydrofoil, controller="fl", speed=3)
    outputs = np.array([3.0, 0.0, 0.0, np.nan])[: len(controller.output_names)]
    controller.step([0.0, 15.0, 0.0], outputs)
    bridged = controller.step([np.nan] * 3, outputs)
    np.testing.assert_allclose(bridged.pose, [0.3, 15.0, 0.0], atol=1e-6)
    assert bridged.status != "blind" and np.isfinite(bridged.command).all()
    assert controller.step([np.nan] * 3, outputs, gap_s=20.0).status == "blind"
    assert controller.step([0.3, 15.0, 0.0], outputs, samples=3).status != "blind"
    with pytest.raises(ValueError, match="samples: expected 1 to 10"):
        controller.step([0.0] * 3, outputs, samples=100)
    with pytest.raises(ValueError, match="gap_s: expected"):
        controller.step([0.0] * 3, outputs, gap_s=-1.0)
    with pytest.raises(ValueError, match="pose: expected shape"):
        controller.step([0.0] * 2, outputs)
    with pytest.raises(ValueError, match="outputs: expected shape"):
        controller.step([0.0] * 3, [1.0])


def test_options_of_simulations_are_no_options_on_board(hydrofoil):
    with pytest.raises(ValueError, match="noise belongs to a simulated run"):
        hydroid.Controller(hydrofoil, noise=0.5)
    with pytest.raises(TypeError, match="unexpected keyword argument 'nose'"):
        hydroid.Controller(hydrofoil, nose=0.5)


def test_a_controller_adapts_on_board(identified):
    model, vessel = hydroid.Model.load(identified), hydroid.Model.load("simple")
    limit, neutral = {"PP_cmd": (-130, 240), "RD_cmd": (-25, 25)}, {"PP_cmd": 0, "RD_cmd": 0}
    options = {"radius": 12, "candidates": 20, "limit": limit, "neutral": neutral}
    frozen = hydroid.Controller(model, **options)
    # Without a guard, which would first test the adapted weights.
    adaptive = hydroid.Controller(model, adapt=True, guard=False, **options)
    before = [of.weights.copy() for of in (frozen, adaptive)]
    for of in (frozen, adaptive):
        sail(vessel, of, 150, pose=(12.0, 0.0, math.pi / 2))
    np.testing.assert_array_equal(frozen.weights, before[0])
    assert (adaptive.weights != before[1]).any() and np.isfinite(adaptive.weights).all()


def test_a_planner_steers_to_a_reference(hydrofoil):
    planners = [hydroid.Planner(hydrofoil, horizon=25, candidates=80, seed=seed) for seed in (0, 0, 1)]
    dt, results = hydrofoil.dt, []
    for planner in planners:
        session = hydrofoil.session()
        session.observe(np.array([2.0, 0.0, 0.0, np.nan])[: len(hydrofoil.output_names)])
        session.observe(np.append([2.0, 0.0, 0.0], np.zeros(len(hydrofoil.output_names) - 3)))
        x, y, psi, plans = 0.0, 1.0, 0.0, []
        for k in range(int(12 / dt)):
            ahead = dt * (k + 1 + np.arange(planner.horizon))
            reference = np.column_stack([2.0 * ahead, np.zeros_like(ahead), np.zeros_like(ahead), np.full_like(ahead, 2.0)])
            plan = planner.plan(session, [x, y, psi], reference)
            np.testing.assert_array_equal(plan.commands[0], plan.command)
            assert plan.commands.shape == (25, len(hydrofoil.input_names)) and plan.outputs.shape[0] == 25
            u, v, r = session.output[:3]
            session.advance(plan.command)
            np.testing.assert_allclose(plan.outputs[0], session.output, rtol=1e-9, atol=1e-12)
            middle = psi + 0.5 * dt * r
            x += dt * (u * math.cos(middle) - v * math.sin(middle))
            y += dt * (u * math.sin(middle) + v * math.cos(middle))
            psi += dt * r
            plans.append(plan)
        assert abs(y) < 0.2 and abs(session.output[0] - 2.0) < 0.2
        results.append(np.array([plan.command for plan in plans]))
    np.testing.assert_array_equal(results[0], results[1])
    assert (results[0] != results[2]).any()
    assert (results[0] >= [of.low for of in planners[0].limits.values()]).all()


def test_a_planner_keeps_its_limits_and_refuses_wrong_arguments(hydrofoil, model):
    name = hydrofoil.input_names[1]
    planner = hydroid.Planner(hydrofoil, horizon=10, hold=3, limit={name: (-0.1, 0.1)}, rate_limit={name: 0.2})
    session = hydrofoil.session()
    session.observe(np.append([2.0, 0.0, 0.0], np.zeros(len(hydrofoil.output_names) - 3)))
    reference = np.tile([0.0, 40.0, math.pi / 2, 2.0], (10, 1))
    last = np.array([0.0])
    for k in range(6):
        plan = planner.plan(session, [0.0, 0.0, 0.0], reference)
        assert plan.commands.shape[0] == plan.outputs.shape[0] == 30
        rows = np.concatenate([last, plan.commands[:, 1]])
        assert np.abs(rows).max() <= 0.1 and np.abs(np.diff(rows)).max() <= 0.2 * hydrofoil.dt + 1e-12
        assert (plan.rollouts > 0) == (k % 3 == 0)
        last = plan.command[1:]
        session.advance(plan.command)
    planner.reset()
    with pytest.raises(ValueError, match=r"reference: expected shape \(horizon = 10, columns = 4\)"):
        planner.plan(session, [0.0] * 3, reference[:5])
    with pytest.raises(ValueError, match="session: expected a session of the model"):
        planner.plan(model.session(), [0.0] * 3, reference)
    with pytest.raises(ValueError, match="model: expected the outputs u, v, r first"):
        hydroid.Planner(model)
    with pytest.raises(ValueError, match="limit: expected some of"):
        hydroid.Planner(hydrofoil, limit={"x": (0, 1)})
    with pytest.raises(ValueError, match="candidates, horizon and hold"):
        hydroid.Planner(hydrofoil, horizon=10**6, candidates=10**6)
    with pytest.raises(ValueError, match="horizon"):
        hydroid.Planner(hydrofoil, horizon=0)


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True)
@given(data=st.data())
def test_no_argument_crashes_the_interpreter(hydrofoil, steered, data):
    controller, planner, session, state = steered
    x, y = data.draw(anything), data.draw(anything)
    option = data.draw(st.sampled_from(sorted(OPTIONS)))
    calls = {
        "control": lambda: hydroid.control("hydrofoil", **{"controller": "fl", "duration": 1, "dt": 0.5, option: x}),
        "plant": lambda: hydroid.control(x, y),
        "guard": lambda: hydroid.control("hydrofoil", duration=1, adapt=True, guard=x),
        "controller": lambda: hydroid.Controller(hydrofoil, **{option: x}),
        "step": lambda: controller.step(x, y),
        "samples": lambda: controller.step([0.0] * 3, [1.0] * len(controller.output_names), samples=x, gap_s=y),
        "planned": lambda: controller.planned(x),
        "state": lambda: setattr(controller, "state", x),
        "cut state": lambda: setattr(controller, "state", state[: hash(str(x)) % len(state)]),
        "planner": lambda: hydroid.Planner(hydrofoil, cost_weights=x, limit=y),
        "plan": lambda: planner.plan(session, x, y),
    }
    try:
        calls[data.draw(st.sampled_from(sorted(calls)))]()
    except refused as error:
        assert "defect" not in str(error)


# Numbers of these could make a valid call that takes hours.
OPTIONS = set(inspect.signature(hydroid.control).parameters) - {
    "plant", "model", "threads", "runs", "duration", "horizon", "hold", "candidates", "iterations", "gauss_newton_steps",
    "legs", "dt",
}


@pytest.fixture(scope="module")
def steered(hydrofoil):
    controller = hydroid.Controller(hydrofoil, candidates=10)
    return controller, hydroid.Planner(hydrofoil, horizon=5, candidates=10), hydrofoil.session(), controller.state
