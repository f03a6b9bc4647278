"""Exported models in CasADi against the predictions of hydroid."""

import ast
import ctypes
import subprocess
import sys
import types

import casadi as ca
import numpy as np
import pytest

from conftest import load, run_of


def difference(found, expected):
    """Largest difference, relative to the largest magnitude of each output; a row for each sample."""
    assert found.shape == expected.shape and np.isfinite(found).all()
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-3)
    return (np.abs(found - expected).max(axis=0) / scale).max()


def models(exports):
    found = [(folder, load(folder / "vessel.py")) for folder in sorted(exports.iterdir())]
    assert len(found) > 40
    return found


def followed(model, run):
    """The state after the measurements."""
    n, m = len(model.OUTPUTS), len(model.INPUTS)
    x = model.start(run["first"], run["held"])
    for c, y in zip(run["along"].reshape(-1, m), run["measured"].reshape(-1, n)):
        x = model.observe(model.step(x, c), y)
    return np.array(x).ravel()


def test_rollouts_are_those_of_hydroid(exports):
    for folder, model in models(exports):
        run = run_of(folder)
        n, m = len(model.OUTPUTS), len(model.INPUTS)
        x = followed(model, run)
        ahead, expected = run["ahead"].reshape(-1, m), run["predicted"].reshape(-1, n)
        found = np.array(model.rollout(len(ahead))(x, ahead.T)).T
        assert difference(found, expected) < 1e-12, folder.name
        # Step by step, with the state written and read in the middle.
        for k, c in enumerate(ahead[:20]):
            if k == 10:
                x = np.frombuffer(np.array(x).ravel().tobytes())
            x = model.step(x, c)
        stepped = np.array(model.output(x)).reshape(1, n)
        scale = np.maximum(np.abs(expected).max(axis=0), 1e-3)
        assert (np.abs(stepped[0] - run["stepped"]) / scale).max() < 1e-12, folder.name


def test_derivatives_are_exact(exports):
    for folder, model in models(exports):
        run = run_of(folder)
        x, c = followed(model, run), run["ahead"][: len(model.INPUTS)]
        for function in filter(None, [model.step, model.rates]):
            matrices = [np.array(matrix) for matrix in model.jacobians(function)(x, c)]
            for matrix, at in zip(matrices, range(2)):
                assert np.isfinite(matrix).all(), folder.name
                for j in range(matrix.shape[1]):
                    point = [x, c]
                    if abs(point[at][j]) > 1e300:  # without a limit
                        continue
                    h = 1e-6 * max(1.0, abs(point[at][j]))
                    sides = []
                    for sign in (1, -1):
                        moved = [x.copy(), c.copy()]
                        moved[at][j] += sign * h
                        sides.append(np.array(function(*moved)).ravel())
                    slope = (sides[0] - sides[1]) / (2 * h)
                    tolerance = 1e-4 * (1 + np.abs(matrix).max())
                    # Away from kinks; a few places of a model are next to one.
                    far = np.abs(slope - matrix[:, j]) > tolerance
                    assert far.mean() <= 0.1, (folder.name, at, j)


def test_names_are_text(exports):
    hostile = load(exports / "hostile" / "vessel.py")
    assert len(hostile.OUTPUTS) == 3 and "os.abort" in hostile.OUTPUTS[0]
    for folder, _ in models(exports):
        tree = ast.parse((folder / "vessel.py").read_text())
        for node in tree.body:
            allowed = (ast.Expr, ast.Import, ast.Assign, ast.FunctionDef)
            assert isinstance(node, allowed), (folder.name, ast.dump(node)[:80])


def test_acados_definition(exports, monkeypatch):
    """acados is a C library, and not on PyPI: a stand-in for its class shows that the definition is complete."""
    stand_in = types.ModuleType("acados_template")
    stand_in.AcadosModel = type("AcadosModel", (), {})
    monkeypatch.setitem(sys.modules, "acados_template", stand_in)
    model = load(exports / "craft_otter" / "vessel.py")
    definition = model.acados_model(with_pose=True)
    assert definition.name == "vessel" and definition.x.shape == (3 + len(model.STATES), 1)
    f = ca.Function("f", [definition.x, definition.u], [definition.f_expl_expr, definition.disc_dyn_expr])
    x, c = np.zeros(definition.x.shape[0]), np.array([1600.0, 1500.0])
    rates, after = f(x, c)
    assert np.isfinite(np.array(rates)).all() and np.isfinite(np.array(after)).all()


@pytest.mark.filterwarnings("ignore")
def test_do_mpc_definition(exports):
    """A small closed loop of do-mpc turns the vessel to a heading."""
    import do_mpc

    module = load(exports / "craft_otter" / "vessel.py")
    model = module.do_mpc_model(with_pose=True)
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step = 30, module.DT
    mpc.settings.supress_ipopt_output()
    heading = 0.5
    cost = (model.x["pose", 2] - heading) ** 2 + 0.1 * (model.aux["outputs"][0] - 0.8) ** 2
    mpc.set_objective(mterm=cost, lterm=cost)
    mpc.set_rterm(command=1e-6)
    mpc.bounds["lower", "_u", "command"], mpc.bounds["upper", "_u", "command"] = 1100.0, 1900.0
    mpc.setup()
    x = np.concatenate([np.zeros(3), np.array(module.start([0.5, 0, 0], [1600, 1600])).ravel()]).reshape(-1, 1)
    mpc.x0, mpc.u0 = x, np.array([[1600.0], [1600.0]])
    mpc.set_initial_guess()
    step = module.step_with_pose()
    for _ in range(60):
        x = np.array(step(x, mpc.make_step(x)))
    assert abs(x[2, 0] - heading) < 0.1, x[:3]


class Plant:
    """A vessel in exported C, which is compared with hydroid elsewhere, with its pose."""

    def __init__(self, folder, target, outputs, command):
        library = target / "vessel.so"
        subprocess.run(["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", library, folder / "vessel.c", "-lm"], check=True)
        self.c = ctypes.CDLL(str(library))
        self.state = (ctypes.c_double * 64)()
        self.pose = np.zeros(3)
        self.c.vessel_init(self.state, self.array(outputs), self.array(command))

    @staticmethod
    def array(numbers):
        return (ctypes.c_double * len(numbers))(*numbers)

    def output(self):
        y = (ctypes.c_double * 3)()
        self.c.vessel_output(self.state, y)
        return np.array(y)

    def step(self, command, dt):
        u, v, r = self.output()
        # Finer than the model: the heading at the middle of the sample.
        psi = self.pose[2] + 0.5 * r * dt
        self.c.vessel_step(self.state, self.array(command), ctypes.c_double(dt))
        self.pose += dt * np.array([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r])


def test_predictive_control_tracks_a_circle(exports, tmp_path):
    """Model predictive control with IPOPT: the Otter follows a circle of 10 m at 1 m/s."""
    folder = exports / "craft_otter"
    model = load(folder / "vessel.py")
    radius, speed, horizon, dt = 10.0, 1.0, 25, model.DT
    hold = 2  # samples with one command
    step = model.step_with_pose()
    x = ca.MX.sym("x", 3 + len(model.STATES))
    u = ca.MX.sym("u", len(model.INPUTS))
    after = x
    for _ in range(hold):
        after = step(after, u)
    hold_step = ca.Function("hold", [x, u], [after])

    opti = ca.Opti()
    states = opti.variable(3 + len(model.STATES), horizon + 1)
    commands = opti.variable(len(model.INPUTS), horizon)
    start, path = opti.parameter(3 + len(model.STATES)), opti.parameter(2, horizon)
    opti.subject_to(states[:, 0] == start)
    opti.subject_to(states[:, 1:] == hold_step.map(horizon)(states[:, :-1], commands))
    opti.subject_to(opti.bounded(1100.0, commands, 1900.0))
    changes = (commands[:, 1:] - commands[:, :-1]) / 400.0
    opti.minimize(ca.sumsqr(states[:2, 1:] - path) + 0.01 * ca.sumsqr(changes))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "max_iter": 100, "sb": "yes"})

    first, held = [speed, 0.0, speed / radius], [1620.0, 1600.0]
    plant = Plant(folder, tmp_path, first, held)
    state = np.array(model.start(first, held)).ravel()
    guess_u = np.tile(np.array(held).reshape(-1, 1), (1, horizon))
    guess_x = np.tile(np.concatenate([plant.pose, state]).reshape(-1, 1), (1, horizon + 1))
    distances = []
    for k in range(100):
        t = k * hold * dt
        angles = speed / radius * (t + hold * dt * np.arange(1, horizon + 1))
        opti.set_value(path, radius * np.array([np.sin(angles), 1 - np.cos(angles)]))
        opti.set_value(start, np.concatenate([plant.pose, state]))
        opti.set_initial(states, guess_x)
        opti.set_initial(commands, guess_u)
        solution = opti.solve()
        guess_x, guess_u = solution.value(states), solution.value(commands)
        command = guess_u[:, 0]
        for _ in range(hold):
            plant.step(command, dt)
            # The observer is the model, corrected by the measured outputs.
            state = np.array(model.observe(model.step(state, command), plant.output())).ravel()
        here = speed / radius * (t + hold * dt)
        distances.append(np.hypot(*(plant.pose[:2] - radius * np.array([np.sin(here), 1 - np.cos(here)]))))
    rms = np.sqrt(np.mean(np.square(distances)))
    print(f"RMS distance from the place on the circle: {rms:.3f} m")
    assert rms < 0.1, rms
