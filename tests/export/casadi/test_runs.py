"""The functions of the exported file against hydroid's predictions, and their derivatives."""

import pickle

import casadi as ca
import numpy as np
import pytest
from conftest import exports, load


def difference(a, b):
    """Largest difference, relative to the largest magnitude of each output."""
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    assert a.shape == b.shape and np.isfinite(a).all() and np.isfinite(b).all()
    scale = np.maximum(np.maximum(abs(a), abs(b)).max(axis=0), 1e-3)
    return (abs(a - b).max(axis=0) / scale).max()


def test_rollouts_are_those_of_hydroid(model, run):
    x = run.follow(model)
    samples = len(run.ahead)
    found = model.rollout(samples)(x, run.ahead.T)
    assert found.shape == (len(model.OUTPUTS), samples)
    assert difference(np.array(found).T, run.predicted) < 1e-12


def test_steps_continue_from_a_stored_state(model, run):
    x = run.follow(model)
    for k, command in enumerate(run.ahead[:20]):
        if k == 10:
            x = ca.DM(pickle.loads(pickle.dumps(np.array(x))))
        x = model.step(x, command)
    assert difference(np.array(model.output(x)).T, run.stepped) < 1e-12


def test_functions_read_from_files_predict_the_same(model, run, tmp_path):
    x = run.follow(model)
    for function in (model.start, model.step, model.observe, model.output, model.rates):
        if function is not None:
            function.save(str(tmp_path / function.name()))
    step = ca.Function.load(str(tmp_path / "step"))
    output = ca.Function.load(str(tmp_path / "output"))
    for command in run.ahead[:20]:
        x = step(x, command)
    assert difference(np.array(output(x)).T, run.stepped) < 1e-12


def test_short_rollouts_are_the_first_samples_of_long_ones(model, run):
    x = run.follow(model)
    horizon = model.HORIZON or 1
    long = np.array(model.rollout(3 * horizon + 2)(x, run.ahead[: 3 * horizon + 2].T))
    short = np.array(model.rollout(2 * horizon)(x, run.ahead[: 2 * horizon].T))
    assert np.array_equal(long[:, : 2 * horizon], short)
    for samples in (0, -1, 2.0, None):
        with pytest.raises(ValueError, match="whole number"):
            model.rollout(samples)


def central(function, x, scale):
    """Central differences of order 4."""
    columns = []
    for k in range(len(x)):
        if abs(x[k]) > 1e100:
            columns.append(np.array(function(x)).ravel() * np.nan)
            continue
        h = np.zeros(len(x))
        h[k] = 1e-3 * scale[k]
        d = 8 * (function(x + h) - function(x - h)) - (function(x + 2 * h) - function(x - 2 * h))
        columns.append(np.array(d).ravel() / (12 * h[k]))
    return np.array(columns).T


def test_jacobians_are_those_of_differences(model, run):
    x, c = np.array(run.follow(model)).ravel(), run.ahead[0]
    for with_pose in (False, True):
        if with_pose:
            x = np.append(x, [3.0, -2.0, 0.7])
        step = model.step_with_pose if with_pose else model.step
        a, b = (np.array(m) for m in model.jacobians(with_pose)(x, c))
        assert a.shape == (len(x), len(x)) and b.shape == (len(x), len(c))
        # Counters of samples are not continuous variables, and limits that are absent are the largest numbers.
        smooth = np.array([not name.startswith("samples since") for name in model.STATES] + [True] * 3)[: len(x)]
        smooth &= abs(x) < 1e100
        assert smooth.sum() >= len(x) - 10
        for found, expected in (
            (a, central(lambda x: step(x, c), x, np.maximum(abs(x), 0.1) * 1e-2)),
            (b, central(lambda c: step(x, c), c, np.maximum(abs(c), 0.1) * 1e-2)),
        ):
            assert np.isfinite(found).all()
            if found is a:
                found, expected = found[:, smooth], expected[:, smooth]
            scale = max(1.0, abs(expected).max())
            assert abs(found - expected).max() < 1e-6 * scale


def test_derivatives_at_rest_and_far_away_are_finite(model):
    """Velocities and commands of zero, and large ones: square roots at 0, powers of e that overflow."""
    outputs, inputs = len(model.OUTPUTS), len(model.INPUTS)
    finite = 0
    # The second derivatives, which Newton's method needs.
    z = ca.MX.sym("z", len(model.STATES) + inputs)
    total = ca.sum1(model.step(z[: len(model.STATES)], z[len(model.STATES) :]))
    hessian = ca.Function("hessian", [z], [ca.hessian(total, z)[0]])
    for y, c, hidden in ((0.0, 0.0, None), (0.0, 1.0, None), (1.0, -1.0, None), (0.0, 1.0, -1e4)):
        x = model.start([y] * outputs, [0.0] * inputs)
        if hidden is not None:
            # Actuators far from their positions: the branches of the model that are not taken overflow.
            x = ca.vertcat(x[:outputs], ca.repmat(hidden, len(model.STATES) - outputs, 1))
        for command in ([c] * inputs, [1e3 * c] * inputs):
            if not np.isfinite(np.array(model.step(x, command))).all():
                continue
            finite += 1
            for matrix in [*model.jacobians()(x, command), hessian(ca.vertcat(x, command))]:
                assert np.isfinite(np.array(matrix)).all()
    # Polynomials diverge under commands far from those of the training; other models do not.
    assert finite >= 3


def test_jacobians_of_the_rates_are_those_of_differences(model, run):
    if model.rates is None:
        pytest.skip("the model is in discrete time")
    x, c = np.array(run.follow(model)).ravel(), run.ahead[0]
    found = np.array(model.rates.jacobian()(x, c, 0)[0])
    expected = central(lambda x: model.rates(x, c), x, np.maximum(abs(x), 0.1) * 1e-2)
    assert np.isfinite(found).all()
    assert abs(found - expected).max() < 1e-6 * max(1.0, abs(expected).max())


def test_the_pose_moves_on_the_arc_of_the_velocities(model, run):
    x = run.follow(model)
    samples = 100
    pose = np.array([3.0, -2.0, 0.7])
    rows = np.array(model.rollout(samples, with_pose=True)(ca.vertcat(x, pose), run.ahead[:samples].T)).T
    outputs = len(model.OUTPUTS)
    before = np.array(model.output(x)).ravel()
    for row in rows:
        u, v, r = 0.5 * (before + row[:outputs])[list(model.MOTION)]
        half = 0.5 * r * model.DT
        length = model.DT * (1.0 if abs(half) < 1e-6 else np.sin(half) / half)
        sin, cos = np.sin(pose[2] + half), np.cos(pose[2] + half)
        pose = pose + [length * (u * cos - v * sin), length * (u * sin + v * cos), 2 * half]
        before = row[:outputs]
        assert np.allclose(row[outputs:], pose, rtol=1e-12, atol=1e-12)


def test_a_straight_course_has_derivatives():
    """The arc of a yaw rate of zero: sin(a) / a at a = 0."""
    folder = next(folder for folder in exports() if folder.name == "craft_otter")
    model = load(folder)
    x = ca.vertcat(model.start([1.0, 0.0, 0.0], [50.0, 50.0]), [0.0, 0.0, 0.0])
    a, b = (np.array(m) for m in model.jacobians(with_pose=True)(x, [50.0, 50.0]))
    assert np.isfinite(a).all() and np.isfinite(b).all()
    # The position north follows the surge velocity, the heading the yaw rate: half of a sample with the present one.
    north, heading = len(model.STATES), len(model.STATES) + 2
    assert 0.5 * model.DT < a[north, 0] < model.DT
    assert 0.5 * model.DT < a[heading, 2] < model.DT
