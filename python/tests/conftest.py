"""Logs of a small boat, integrated here: du/dt = -0.2 u |u| + 0.01 n, dr/dt = -0.8 r + 0.5 u delta."""

import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

# Processes of the backends of sweeps import the tasks of the tests.
os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(Path(__file__).resolve().parent), os.environ.get("PYTHONPATH")])
)

DT = 0.1


def sail(seed, samples=1500):
    rng = np.random.default_rng(seed)
    hold = lambda low, high: np.repeat(rng.uniform(low, high, samples // 30 + 1), 30)[:samples]
    n, delta = hold(20.0, 120.0), hold(-0.4, 0.4)
    u, r = np.empty(samples), np.empty(samples)
    state = np.array([1.0, 0.0])
    rate = lambda s, k: np.array([-0.2 * s[0] * abs(s[0]) + 0.01 * n[k], -0.8 * s[1] + 0.5 * s[0] * delta[k]])
    for k in range(samples):
        u[k], r[k] = state
        for _ in range(4):
            h = DT / 4
            a = rate(state, k)
            b = rate(state + 0.5 * h * a, k)
            state = state + h * b
    noise = rng.normal(0.0, 0.003, (2, samples))
    return {"t [s]": DT * np.arange(samples), "u [m/s]": u + noise[0], "r [rad/s]": r + noise[1], "n": n, "delta [rad]": delta}


def write(path, columns):
    table = np.column_stack(list(columns.values()))
    path.write_text(",".join(columns) + "\n" + "\n".join(",".join(repr(float(x)) for x in row) for row in table) + "\n")
    return path


@pytest.fixture
def ctrl_c():
    """An interrupt of this process in half a second, also where its parent ignores interrupts (a job in the background)."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    yield
    timer.cancel()
    timer.join()
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def voyages():
    return [sail(seed) for seed in range(4)]


@pytest.fixture(scope="session")
def files(voyages, tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    return [write(folder / f"run{i}.csv", columns) for i, columns in enumerate(voyages)]


CHANNELS = {"outputs": "u,r", "inputs": "n,delta"}


@pytest.fixture(scope="session")
def found(files):
    import hydroid

    return hydroid.identify(files[:3], **CHANNELS, methods="sindy", horizon="5s")


@pytest.fixture(scope="session")
def model(found):
    return found.models["sindy"]
