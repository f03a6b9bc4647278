"""Model predictive control on the exported vessel, with hydroid's simulation of the same vessel as the plant."""

import sys
import types

import casadi as ca
import numpy as np
import pytest
from conftest import exports, load
from plant import Plant

# A circle around the origin, and the speed along it.
RADIUS = 6.0
SPEED = 1.0
# Samples for which a command is held, and commands of the horizon.
HELD = 5
COMMANDS = 12


def vessel(name):
    return load(next(folder for folder in exports() if folder.name == f"craft_{name}"))


def circle(t):
    """Position at a time: north, east."""
    angle = SPEED / RADIUS * np.asarray(t)
    return RADIUS * np.array([np.sin(angle), -np.cos(angle)])


def controller(model):
    """IPOPT on the positions at the ends of the held commands: a function of the state, the reference and a start."""
    opti = ca.Opti()
    low, high = (np.array([limits[k] for limits in model.INPUT_RANGES]) for k in (0, 1))
    scaled = opti.variable(len(model.INPUTS), COMMANDS)
    states = opti.variable(len(model.STATES) + 3, COMMANDS + 1)
    present = opti.parameter(len(model.STATES) + 3)
    reference = opti.parameter(2, COMMANDS)
    hold = model.step_with_pose.fold(HELD)
    middle, half = ca.DM(0.5 * (low + high)), ca.DM(0.5 * (high - low))
    opti.subject_to(states[:, 0] == present)
    opti.subject_to(opti.bounded(-1, ca.vec(scaled), 1))
    for k in range(COMMANDS):
        command = middle + half * scaled[:, k]
        opti.subject_to(states[:, k + 1] == hold(states[:, k], ca.repmat(command, 1, HELD)))
    place = len(model.STATES)
    change = scaled[:, 1:] - scaled[:, :-1]
    opti.minimize(ca.sumsqr(states[place : place + 2, 1:] - reference) + 1e-2 * ca.sumsqr(change))
    opti.solver("ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "sb": "yes"})

    warm = []

    def solve(x, positions):
        opti.set_value(present, x)
        opti.set_value(reference, positions)
        if not warm:
            opti.set_initial(states, ca.repmat(x, 1, COMMANDS + 1))
            # Ahead: the thrust is quadratic, and its derivative at the neutral command is zero.
            opti.set_initial(scaled, 0.3)
            warm.append(True)
        solution = opti.solve()
        opti.set_initial(solution.value_variables())
        command = np.array(solution.value(scaled))[:, 0]
        return middle + half * command

    return solve


def test_mpc_tracks_a_circle_on_the_simulation_of_hydroid():
    model = vessel("otter")
    solve = controller(model)
    command = np.array([sum(limits) / 2 for limits in model.INPUT_RANGES])
    # At rest, half a metre beside the start of the circle, with a wrong heading.
    x = ca.vertcat(model.start([0.0, 0.0, 0.0], command), [0.5, -RADIUS, 0.5])
    aside, apart = [], []
    with Plant("otter", np.array(x).ravel()[-3:], [0.0, 0.0, 0.0], command) as plant:
        turns = 1.2 * 2 * np.pi * RADIUS / SPEED
        for k in range(int(turns / (HELD * model.DT))):
            t = k * HELD * model.DT
            ahead = t + HELD * model.DT * np.arange(1, COMMANDS + 1)
            command = np.array(solve(x, circle(ahead))).ravel()
            for _ in range(HELD):
                plant.send(command)
                # The state of the actuators is that of the model; pose and velocities are measured.
                state = model.observe(model.step(x[:-3], command), plant.outputs)
                x = ca.vertcat(state, plant.pose)
            if t > 4.0:
                aside.append(abs(np.hypot(*plant.pose[:2]) - RADIUS))
                apart.append(np.hypot(*(plant.pose[:2] - circle(ahead[0]))))
    rms_aside, rms_apart = (np.sqrt(np.mean(np.square(distances))) for distances in (aside, apart))
    print(f"RMS distance from the circle {1e3 * rms_aside:.2f} mm, from the reference {1e3 * rms_apart:.2f} mm")
    assert len(aside) > 70 and rms_aside < 0.01 and rms_apart < 0.01


@pytest.mark.parametrize("discrete", [True, False])
def test_the_definition_for_do_mpc_runs_in_a_closed_loop(discrete):
    do_mpc = pytest.importorskip("do_mpc")
    model = vessel("otter")
    definition = model.do_mpc_model(with_pose=True, discrete=discrete)
    assert definition.model_type == ("discrete" if discrete else "continuous")
    mpc = do_mpc.controller.MPC(definition)
    mpc.settings.n_horizon = 15
    mpc.settings.t_step = model.DT
    mpc.settings.supress_ipopt_output()
    speed, course = definition.x["u"] - 0.8, definition.x["psi"] - 0.2
    mpc.set_objective(mterm=speed**2 + course**2, lterm=speed**2 + course**2)
    mpc.set_rterm(**dict.fromkeys(model.INPUT_IDS, 1e-8))
    for name, (low, high) in zip(model.INPUT_IDS, model.INPUT_RANGES):
        mpc.bounds["lower", "_u", name] = low
        mpc.bounds["upper", "_u", name] = high
    mpc.setup()
    command = np.array([sum(limits) / 2 for limits in model.INPUT_RANGES])
    x = ca.vertcat(model.start([0.3, 0.0, 0.0], command), [0.0, 0.0, 0.0])
    mpc.x0, mpc.u0 = np.array(x), command.reshape(-1, 1)
    mpc.set_initial_guess()
    with Plant("otter", [0.0, 0.0, 0.0], [0.3, 0.0, 0.0], command) as plant:
        for _ in range(40):
            command = mpc.make_step(np.array(x)).ravel()
            plant.send(command)
            x = ca.vertcat(model.observe(model.step(x[:-3], command), plant.outputs), plant.pose)
    assert abs(plant.outputs[0] - 0.8) < 0.05 and abs(plant.pose[2] - 0.2) < 0.05


def test_do_mpc_simulates_each_model_as_the_exported_step(folder):
    do_mpc = pytest.importorskip("do_mpc")
    model = load(folder)
    simulator = do_mpc.simulator.Simulator(model.do_mpc_model(discrete=True))
    simulator.set_param(t_step=model.DT)
    simulator.setup()
    command = np.array([0.7 * low + 0.3 * high for low, high in model.INPUT_RANGES])
    outputs = np.array([0.4 * low + 0.6 * high for low, high in model.OUTPUT_RANGES])
    x = model.start(outputs, command)
    simulator.x0 = np.array(x)
    for _ in range(3):
        found = simulator.make_step(command.reshape(-1, 1))
        x = model.step(x, command)
    assert np.allclose(found, np.array(x), rtol=1e-12, atol=1e-12)
    assert list(simulator.model.x.keys()) == list(model.STATE_IDS)


class AcadosModel:
    """The attributes that acados reads; acados_template is not in the Python package index."""

    def __init__(self):
        self.name = self.x = self.u = self.xdot = None
        self.f_expl_expr = self.f_impl_expr = self.disc_dyn_expr = None


def test_the_definition_for_acados_has_the_equations(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "acados_template", types.SimpleNamespace(AcadosModel=AcadosModel))
    model = load(folder)
    for with_pose in (False, True):
        definition = model.acados_model(with_pose)
        states = len(model.STATES) + (3 if with_pose else 0)
        assert definition.name == "vessel" and definition.x.shape == (states, 1)
        assert definition.u.shape == (len(model.INPUTS), 1)
        command = np.array([0.7 * low + 0.3 * high for low, high in model.INPUT_RANGES])
        outputs = [0.4 * low + 0.6 * high for low, high in model.OUTPUT_RANGES]
        x = ca.vertcat(model.start(outputs, command), [1.0, 2.0, 0.3][: 3 if with_pose else 0])
        step = ca.Function("step", [definition.x, definition.u], [definition.disc_dyn_expr])
        expected = (model.step_with_pose if with_pose else model.step)(x, command)
        assert np.array_equal(np.array(step(x, command)), np.array(expected))
        if model.rates is None:
            assert definition.f_expl_expr is None and definition.f_impl_expr is None
            continue
        rates = ca.Function("rates", [definition.x, definition.u], [definition.f_expl_expr])(x, command)
        arguments = [definition.xdot, definition.x, definition.u]
        residual = ca.Function("residual", arguments, [definition.f_impl_expr])
        assert np.array_equal(np.array(residual(rates, x, command)), np.zeros((states, 1)))
        own = x[: len(model.STATES)]
        assert np.array_equal(np.array(rates)[: len(model.STATES)], np.array(model.rates(own, command)))
        if with_pose:
            u, v, r = np.array(model.output(own)).ravel()[list(model.MOTION)]
            sin, cos = np.sin(0.3), np.cos(0.3)
            assert np.allclose(np.array(rates).ravel()[-3:], [u * cos - v * sin, u * sin + v * cos, r], rtol=1e-14)


def test_a_model_without_motion_has_no_pose(folder, tmp_path):
    """The reason stands in the file."""
    text = (folder / "vessel.py").read_text()
    motion = next(line for line in text.splitlines() if line.startswith("MOTION = "))
    text = text.replace(motion, "MOTION = None").replace("NO_MOTION = None", 'NO_MOTION = "no output r"')
    (tmp_path / "vessel.py").write_text(text)
    model = load(tmp_path)
    assert model.step_with_pose is None and model.rates_with_pose is None
    for build in (model.jacobians, model.do_mpc_model, lambda **options: model.rollout(3, **options)):
        with pytest.raises(ValueError, match="no pose: no output r"):
            build(with_pose=True)
    assert model.rollout(3) is not None
