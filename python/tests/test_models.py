import copy
import inspect
import os
import pickle

import numpy as np
import pytest

import hydroid
from conftest import CHANNELS, DT


def test_identification_finds_the_boat(found, model):
    terms = {(output, term): value for output, term, value, _, _ in model.coefficients()}
    # The speed is positive, so that both terms are the same.
    assert terms.get(("u", "u |u|"), terms.get(("u", "u^2"))) == pytest.approx(-0.2, rel=0.05)
    assert terms["u", "n"] == pytest.approx(0.01, rel=0.05)
    assert found.best is not None and found.best.name == "sindy"
    assert found.judgement["sindy"].judged.nrmse[-1].max() < 0.2
    assert [verdict["channel"] for verdict in found.verdicts] == ["u", "r"]
    assert "sindy" in repr(found) and "<table>" in found._repr_html_()
    assert found.report().startswith("<!DOCTYPE html>")
    assert len(found.to_pandas()) == 2 * 50


def test_models_have_the_bytes_of_the_command(found, files, tmp_path):
    command = os.environ.get("HYDROID_COMMAND")
    if not command:
        pytest.skip("no HYDROID_COMMAND")
    import subprocess

    run = [command, "identify", *map(str, files[:3]), "--outputs", "u,r", "--inputs", "n,delta"]
    run += ["--methods", "sindy", "--horizon", "5s", "-o", str(tmp_path / "out"), "-q"]
    assert subprocess.run(run).returncode in (0, 1)
    assert (tmp_path / "out" / "sindy.safetensors").read_bytes() == found.models["sindy"].to_bytes()
    found.save(tmp_path / "python")
    assert sorted(p.name for p in (tmp_path / "python").iterdir()) == ["identify.json", "report.html", "sindy.safetensors"]


def test_the_number_of_threads_does_not_matter(files, model):
    one = hydroid.identify(files[:3], **CHANNELS, methods="sindy", horizon="5s", threads=1)
    assert one.models["sindy"] == model


def test_a_network_is_trained_with_options(files):
    found = hydroid.identify(
        files[0], validate=files[1], test=files[2], **CHANNELS, methods=["gru"], horizon=20,
        sections={"gru": {"hidden": 4, "epochs": 2, "restarts": 1}},
    )
    model = found.models["gru"]
    assert any(array.size > 1 for array in model.weights().values())
    with pytest.raises(NotImplementedError, match="gru"):
        model.equations()


def test_models_survive_files_and_pickles(model, tmp_path):
    model.save(tmp_path / "boat.safetensors")
    again = hydroid.Model.load(tmp_path / "boat.safetensors")
    assert again == model == pickle.loads(pickle.dumps(model))
    assert again.to_bytes() == model.to_bytes() and hash(again) == hash(model)
    assert (model.output_names, model.input_names, model.kind) == (["u", "r"], ["n", "delta"], "sparse_equations")
    assert model.equations()[0].startswith("du/dt =") and "align*" in model.latex()
    with pytest.raises(FileNotFoundError):
        hydroid.Model.load(tmp_path / "none.safetensors")
    with pytest.raises(ValueError):
        hydroid.Model.from_bytes(b"no model")


def test_runs_and_sessions_survive_pickles(files, model):
    run = hydroid.prepare(files[:1], **CHANNELS)[0]
    for again in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        assert repr(again) == repr(run) and again.units == run.units and again.t.tolist() == run.t.tolist()
        np.testing.assert_array_equal(again.outputs, run.outputs)
        np.testing.assert_array_equal(again.inputs, run.inputs)
    session = model.session()
    for y, c in zip(run.outputs[:30], run.inputs[:30]):
        session.observe(y)
        session.advance(c)
    ahead = run.inputs[30:60]
    for again in (pickle.loads(pickle.dumps(session)), copy.deepcopy(session)):
        np.testing.assert_array_equal(again.rollout(ahead), session.rollout(ahead))
        again.advance(run.inputs[30])
    np.testing.assert_array_equal(session.rollout(ahead), session.fork().rollout(ahead))


def test_the_jacobian_is_the_derivative_of_the_motion(model):
    y, c = np.array([1.5, 0.1]), np.array([60.0, 0.2])
    a, b = model.jacobian(y, c)
    assert a.shape == (2, 2) and b.shape == (2, 2)
    assert a[0, 0] == pytest.approx(-0.4 * y[0], rel=0.1) and b[0, 0] == pytest.approx(0.01, rel=0.1)


def test_sessions_and_rollouts_agree(model, files):
    [rolled] = hydroid.rollouts(model, files[3], 20, stride=50)
    run, k = rolled.run, int(rolled.origins[3])
    session = model.session()
    for j in range(k):
        session.observe(run.outputs[j])
        session.advance(run.inputs[j])
    session.observe(run.outputs[k])
    ahead = session.rollout(run.inputs[k : k + 20])
    np.testing.assert_array_equal(ahead, rolled.outputs[3])
    batch = session.rollout_batch(np.stack([run.inputs[k : k + 20]] * 3))
    np.testing.assert_allclose(batch[1], ahead, rtol=1e-9)
    fork, numbers = session.fork(), session.snapshot()
    session.advance(run.inputs[k])
    session.restore(numbers)
    np.testing.assert_array_equal(session.rollout(run.inputs[k : k + 5]), fork.rollout(run.inputs[k : k + 5]))
    assert session.output.shape == (2,)


@pytest.mark.parametrize("commands", [np.ones((5, 3)), np.ones(5), [["a"]], np.ones((2, 2, 2))])
def test_wrong_shapes_are_refused(model, commands):
    with pytest.raises((TypeError, ValueError), match="commands: expected .*, got"):
        model.session().rollout(commands)


def test_ctrl_c_ends_a_call(files, ctrl_c):
    with pytest.raises(KeyboardInterrupt):
        hydroid.identify(
            files[0], validate=files[1], test=files[2], **CHANNELS, methods="gru", sections={"gru": {"epochs": 100_000}}
        )


def test_progress_is_reported_and_its_exceptions_end_the_call(files):
    told = []
    hydroid.identify(files[:3], **CHANNELS, methods="sindy", horizon=20, progress=told.append)
    assert told == sorted(told) or told
    with pytest.raises(ZeroDivisionError):
        hydroid.identify(
            files[0], validate=files[1], test=files[2], **CHANNELS, methods="gru",
            sections={"gru": {"epochs": 100_000}}, progress=lambda fraction: 1 / 0,
        )


def test_options_of_the_library_are_those_of_python():
    parameters = inspect.signature(hydroid.identify).parameters
    for option in hydroid._hydroid.options("identify"):
        assert option["key"] in parameters and f"{option['key']} :" in hydroid.identify.__doc__


def test_unknown_methods_and_options_are_named(files):
    with pytest.raises(ValueError, match="identify.methods.*'spindy' is not a method: sindy"):
        hydroid.identify(files[:3], **CHANNELS, methods="spindy")
    with pytest.raises(ValueError, match="unknown field `degre`"):
        hydroid.identify(files[:3], **CHANNELS, sections={"sindy": {"degre": 3}})
    with pytest.raises(ValueError, match="^adapt.leak: expected a value, got None; leave the key out"):
        hydroid.identify(files[:3], **CHANNELS, sections={"adapt": {"leak": None}})
    with pytest.raises(ValueError, match="horizon|samples"):
        hydroid.identify(files[:3], **CHANNELS, horizon="soon")


def test_persistence_as_a_function_is_the_built_in_persistence(files):
    def persistence(outputs, inputs, commands):
        assert len(inputs) == len(outputs) - 1
        return np.repeat(outputs[-1:], len(commands), axis=0)

    judged = hydroid.evaluate(persistence, files[3], **CHANNELS, horizon=30, stride=7)
    assert judged.model == "persistence" and judged.windows > 100
    for name in ("mae", "rmse", "nrmse"):
        np.testing.assert_array_equal(getattr(judged, name), judged.persistence[name])


def test_models_and_functions_have_the_same_judge(model, files):
    judged = hydroid.evaluate(model, files[3], horizon="2s", stride=5)

    def function(outputs, inputs, commands):
        session = model.session()
        for y, c in zip(outputs, inputs):
            session.observe(y)
            session.advance(c)
        session.observe(outputs[-1])
        return session.rollout(commands)

    again = hydroid.evaluate(function, files[3], **CHANNELS, horizon="2s", stride=5, warm_up=model.warm_up)
    np.testing.assert_allclose(again.rmse, judged.rmse, rtol=1e-6)
    assert again.windows == judged.windows and judged.rmse[-1, 0] < judged.persistence["rmse"][-1, 0]
    assert "RMSE" in repr(judged) and len(judged.records()) == 2 * len(judged.horizons)


def test_a_pytorch_model_is_judged(files):
    torch = pytest.importorskip("torch")
    layer = torch.nn.Linear(4, 2)

    def network(outputs, inputs, commands):
        y, ahead = torch.tensor(outputs[-1].copy()).float(), []
        with torch.no_grad():
            for c in commands:
                y = y + 0.01 * layer(torch.cat([y, torch.tensor(c.copy()).float()]))
                ahead.append(y)
        return torch.stack(ahead).numpy()

    judged = hydroid.evaluate(network, files[3], **CHANNELS, horizon=10, stride=20)
    assert judged.model == "network" and np.isfinite(judged.rmse).all()


def test_exceptions_of_a_function_reach_the_caller(files):
    with pytest.raises(ValueError, match=r"result of the function: expected shape \(samples = 10, outputs = 2\), got"):
        hydroid.evaluate(lambda y, u, c: np.zeros((3, 2)), files[3], **CHANNELS, horizon=10)
    with pytest.raises(ZeroDivisionError):
        hydroid.evaluate(lambda y, u, c: 1 / 0, files[3], **CHANNELS, horizon=10)
    with pytest.raises(TypeError, match="predictor: expected a Model or a function, got int"):
        hydroid.evaluate(3, files[3], **CHANNELS, horizon=10)


def test_an_adapter_learns_and_its_state_is_kept(model, files):
    [run] = hydroid.prepare(files[3], **CHANNELS)
    adapter, again = hydroid.Adapter(model), hydroid.Adapter(model)
    status = [adapter.step(None, run.outputs[0]).status]
    for k in range(1, 400):
        status.append(adapter.step(run.inputs[k - 1], run.outputs[k]).status)
    assert "accepted" in status
    again.state = adapter.state
    for k in range(400, 450):
        a, b = (of.step(run.inputs[k - 1], run.outputs[k]) for of in (adapter, again))
        assert a.status == b.status and (a.estimate == b.estimate).all()
    assert a.predicted_by in ("adapted", "reference", "unguarded") and a.innovation.shape in ((0,), (2,))
    ahead = adapter.predict(np.repeat(run.inputs[450:451], 20, axis=0), [1, 10, 20])
    low, high = ahead.band(0.95)
    assert ahead.outputs.shape == ahead.std.shape == (3, 2) and (low < high).all()
    assert adapter.model(["run3"]).kind == model.kind and adapter.weights.ndim == 1
    with pytest.raises(ValueError, match="state: expected .* got that of another model"):
        hydroid.Adapter(model, guard=False).state = adapter.state
    with pytest.raises(ValueError, match="state: expected .* got a damaged one"):
        again.state = adapter.state[:-3]
    with pytest.raises(ValueError, match="command: expected shape"):
        adapter.step([1.0], run.outputs[0])
    for value in (1, None):
        with pytest.raises(TypeError, match="unexpected keyword argument 'leek'; did you mean 'leak'"):
            hydroid.Adapter(model, leek=value)
    with pytest.raises(ValueError, match="weight_variance is an option of the extended Kalman filter"):
        hydroid.Adapter(model, weight_variance=1e-3)
    by_text = hydroid.Adapter(model, learner="kalman", weight_variance=1e-3, noise="u=0.1,r=0.1")
    by_name = hydroid.Adapter(model, learner="kalman", weight_variance=1e-3, noise={"u": 0.1, "r": 0.1}, leak=None)
    assert by_name.state == by_text.state
    with pytest.raises(ValueError, match="noise: the output 'r' is missing"):
        hydroid.Adapter(model, learner="kalman", noise={"u": 0.01})
    for copied in (copy.deepcopy(adapter), pickle.loads(pickle.dumps(adapter))):
        assert copied.state == adapter.state
