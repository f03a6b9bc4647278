"""Every kind of model: the checker of ONNX, and onnxruntime against the predictions of hydroid."""

import json

import numpy as np
import onnx
import pytest
from exported import AHEAD, STEPPED, Model, Run, after_measurements, difference, tolerance


@pytest.fixture
def model(folder, name):
    return Model(folder, name)


def test_the_checker_accepts_all_files(model):
    paths = sorted(model.folder.glob(f"{model.name}_*.onnx"))
    functions = {path.stem.removeprefix(f"{model.name}_") for path in paths}
    assert functions >= {"start", "step", "observe", "rollout"}
    for path in paths:
        onnx.checker.check_model(str(path), full_check=True)
        # Shapes are those that inference finds.
        onnx.shape_inference.infer_shapes(onnx.load(path), check_type=True, strict_mode=True, data_prop=True)


def test_a_rollout_after_measurements(model):
    run = Run(model.folder)
    state = after_measurements(model, run)
    outputs, last_state = model("rollout", state, run.ahead)
    assert outputs.shape == (AHEAD, len(run.first)) and last_state.shape == state.shape
    assert difference(run.predicted, outputs) < tolerance(model)
    # The rollout goes on from its last state.
    half = AHEAD // 2 // 6 * 6
    first, middle = model("rollout", state, run.ahead[:half])
    second, _ = model("rollout", middle, run.ahead[half:])
    assert difference(outputs.astype(float), np.concatenate([first, second])) < tolerance(model)


def test_steps_with_a_restart_in_the_middle(model, tmp_path):
    run = Run(model.folder)
    state = after_measurements(model, run)
    for k, command in enumerate(run.ahead[:STEPPED]):
        if k == STEPPED // 2:
            np.save(tmp_path / "state.npy", state)
            model = Model(model.folder, model.name)
            state = np.load(tmp_path / "state.npy")
        state, outputs = model("step", state, command)
    assert difference(run.stepped, outputs) < tolerance(model)


def test_the_last_command_is_held_to_the_end_of_a_horizon(model):
    horizon = int(model.metadata().get("hydroid.horizon", 1))
    run = Run(model.folder)
    state = model("start", run.first, run.held)
    samples = 3 * horizon + 1
    rows = run.ahead[:samples]
    held = np.concatenate([rows, np.repeat(rows[-1:], horizon - 1, axis=0)])
    found, last = model("rollout", state, rows)
    expected, last_of_held = model("rollout", state, held)
    assert found.shape == (samples, len(run.first))
    assert np.array_equal(found, expected[:samples]) and np.array_equal(last, last_of_held)


def test_rates(model):
    rates = json.loads((model.folder / "run.json").read_text()).get("rates")
    assert (rates is not None) == model.path("rates").exists()
    if rates is None:
        return
    run = Run(model.folder)
    found = model("rates", model("start", run.first, run.held), run.ahead[0])
    scale = max(abs(np.array(rates)).max(), 1e-3)
    assert abs(found - rates).max() / scale < (1e-12 if model.real == np.float64 else 1e-4)


def test_metadata(model):
    run = Run(model.folder)
    for function in ["start", "step", "observe", "rollout"]:
        meta = model.metadata(function)
        assert meta["hydroid.function"] == function
        assert model.folder.name.startswith(meta["hydroid.kind"])
        assert float(meta["hydroid.sample_time_s"]) > 0
        assert meta["hydroid.precision"] == ("double" if model.real == np.float64 else "float")
        assert meta["hydroid.version"] and meta["hydroid.model"]
        assert meta["hydroid.relative_to_water"] in ("true", "false")
        assert isinstance(json.loads(meta["hydroid.training"]), list)
        outputs, inputs, state = (json.loads(meta[f"hydroid.{key}"]) for key in ["outputs", "inputs", "state"])
        assert (len(outputs), len(inputs)) == (len(run.first), len(run.held))
        assert len(state) == len(model("start", run.first, run.held))
        for channel in outputs + inputs:
            low, high = channel["training_range"]
            assert channel["name"] and "unit" in channel and low < high
        assert all(number["name"] and number["unit"] for number in state)


def test_recurrent_layers_are_operators_in_single_precision(model):
    graph = onnx.load(model.path("step"))
    operators = {node.op_type for function in graph.functions for node in function.node}
    cell = next((cell for cell in ["gru", "lstm"] if f"_{cell}_on" in model.folder.name), None)
    single = model.real == np.float32
    assert (operators & {"GRU", "LSTM"}) == ({cell.upper()} if cell and single else set())
