"""A training step of the direct predictor in PyTorch and in hydroid: windows a second on one core, and the ratio.

Layers 58-256-256-256-60 with tanh, batches of 256 in single precision. PyTorch: eager, mean square error, fused Adam, on a
batch that is there. hydroid: all of a training (`cargo bench -p hydroid --bench direct`), with gathering, clipping and
judging. The two take turns, and of each the fastest round counts: what else runs on the machine slows some rounds, and does
not speed up any.

    python3 research/peers/direct.py [--rounds 5]
"""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path

# One thread, told before the library is read.
os.environ["OMP_NUM_THREADS"] = "1"

SIZES, BATCH = [58, 256, 256, 256, 60], 256
ROOT = Path(__file__).resolve().parents[2]


def torch_step():
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(0)
    layers = [part for pair in zip(SIZES, SIZES[1:]) for part in (torch.nn.Linear(*pair), torch.nn.Tanh())]
    network = torch.nn.Sequential(*layers[:-1])
    adam = torch.optim.Adam(network.parameters(), lr=1e-3, fused=True)
    x, target = torch.randn(BATCH, SIZES[0]), torch.randn(BATCH, SIZES[-1])

    def step():
        adam.zero_grad()
        ((network(x) - target) ** 2).mean().backward()
        adam.step()

    return step


def fastest(step, seconds):
    """Seconds of the processor, not of the clock."""
    for _ in range(20):
        step()
    best, end = float("inf"), time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.process_time()
        step()
        best = min(best, time.process_time() - begin)
    return best


def hydroid():
    """Windows a second in single precision, of the fastest sample."""
    run = subprocess.run(
        ["cargo", "bench", "-q", "-p", "hydroid", "--bench", "direct", "--", "training"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )
    rate = re.search(r"F32[^\n]*\n[^\n]*?([\d.]+) (M|K)item/s", run.stdout)
    if not rate:
        sys.exit(f"the benchmark has no rate:\n{run.stdout}{run.stderr}")
    return float(rate[1]) * {"K": 1e3, "M": 1e6}[rate[2]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    step = torch_step()
    ours, theirs = 0.0, 0.0
    for _ in range(options.rounds):
        ours, theirs = max(ours, hydroid()), max(theirs, BATCH / fastest(step, 1.0))
    print(f"{'-'.join(map(str, SIZES))}, batches of {BATCH}, f32, one core")
    print(f"PyTorch {theirs:9.0f} windows/s")
    print(f"hydroid {ours:9.0f} windows/s, {ours / theirs:.2f} times as many")


if __name__ == "__main__":
    main()
