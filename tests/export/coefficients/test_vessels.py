"""The exported vessels move as hydroid's own, in Python and in Octave."""

import copy
import inspect
import json
import math
import pickle
import re

import numpy as np
import pytest

from conftest import VESSELS, load

RELATIVE = 1e-12


def largest(rows):
    return np.max(np.abs(np.array(rows)), axis=0) + 1e-300


def vehicle(name, module, *arguments, **options):
    return getattr(module, name)(*arguments, **options)


def run(vehicle, rows, dt, eta=(0.0,) * 6):
    """The loop of mainLoop.simulate of the Python Vehicle Simulator: nu and the positions after each sample."""
    eta, nu, u_actual = np.array(eta, float), vehicle.nu, vehicle.u_actual
    motion, positions = [], []
    for row in rows:
        nu, u_actual = vehicle.dynamics(eta, nu, u_actual, np.array(row, float), dt)
        eta[0] += dt * (math.cos(eta[5]) * nu[0] - math.sin(eta[5]) * nu[1])
        eta[1] += dt * (math.sin(eta[5]) * nu[0] + math.cos(eta[5]) * nu[1])
        eta[5] += dt * nu[5]
        motion.append(nu)
        positions.append(vehicle.positions)
    return np.array(motion), np.array(positions)


def test_a_vehicle_moves_as_the_model(vessel):
    name, module, golden = vessel
    motion, positions = run(vehicle(name, module), golden["commands"], golden["dt"])
    nu = np.array(golden["nu"])
    assert np.all(motion[:, 2:5] == 0.0)
    errors = np.abs(motion[:, [0, 1, 5]] - nu) / largest(nu)
    moved = np.abs(positions - np.array(golden["positions"])) / largest(golden["positions"])
    print(f"{name}: {errors.max():.1e} of the motion, {moved.max():.1e} of the positions")
    assert len(nu) == 1000 and errors.max() < RELATIVE and moved.max() < RELATIVE


def acceleration(name, module, nu, positions, command):
    """Equations of motion contain commands, vessels the positions of their actuators alone."""
    arguments = [np.array(nu), np.array(positions)] + ([np.array(command)] if name == "launch" else [])
    return module.acceleration(*arguments)


def test_accelerations_are_those_of_the_model(vessel):
    name, module, golden = vessel
    cases = zip(golden["nu"], golden["positions"], golden["commands"])
    rows = [acceleration(name, module, *case) for case in cases]
    errors = np.abs(np.array(rows) - np.array(golden["nu_dot"])) / largest(golden["nu_dot"])
    assert errors.max() < 1e-12


def test_a_run_continues_after_save_and_load(vessel):
    name, module, golden = vessel
    rows, dt = golden["commands"][:200], golden["dt"]
    whole, _ = run(vehicle(name, module), rows, dt)
    first = vehicle(name, module)
    half, _ = run(first, rows[:100], dt)
    state = pickle.loads(pickle.dumps(copy.deepcopy(vars(first))))
    second = vehicle(name, module)
    vars(second).update(state, nu=half[-1])
    rest, _ = run(second, rows[100:], dt)
    assert np.array_equal(np.vstack([half, rest]), whole)


def test_a_vehicle_has_what_the_python_vehicle_simulator_uses(vessel):
    name, module, golden = vessel
    boat = vehicle(name, module, "stepInput", golden["commands"][0], V_current=0.5, beta_current=30.0)
    for attribute in ["L", "B", "name", "controlDescription", "controls", "controlMode", "dimU", "V_c", "beta_c"]:
        assert hasattr(boat, attribute)
    assert len(boat.controls) == boat.dimU == len(boat.u_actual) == len(golden["commands"][0])
    assert list(inspect.signature(boat.dynamics).parameters) == ["eta", "nu", "u_actual", "u_control", "sampleTime"]
    assert boat.stepInput(0.0).tolist() == golden["commands"][0] and boat.nu.shape == (6,)
    with pytest.raises(ValueError, match="subclass"):
        vehicle(name, module, "headingAutopilot")
    with pytest.raises(ValueError, match="commands"):
        vehicle(name, module, "stepInput", [0.0] * 9)


def test_a_current_carries_a_vehicle(vessel):
    """The motion through the water does not depend on a uniform current."""
    name, module, golden = vessel
    rows, dt = golden["commands"][:200], golden["dt"]
    still, _ = run(vehicle(name, module), rows, dt)
    boat = vehicle(name, module, V_current=0.7, beta_current=40.0)
    heading = 0.3
    boat.nu = np.zeros(6)
    boat.nu[[0, 1, 5]] = boat.current(heading)
    carried, _ = run(boat, rows, dt, (0.0, 0.0, 0.0, 0.0, 0.0, heading))
    psi = heading + dt * np.cumsum(carried[:, 5])
    water = np.array([boat.current(angle) for angle in psi])
    assert np.allclose(carried[:, [0, 1, 5]] - water, still[:, [0, 1, 5]], rtol=0.0, atol=1e-9)


def rates(module, positions, command, h):
    """Rates of the positions of those servos that do not follow at once."""
    rows = []
    if hasattr(module, "LAGS"):
        return [(command[lag["command"]] - s) / lag["time"] for lag, s in zip(module.LAGS, positions)]
    for servo, position, order in zip(module.SERVOS, positions, module.settled(command)):
        if servo["lag"] == 0.0 and math.isinf(servo["rate"]):
            continue
        time = servo["lag"] or h
        rows.append(max(-servo["rate"], min(servo["rate"], (order - position) / time)))
    return rows


@pytest.mark.parametrize("name", VESSELS)
def test_the_function_for_matlab_has_the_rates_of_the_model(name, exported, octave):
    golden, module = json.loads((exported / f"{name}.json").read_text()), load(exported / f"{name}.py")
    text = (exported / f"{name}.m").read_text()
    found = re.search(r"kept\.moving = \[(.*)\];", text)
    moving = [int(k) - 1 for k in found.group(1).split()] if found else list(range(len(module.LAGS)))
    h, psi = 0.05, 0.4
    step = f", {h}" if found else ""
    states, expected = [], []
    # The commands of the next sample, so that the actuators move.
    following = golden["commands"][1:] + golden["commands"][:1]
    for nu, at, command in zip(golden["nu"], golden["positions"], following):
        positions = module.settled(command)
        positions[moving] = np.array(at)[moving]
        states.append([*nu, 1.0, 2.0, psi, *positions[moving]])
        kinematics = [math.cos(psi) * nu[0] - math.sin(psi) * nu[1], math.sin(psi) * nu[0] + math.cos(psi) * nu[1], nu[2]]
        nu_dot = acceleration(name, module, nu, positions, command)
        expected.append([*nu_dot, *kinematics, *rates(module, at, command, h), math.hypot(nu[0], nu[1])])
    np.savetxt(exported / f"{name}_states.txt", states, fmt="%.17g")
    np.savetxt(exported / f"{name}_commands.txt", following, fmt="%.17g")
    octave(exported, f"""
        states = load('{name}_states.txt'); commands = load('{name}_commands.txt');
        out = [];
        for k = 1:rows(states)
            [xdot, U] = {name}(states(k, :)', commands(k, :)'{step});
            out(k, :) = [xdot' U];
        end
        fid = fopen('{name}_rates.txt', 'w'); fprintf(fid, '%.17g\\n', out'); fclose(fid);
    """)
    found = np.loadtxt(exported / f"{name}_rates.txt").reshape(np.array(expected).shape)
    errors = np.abs(found - np.array(expected)) / largest(expected)
    print(f"{name}: {errors.max():.1e}")
    assert errors.max() < 1e-12


def test_the_function_for_matlab_refuses_other_dimensions(exported, octave):
    out = octave(exported, "try, otter(zeros(3, 1), [0; 0]); catch e, disp(e.message); end")
    assert "x must have dimension 8" in out
    out = octave(exported, "try, otter(zeros(8, 1), 0); catch e, disp(e.message); end")
    assert "ui must have dimension 2" in out
