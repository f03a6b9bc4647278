import warnings

import numpy as np
import pytest

import hydroid
from conftest import DT, sail


def lorenz(start, samples, dt):
    """The Lorenz system with the classical parameters, by Runge-Kutta steps a fifth of the sample time long."""
    def rate(s):
        return np.array([10.0 * (s[1] - s[0]), s[0] * (28.0 - s[2]) - s[1], s[0] * s[1] - 8.0 / 3.0 * s[2]])

    states, s, h = np.empty((samples, 3)), np.array(start), dt / 5
    for k in range(samples):
        states[k] = s
        for _ in range(5):
            a = rate(s)
            b = rate(s + 0.5 * h * a)
            c = rate(s + 0.5 * h * b)
            d = rate(s + h * c)
            s = s + h / 6.0 * (a + 2 * b + 2 * c + d)
    return states


def arrays(seed):
    log = sail(seed)
    return np.column_stack([log["u [m/s]"], log["r [rad/s]"]]), np.column_stack([log["n"], log["delta [rad]"]])


@pytest.fixture(scope="module")
def ship():
    runs = [arrays(seed) for seed in range(4)]
    return [x for x, _ in runs], [u for _, u in runs]


@pytest.fixture(scope="module")
def fitted(ship):
    x, u = ship
    model = hydroid.SINDy(degree=2, horizon=50)
    return model.fit(x[:3], t=DT, u=u[:3], feature_names=["u", "r", "n", "delta"])


def script(module, model, x, dt):
    """The example of PySINDy's documentation; module and model are what differs."""
    model.fit(x, t=dt, feature_names=["x", "y", "z"])
    model.print()
    assert model.complexity == 7
    return model


def matrix(model, names):
    """Coefficients in the order of PySINDy's polynomial library."""
    found = dict(zip(model.get_feature_names(), model.coefficients().T))
    return np.array([found.get(name, np.zeros(3)) for name in names]).T


def test_the_lorenz_example_of_pysindy(capsys):
    ps = pytest.importorskip("pysindy")
    dt = 0.002
    x = lorenz([-8.0, 8.0, 27.0], 5000, dt)
    ours = script(hydroid, hydroid.SINDy(degree=2, threshold=0.05, gate="none"), x, dt)
    theirs = script(ps, ps.SINDy(optimizer=ps.STLSQ(threshold=0.05), feature_library=ps.PolynomialLibrary(degree=2)), x, dt)
    assert "dx/dt" in capsys.readouterr().out
    names = [name.replace("x0", "x") for name in theirs.get_feature_names()]
    a, b = matrix(ours, names), theirs.coefficients()
    assert ((a != 0) == (b != 0)).all()
    np.testing.assert_allclose(a, b, rtol=5e-3)
    np.testing.assert_allclose(a[a != 0], [-10, 10, 28, -1, -1, -8 / 3, 1], rtol=2e-3)
    # Derivatives and a short simulation agree as well.
    np.testing.assert_allclose(ours.predict(x[:100]), theirs.predict(x[:100]), rtol=5e-3, atol=0.2)
    np.testing.assert_allclose(ours.simulate(x[0], dt * np.arange(200)), x[:200], rtol=0.02, atol=0.02)
    assert ours.score(x, t=dt) > 0.99


def test_a_ship_by_the_script_of_pysindy(ship):
    ps = pytest.importorskip("pysindy")
    x, u = ship
    names = ["u", "r", "n", "delta"]
    ours = hydroid.SINDy(degree=2, signed_squares=False, threshold=0.02, lag="none", gate="none", refine=False)
    ours.fit(x, t=DT, u=u, feature_names=names)
    theirs = ps.SINDy(optimizer=ps.STLSQ(threshold=0.005), feature_library=ps.PolynomialLibrary(degree=2))
    theirs.fit(x, t=DT, u=u, feature_names=names)
    ours_of = dict(zip(ours.get_feature_names(), ours.coefficients().T))
    theirs_of = dict(zip(theirs.get_feature_names(), theirs.coefficients().T))
    # Surge drag has the form u |u| here, and u > 0.
    for output, term, truth in [(0, "u^2", -0.2), (0, "n", 0.01), (1, "r", -0.8), (1, "u delta", 0.5)]:
        ours_value, theirs_value = ours_of[term][output], theirs_of[term][output]
        assert ours_value == pytest.approx(truth, rel=0.1)
        assert ours_value == pytest.approx(theirs_value, rel=0.25)


def test_lists_arrays_and_logs_give_the_same_model(ship, fitted):
    x, u = ship
    columns = [{"t [s]": DT * np.arange(len(a)), "u": a[:, 0], "r": a[:, 1], "n": b[:, 0], "delta": b[:, 1]} for a, b in zip(x, u)]
    logs = [hydroid.Log(columns, name=f"run {i}") for i, columns in enumerate(columns[:3])]
    of_logs = hydroid.SINDy(degree=2, horizon=50, outputs="u,r", inputs="n,delta").fit(logs)
    np.testing.assert_array_equal(of_logs.coefficients(), fitted.coefficients())
    times = [DT * np.arange(len(a)) for a in x[:3]]
    of_times = hydroid.SINDy(degree=2, horizon=50).fit(x[:3], t=times, u=u[:3], feature_names=["u", "r", "n", "delta"])
    np.testing.assert_array_equal(of_times.coefficients(), fitted.coefficients())
    assert of_logs.score(logs[0]) == pytest.approx(fitted.score(x[0], t=DT, u=u[0]))


def test_predictions_and_simulations(ship, fitted):
    x, u = ship
    derivative = fitted.predict(x[3], u=u[3])
    assert derivative.shape == x[3].shape
    smooth = np.gradient(x[3], DT, axis=0)
    assert np.corrcoef(derivative[10:, 1], smooth[10:, 1])[0, 1] > 0.9
    assert [rows.shape for rows in fitted.predict(x[2:4], u=u[2:4])] == [x[2].shape, x[3].shape]
    y = fitted.simulate(x[3][0], DT * np.arange(300), u[3][:300])
    np.testing.assert_array_equal(y[0], x[3][0])
    assert np.abs(y - x[3][:300]).max() < 0.15
    by_function = fitted.simulate(x[3][0], 300, lambda t: u[3][int(round(t / DT))])
    np.testing.assert_array_equal(by_function, y)
    assert fitted.score(x[3], t=DT, u=u[3]) > 0.9
    assert fitted.evaluate(x[3], t=DT, u=u[3]).nrmse.max() < 0.3


@pytest.mark.parametrize("name", ["GRU", "LSTM", "DirectPredictor", "Committee"])
def test_discrete_models_predict_the_next_sample(ship, name):
    x, u = ship
    options = {} if name == "Committee" else {"hidden": 6, "epochs": 8, "restarts": 1}
    model = getattr(hydroid, name)(dt=DT, horizon=20, **options).fit(x[:3], u=u[:3])
    assert model.model_.name == {"DirectPredictor": "direct"}.get(name, name.lower())
    predicted = model.predict(x[3], u=u[3])
    assert predicted.shape == x[3].shape
    warm = model.model_.warm_up
    error = predicted[warm:-1] - x[3][warm + 1:]
    assert np.sqrt((error**2).mean(axis=0)).max() < 0.1
    assert np.isfinite(model.score(x[3], u=u[3]))


def test_pipelines_clones_and_searches(ship):
    from sklearn.base import clone
    from sklearn.model_selection import GridSearchCV

    # Runs with commands are logs here: scikit-learn passes runs alone to the score.
    logs = [hydroid.Log(sail(seed), name=f"run {seed}") for seed in range(4)]
    base = hydroid.SINDy(outputs="u,r", inputs="n,delta", horizon=30, lag="none", gate="none", refine=False)
    assert clone(base).get_params() == base.get_params()
    search = GridSearchCV(base, {"degree": [1, 2]}, cv=2, error_score="raise").fit(logs)
    assert search.best_params_["degree"] == 2
    assert search.best_estimator_.complexity > 0


def test_errors_name_the_argument(ship):
    x, u = ship
    model = hydroid.SINDy()
    with pytest.raises(ValueError, match="^t: expected the sample time"):
        model.fit(x[0], u=u[0])
    with pytest.raises(ValueError, match=r"^t: expected shape \(1500,\), got \(3,\)"):
        model.fit(x[0], t=[0.0, 0.1, 0.2], u=u[0])
    with pytest.raises(ValueError, match="^u: expected a list with an item for each of 2 runs"):
        model.fit(x[:2], t=DT, u=u[0])
    with pytest.raises(ValueError, match="^feature_names: expected 4 names"):
        model.fit(x[0], t=DT, u=u[0], feature_names=["u"])
    with pytest.raises(ValueError, match="Expected 2D array, got 1D array"):
        model.fit(x[0][:, 0], t=DT)
    with pytest.raises(ValueError, match="^sindy.degree: invalid type"):
        hydroid.SINDy(degree="two").fit(x[0], t=DT, u=u[0])
    fitted = hydroid.SINDy(degree=1, refine=False).fit(x[0], t=DT, u=u[0])
    with pytest.raises(ValueError, match="^u: expected the commands u0, u1, got None"):
        fitted.score(x[1], t=DT)
    with pytest.raises(ValueError, match="^u: expected 2 columns of commands, got None"):
        fitted.predict(x[1])
    with pytest.raises(ValueError, match="^t: expected times with the sample time of the model, 0.1 s"):
        fitted.simulate(x[0][0], [0.0, 0.2, 0.4], u[0][:3])
    with pytest.raises(ValueError, match="^t: expected the sample time of the model, 0.1 s, got 0.2 s"):
        fitted.score(x[1], t=0.2, u=u[1])
    with pytest.raises(TypeError, match="^y: expected None.*write t=0.1"):
        model.fit(x[0], 0.1, u=u[0])
    with pytest.raises(TypeError, match="^t: expected numbers"):
        model.fit(x[0], t="0.1", u=u[0])
    with pytest.raises(ValueError, match="is an array transposed"):
        model.fit(x[0], t=DT, u=u[0][:5])
    with pytest.raises(ValueError, match="Found array with 2 sample"):
        model.fit(x[0].T, t=DT, u=u[0])
    from sklearn.exceptions import NotFittedError

    with pytest.raises(NotFittedError):
        hydroid.SINDy().predict(x[0])


_RANDOM = "its rows are independent random numbers: there are no dynamics, and hydroid says that no model was found"
#: Checks of scikit-learn that do not apply to a model of dynamics.
EXPECTED = {
    "check_pipeline_consistency": _RANDOM,
    "check_estimators_pickle": _RANDOM,
    "check_fit2d_1feature": "one output is a run; ten random samples of it are too short, which the message says",
}


@pytest.mark.parametrize("estimator", [hydroid.SINDy(dt=0.1, horizon=2, degree=1, signed_squares=False, refine=False, members=0)])
def test_the_checks_of_scikit_learn(estimator):
    from sklearn.utils.estimator_checks import check_estimator

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        results = check_estimator(estimator, expected_failed_checks=EXPECTED, on_fail=None)
    failed = {r["check_name"]: repr(r["exception"])[:300] for r in results if r["status"] == "failed"}
    assert not failed, failed
    # A check that passes is not an exception.
    assert {r["check_name"] for r in results if r["status"] == "xfail"} == set(EXPECTED)
    assert sum(r["status"] == "passed" for r in results) >= 35
