"""No argument crashes the interpreter: wrong ones raise exceptions."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import hydroid

numbers = st.one_of(
    st.integers(), st.floats(), st.booleans(), st.none(), st.text(max_size=5), st.binary(max_size=5), st.complex_numbers()
)
shaped = arrays.arrays(
    st.sampled_from(["f8", "f4", "i8", "u1", "?", "c16", "U2", "O", "M8[ns]", ">f8"]),
    arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
)
anything = st.one_of(
    numbers,
    shaped,
    st.lists(numbers, max_size=5),
    st.dictionaries(st.text(max_size=5), st.one_of(numbers, shaped), max_size=3),
    shaped.map(np.asfortranarray),
    shaped.map(lambda a: a[..., ::2] if a.ndim else a),
)
refused = (TypeError, ValueError, OverflowError, KeyError, OSError, NotImplementedError)


def calls(model, run):
    session, adapter = model.session(), hydroid.Adapter(model)
    state = adapter.state
    return {
        "observe": lambda x, y: session.observe(x),
        "advance": lambda x, y: session.advance(x),
        "rollout": lambda x, y: session.rollout(x),
        "rollout_batch": lambda x, y: session.rollout_batch(x),
        "restore": lambda x, y: session.restore(x),
        "jacobian": lambda x, y: model.jacobian(x, y),
        "step": lambda x, y: adapter.step(x, y),
        "predict": lambda x, y: adapter.predict(x, y),
        "state": lambda x, y: setattr(adapter, "state", x),
        "cut state": lambda x, y: setattr(adapter, "state", state[: hash(str(x)) % len(state)]),
        "adapter": lambda x, y: hydroid.Adapter(model, guard=x, leak=y),
        "log": lambda x, y: hydroid.Log(x, name=y) if isinstance(y, str) else hydroid.Log(x),
        "log of columns": lambda x, y: hydroid.Log({"u": x, "n": y}),
        "prepare": lambda x, y: hydroid.prepare(hydroid.Log({"u": x, "n": y}), outputs="u", inputs="n"),
        "options": lambda x, y: hydroid.prepare(hydroid.Log({"u": [1.0] * 9, "n": [2.0] * 9}), dt=x, max_gap=y),
        "bytes": lambda x, y: hydroid.Model.from_bytes(x),
        "horizon": lambda x, y: hydroid.evaluate(model, run, horizon=x, stride=y if isinstance(y, int) else 50),
        "function": lambda x, y: hydroid.evaluate(lambda *_: x, run, horizon=5, stride=100),
        "simulate": lambda x, y: hydroid.simulate(x, y, duration=1.0),
        "simulate options": lambda x, y: hydroid.simulate(model, duration=1.0, current=x, start=y, noise=x),
        "trials": lambda x, y: hydroid.manoeuvres(model, "acceleration", steering=x, current=y),
        "zigzags": lambda x, y: hydroid.manoeuvres(x, "acceleration", zigzag=y, push=x),
        "compare": lambda x, y: hydroid.compare_manoeuvres(model, x, dt=y),
        "methods": lambda x, y: hydroid.identify(run, methods=x, sections=y),
    }


@pytest.fixture(scope="module")
def entries(model, files):
    from conftest import CHANNELS

    [run] = hydroid.prepare(files[3], **CHANNELS)
    return calls(model, run)


@settings(max_examples=1_000, deadline=None, suppress_health_check=list(HealthCheck), database=None, derandomize=True)
@given(data=st.data())
def test_no_argument_crashes_the_interpreter(entries, data):
    name = data.draw(st.sampled_from(sorted(entries)))
    try:
        entries[name](data.draw(anything), data.draw(anything))
    except refused as error:
        assert "defect" not in str(error)
