"""Time of a sample in onnxruntime on one thread and in the exported C, microseconds: `python speed.py FOLDER`.

FOLDER is that of `cargo run -p hydroid-export --example exports -- FOLDER`; `cc` compiles the C with -O2.
"""

import ctypes
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
from exported import AHEAD, Model, Run

KINDS = {
    "sparse_equations_equations": "equations",
    "sparse_equations_equations_with_lags": "equations with lags, 3 substeps",
    "committee_committee": "committee of 4 members",
    "control_affine_affine": "control-affine network 3-8-7-9",
    "recurrent_gru_on_nothing": "GRU, 6 cells",
    "recurrent_gru_on_equations": "GRU, 6 cells, on equations",
    "recurrent_lstm_on_nothing": "LSTM, 4 cells",
    "direct_direct_on_hold": "direct predictor, 6 samples at once",
    "craft_otter": "Otter, grey box",
    "craft_mariner": "Mariner, grey box",
}


def shortest(run, count):
    run()
    times = []
    for _ in range(25):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times) / count * 1e6


def onnx_times(model, run):
    state = model("start", run.first, run.held)
    model("step", state, run.held)
    model("rollout", state, run.ahead[:6])
    commands = run.ahead.astype(model.real)
    step, rollout = model.sessions["step"], model.sessions["rollout"]

    def steps():
        x = state
        for command in commands[:100]:
            x, _ = step.run(None, {"state": x, "command": command})

    return shortest(steps, 100), shortest(lambda: rollout.run(None, {"state": state, "commands": commands}), AHEAD)


def c_time(folder, state, run):
    with tempfile.TemporaryDirectory() as into:
        library = pathlib.Path(into) / "vessel.so"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", folder / "vessel.c", "-o", library, "-lm"], check=True)
        rollout = ctypes.CDLL(str(library)).vessel_rollout
    outputs = np.zeros_like(run.predicted)
    at = lambda array: ctypes.c_void_p(array.ctypes.data)
    arguments = at(state), at(run.ahead), ctypes.c_size_t(AHEAD), at(outputs)
    return shortest(lambda: rollout(*arguments), AHEAD)


print("| model | step, double | rollout, double | step, float | rollout, float | rollout in C, double |")
print("| --- | --- | --- | --- | --- | --- |")
for name, title in KINDS.items():
    folder = pathlib.Path(sys.argv[1]) / name
    run = Run(folder)
    times = [*onnx_times(Model(folder, "vessel"), run), *onnx_times(Model(folder, "vessel_float"), run)]
    times.append(c_time(folder, Model(folder, "vessel")("start", run.first, run.held), run))
    print(f"| {title} |", " | ".join(f"{t:.3g}" for t in times), "|")
