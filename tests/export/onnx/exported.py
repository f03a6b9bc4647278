"""An exported model in onnxruntime, and the run with which it is compared."""

import json

import numpy as np
import onnxruntime

AHEAD = 1002
STEPPED = 20


def session(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


class Model:
    """Functions of the files of a model."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.real = np.float32 if name.endswith("float") else np.float64
        self.sessions = {}

    def path(self, function):
        return self.folder / f"{self.name}_{function}.onnx"

    def __call__(self, function, *values):
        if function not in self.sessions:
            self.sessions[function] = session(self.path(function))
        at = self.sessions[function]
        values = {put.name: np.asarray(value, self.real) for put, value in zip(at.get_inputs(), values, strict=True)}
        results = at.run(None, values)
        assert all(result.dtype == self.real for result in results)
        return results[0] if len(results) == 1 else results

    def metadata(self, function="step"):
        return session(self.path(function)).get_modelmeta().custom_metadata_map


class Run:
    """Numbers of `run.json` as tables."""

    def __init__(self, folder):
        text = json.loads((folder / "run.json").read_text())
        self.first, self.held = np.array(text["first"]), np.array(text["held"])
        n, m = len(self.first), len(self.held)
        table = lambda key, columns: np.array(text[key], dtype=float).reshape(-1, columns)
        self.along, self.ahead = table("along", m), table("ahead", m)
        self.measured, self.predicted = table("measured", n), table("predicted", n)
        self.stepped = np.array(text["stepped"])


def difference(expected, found):
    """Largest difference, relative to the largest magnitude of each output."""
    expected, found = np.atleast_2d(expected), np.atleast_2d(found).astype(float)
    assert expected.shape == found.shape and np.isfinite(expected).all() and np.isfinite(found).all()
    scale = np.maximum(np.maximum(abs(expected), abs(found)).max(axis=0), 1e-3)
    return (abs(expected - found).max(axis=0) / scale).max()


def tolerance(model):
    if model.real == np.float64:
        return 1e-12
    # A sum of increments in single precision has the roundings of all of them.
    summed = "on_hold" in model.folder.name
    return AHEAD * 0.5 * np.finfo(np.float32).eps if summed else 1e-5


def after_measurements(model, run):
    """The state after the part of the run with measurements."""
    state = model("start", run.first, run.held)
    for command, measured in zip(run.along, run.measured, strict=True):
        state, _ = model("step", state, command)
        state = model("observe", state, measured)
    return state
