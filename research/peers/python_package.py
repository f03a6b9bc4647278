"""Times of the Python package as ratios within one run: what Python adds to the core, and what a sweep adds to its tasks.

    python research/peers/python_package.py [--sweep]

`--sweep` runs 64 identifications of 20,000 samples, first in this process, then on Ray with two workers.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hydroid

CHANNELS = {"outputs": "u,v,r", "inputs": "PP_cmd,RD_cmd"}


def seconds(call, repeats):
    """Shortest time of a call."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def rollouts(model):
    session = model.session()
    session.observe([1.0, 0.0, 0.0])
    for _ in range(model.warm_up):
        session.advance([100.0, 0.0])
        session.observe([1.0, 0.0, 0.0])
    commands = np.random.default_rng(0).uniform([50.0, -0.3], [150.0, 0.3], (1000, 100, 2))
    ratios = []
    for _ in range(15):
        core = session._seconds_of_rollout_batch(commands, 5)
        ratios.append(seconds(lambda: session.rollout_batch(commands), 5) / core)
    print(f"rollout_batch, 1000 x 100: {1e3 * core:.2f} ms in the core, {statistics.median(ratios):.3f} times that from Python")


def steps(model):
    for guard in (False, True):
        adapter = hydroid.Adapter(model, guard=guard)
        y, c, count = np.array([1.0, 0.0, 0.0]), np.array([100.0, 0.0]), 20_000
        adapter.step(None, y)

        def many():
            for _ in range(count):
                adapter.step(c, y)

        print(f"Adapter.step, guard {guard}: {1e6 * seconds(many, 5) / count:.2f} us from Python, learning included")


def frames():
    rows = 1_000_000
    rng = np.random.default_rng(0)
    columns = {"t": 0.1 * np.arange(rows), **{name: rng.normal(size=rows) for name in ("u", "v", "r", "n", "delta")}}
    kinds = {}
    try:
        import pandas

        kinds["pandas"] = pandas.DataFrame(columns)
    except ImportError:
        pass
    try:
        import polars

        kinds["polars"] = polars.DataFrame(columns)
    except ImportError:
        pass
    try:
        import pyarrow

        kinds["pyarrow"] = pyarrow.table(columns)
    except ImportError:
        pass
    for name, frame in kinds.items():
        print(f"data frame of {rows} rows and 6 columns, {name}: {1e3 * seconds(lambda: hydroid.Log(frame), 5):.0f} ms")


def sweep(folder):
    paths = []
    for seed in range(3):
        log = hydroid.simulate("simple", duration=20_000 * 0.1 / 3, seed=seed)
        path = Path(folder, f"run{seed}.csv")
        log.save(path)
        paths.append(path)
    config = {
        "log": {"outputs": ["u", "v", "r"], "inputs": ["PP_cmd", "RD_cmd"]},
        "sindy": {"lag": "none", "gate": "none", "refine": False},
    }
    tasks = hydroid.grid(hydroid.fit, {"logs": paths, "config": config}, {"seed": range(64)})
    times = {}
    for backend in ("serial", "ray"):
        start = time.perf_counter()
        done = hydroid.sweep(tasks, Path(folder, backend), backend=backend, workers=2)
        times[backend] = time.perf_counter() - start
        assert not done.failed
        of = done.to_pandas()
        print(
            f"64 identifications of 20,000 samples, {backend}: {times[backend]:.1f} s; one task {of['seconds'].median():.2f} s,"
            f" {of['peak_memory_mb'].median():.0f} MB, {sum(p.stat().st_size for p in paths) / 1e6:.1f} MB in,"
            f" {len(done.read(done.records[0])) / 1e3:.1f} kB out"
        )
    print(f"Ray with 2 workers takes {times['ray'] / (0.5 * times['serial']):.2f} times half of the time of one process")


if __name__ == "__main__":
    voyages = [hydroid.simulate("simple", duration=300, seed=seed) for seed in range(2)]
    options = {"lag": "none", "gate": "none", "refine": False, "members": 0, "degree": 2}
    model = hydroid.identify(voyages, **CHANNELS, methods="sindy", sections={"sindy": options}).models["sindy"]
    rollouts(model)
    steps(model)
    frames()
    if "--sweep" in sys.argv:
        with tempfile.TemporaryDirectory() as folder:
            sweep(folder)
