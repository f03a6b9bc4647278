"""Backpropagation through time in PyTorch, JAX and hydroid: steps a second on one core, and ratios.

An LSTM with 5 inputs and 18 cells projected to 3 outputs; 64 sequences of 100 steps; outputs, then the gradient of all
weights. The peers take turns, and of each the fastest of all its rounds counts: what else runs on the machine slows some
rounds, and does not speed up any. A peer that is not installed is left out. PyTorch has no fast path (oneDNN) for a
projection: the second line for it is an LSTM of its fast path, without projection and with a linear read-out, which
has more weights; hydroid's time is that with the projection in both.

    python3 research/peers/recurrent.py [--batch 64] [--rounds 5]
"""

import argparse
import functools
import os
import re
import subprocess
import sys
import time
from pathlib import Path

# One thread, told before the libraries are read.
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["JAX_PLATFORMS"] = "cpu"

INPUTS, CELLS, OUTPUTS, STEPS = 5, 18, 3, 100
ROOT = Path(__file__).resolve().parents[2]


def pin():
    """To the core that is least likely to be the busiest; JAX and PyTorch then have one core as hydroid has."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def torch_step(batch, double, projected=True):
    import torch

    torch.set_num_threads(1)
    kind = torch.float64 if double else torch.float32
    torch.manual_seed(0)
    lstm = torch.nn.LSTM(INPUTS, CELLS, proj_size=OUTPUTS if projected else 0).to(kind)
    read_out = torch.nn.Identity() if projected else torch.nn.Linear(CELLS, OUTPUTS).to(kind)
    x = torch.randn(STEPS, batch, INPUTS, dtype=kind)
    target = torch.randn(STEPS, batch, OUTPUTS, dtype=kind)

    def step():
        lstm.zero_grad()
        y, _ = lstm(x)
        ((read_out(y) - target) ** 2).mean().backward()

    return step


def jax_step(batch, double):
    import jax
    import jax.numpy as jnp
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    kind = np.float64 if double else np.float32
    random = np.random.default_rng(0)
    number = lambda *shape: jnp.asarray(random.normal(size=shape) * 0.3, kind)
    weights = (
        number(4 * CELLS, INPUTS),
        number(4 * CELLS, OUTPUTS),
        number(4 * CELLS),
        number(4 * CELLS),
        number(OUTPUTS, CELLS),
    )
    x, target = number(STEPS, batch, INPUTS), number(STEPS, batch, OUTPUTS)

    def loss(weights):
        w_ih, w_hh, b_ih, b_hh, w_hr = weights

        def walk(state, x):
            c, h = state
            i, f, g, o = jnp.split(x @ w_ih.T + b_ih + h @ w_hh.T + b_hh, 4, axis=1)
            c = jax.nn.sigmoid(f) * c + jax.nn.sigmoid(i) * jnp.tanh(g)
            h = (jax.nn.sigmoid(o) * jnp.tanh(c)) @ w_hr.T
            return (c, h), h

        start = jnp.zeros((batch, CELLS), kind), jnp.zeros((batch, OUTPUTS), kind)
        _, y = jax.lax.scan(walk, start, x)
        return ((y - target) ** 2).mean()

    gradient = jax.jit(jax.grad(loss))
    return lambda: jax.block_until_ready(gradient(weights))


def fastest(step, seconds):
    """Seconds of the processor, not of the clock: a step that takes long is more often interrupted by what else runs."""
    step()
    best, end = float("inf"), time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.process_time()
        step()
        best = min(best, time.process_time() - begin)
    return best


def hydroid(batch):
    """Seconds in single and in double precision, of the fastest sample."""
    run = subprocess.run(
        ["cargo", "bench", "-q", "-p", "hydroid-core", "--bench", "recurrent", "--", "through_time_lstm", "--max-time", "1"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )
    units = {"ns": 1e-9, "µs": 1e-6, "ms": 1e-3, "s": 1.0}
    row = re.findall(rf"[├╰]─ {batch}\s+([\d.]+) (ns|µs|ms|s)\b", run.stdout)
    if len(row) != 2:
        sys.exit(f"the benchmark has no batch of {batch} sequences:\n{run.stdout}{run.stderr}")
    return [float(number) * units[unit] for number, unit in row]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batch", type=int, default=64, help="sequences; one that the benchmark knows")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    pin()
    peers = {}
    for name, make in [
        ("PyTorch", torch_step),
        ("PyTorch, read-out", functools.partial(torch_step, projected=False)),
        ("JAX", jax_step),
    ]:
        try:
            peers[name] = [make(options.batch, double) for double in (False, True)]
        except ImportError as missing:
            print(f"{name} is left out: {missing}", file=sys.stderr)
    best = {name: [float("inf")] * 2 for name in ["hydroid", *peers]}
    for _ in range(options.rounds):
        for name, times in best.items():
            new = hydroid(options.batch) if name == "hydroid" else [fastest(step, 1.0) for step in peers[name]]
            best[name] = [min(pair) for pair in zip(times, new)]
    print(f"LSTM {INPUTS}-{CELLS}-{OUTPUTS}, {options.batch} x {STEPS} steps, forward and gradient, one core")
    for column, kind in enumerate(["f32", "f64"]):
        for name, times in best.items():
            rate = options.batch * STEPS / times[column] / 1e6
            ratio = times[column] / best["hydroid"][column]
            print(f"{kind}  {name:17} {rate:7.2f} M steps/s   hydroid is {ratio:5.1f} times as fast")


if __name__ == "__main__":
    main()
