import pickle

import numpy as np
import pytest

import hydroid
from conftest import CHANNELS, DT


def test_derivatives_are_those_of_the_equations(model, files):
    run = hydroid.prepare(files[3], **CHANNELS)[0]
    slope = model.derivative(run.outputs, run.inputs)
    by_hand = np.zeros_like(run.outputs)
    equations, signals = model.terms()
    values = dict(zip(model.output_names + model.input_names, [*run.outputs.T, *run.inputs.T]))
    functions = {"power": lambda x, n: x**n, "abs": np.abs, "sin": np.sin, "cos": np.cos, "sign": np.sign}
    assert not signals
    for i, terms in enumerate(equations):
        for coefficient, factors in terms:
            by_hand[:, i] += coefficient * np.prod([functions[f](values[name], *p) for name, f, p in factors], axis=0)
    np.testing.assert_allclose(slope, by_hand, rtol=1e-12, atol=1e-14)


def test_sympy_and_the_jacobian_agree(model):
    sympy = pytest.importorskip("sympy")
    sides = model.to_sympy()
    u, r, n, delta = (sympy.Symbol(name, real=True) for name in ("u", "r", "n", "delta"))
    point = {u: 1.5, r: 0.1, n: 80.0, delta: 0.2}
    a, b = model.jacobian([1.5, 0.1], [80.0, 0.2])
    by_sympy = sympy.Matrix([sides[u], sides[r]]).jacobian([u, r, n, delta]).subs(point)
    np.testing.assert_allclose(np.hstack([a, b]), np.array(by_sympy.evalf(), dtype=float), rtol=1e-9, atol=1e-12)
    values = [float(side.subs(point)) for side in (sides[u], sides[r])]
    np.testing.assert_allclose(model.derivative([[1.5, 0.1]], [[80.0, 0.2]])[0], values, rtol=1e-12)


def test_predict_is_what_evaluate_calls(model, files):
    judged = hydroid.evaluate(model, files[3], horizon=20, stride=50)
    by_function = hydroid.evaluate(model.predict, files[3], **CHANNELS, horizon=20, stride=50)
    np.testing.assert_array_equal(judged.rmse, by_function.rmse)
    with pytest.raises(ValueError, match=r"^inputs: expected shape \(samples = 2, inputs = 2\)"):
        model.predict(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((5, 2)))
    with pytest.raises(ValueError, match="^outputs: expected at least one measurement"):
        model.predict(np.zeros((0, 2)), None, np.zeros((5, 2)))


def test_simulations_are_rollouts(model):
    commands = np.tile([80.0, 0.1], (50, 1))
    y = model.simulate([1.0, 0.0], commands)
    assert y.shape == (50, 2)
    np.testing.assert_array_equal(y[0], [1.0, 0.0])
    np.testing.assert_array_equal(y[1:], model.predict([[1.0, 0.0]], np.zeros((0, 2)), commands[:-1]))
    with pytest.raises(ValueError, match="^samples: expected"):
        model.simulate([1.0, 0.0])
    with pytest.raises(ValueError, match="^start: expected shape"):
        model.simulate([1.0], commands)


def test_notebooks_show_tables(model, files):
    log = hydroid.read_log(files[0])
    page = log._repr_html_()
    assert page.count("<tr>") == 6 and "m/s" in page and "run0.csv: 1500 rows" in page
    page = model._repr_html_()
    assert "align*" in page and "delta" in page


def test_logs_survive_pickles(files):
    log = hydroid.read_log(files[0])
    again = pickle.loads(pickle.dumps(log))
    assert again.columns == log.columns and again.units == log.units and again.name == log.name
    for name in log.columns:
        np.testing.assert_array_equal(again[name], log[name])
    gaps = hydroid.Log({"t": DT * np.arange(3), "u [kn]": [1.0, np.nan, 2.0]})
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(gaps))["u"], gaps["u"])
