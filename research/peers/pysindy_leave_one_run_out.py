"""Leave-one-run-out with PySINDy, on the runs and windows of the program `leave_one_run_out`.

    HYDROID_DATA=... cargo run --release -p hydroid-research --bin leave_one_run_out -- write FOLDER
    python research/peers/pysindy_leave_one_run_out.py FOLDER [SET ...]

PySINDy is given what hydroid takes for granted: scaled channels, a clock step of a thirtieth of the horizon, and the choice
of library, threshold and ridge penalty by cross-validated rollouts over the training runs. Each run is the test run once.
"""

import itertools
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pysindy as ps

THRESHOLDS = [0.0, 0.01, 0.05]
RIDGES = [1e-6, 1e-2]
# Origins of the cross-validation, a quarter of the horizon apart.
QUARTER = 0.25


def library(kind):
    if kind != "signed squares":
        return ps.PolynomialLibrary(degree=kind)
    squares = ps.CustomLibrary(library_functions=[lambda x: x * np.abs(x)], function_names=[lambda x: f"{x}|{x}|"])
    return ps.ConcatLibrary([ps.PolynomialLibrary(degree=2), squares])


def fit(runs, step, kind, threshold, ridge):
    """A model in discrete time; rows begin at the first sample and in the middle of the first step."""
    parts = [(y[i::step], c[i::step]) for y, c in runs for i in range(0, step, max(1, step // 2))]
    parts = [(y, c) for y, c in parts if len(y) > 2]
    optimizer = ps.STLSQ(threshold=threshold, alpha=ridge * sum(len(y) for y, _ in parts))
    model = ps.DiscreteSINDy(optimizer=optimizer, feature_library=library(kind))
    # Increments: a threshold on the coefficient of the previous value itself would have no meaning.
    increments = [np.diff(y, axis=0) for y, _ in parts]
    model.fit([y[:-1] for y, _ in parts], t=1, x_next=increments, u=[c[:-1] for _, c in parts])
    return model


def rollout(model, run, origins, steps, step, limit):
    y, c = run
    x = y[origins]
    for j in range(steps):
        z = np.concatenate([x, c[origins + j * step]], axis=1)
        x = x + np.asarray(model.feature_library.transform(z)) @ np.asarray(model.coefficients()).T
        x = np.clip(np.nan_to_num(x, nan=1e6), -limit, limit)
    return x


def nrmse(pairs):
    predicted, measured = (np.concatenate(part) for part in zip(*pairs))
    return np.sqrt(((predicted - measured) ** 2).mean(0)) / measured.std(0)


def identify(runs, horizon, step, warm_up):
    """The model with the smallest error on runs left out, fitted to all runs."""
    steps = horizon // step
    limit = 20 * np.abs(np.concatenate([y for y, _ in runs])).max(0)
    width = runs[0][0].shape[1] + runs[0][1].shape[1]
    kinds = [1, 2, "signed squares"] + ([3] if width <= 7 else [])
    best = (np.inf, None)
    for setting in itertools.product(kinds, THRESHOLDS, RIDGES):
        pairs = []
        for i, run in enumerate(runs):
            origins = np.arange(warm_up, len(run[0]) - horizon, max(1, int(horizon * QUARTER)))
            if len(origins):
                model = fit(runs[:i] + runs[i + 1 :], step, *setting)
                pairs.append((rollout(model, run, origins, steps, step, limit), run[0][origins + steps * step]))
        score = np.minimum(nrmse(pairs), 10).mean()
        if score < best[0]:
            best = (score, setting)
    return fit(runs, step, *best[1]), limit, best


def main():
    warnings.filterwarnings("ignore")
    folder = Path(sys.argv[1])
    sets = json.loads((folder / "sets.json").read_text())
    for of in sets:
        if sys.argv[2:] and of["name"] not in sys.argv[2:]:
            continue
        outputs, horizon = of["outputs"], int(of["horizon"])
        step = max(1, round(horizon / 30))
        warm_up = round(10 / of["dt"])
        read = lambda file: np.loadtxt(folder / file, delimiter=",", skiprows=1, ndmin=2)
        runs = [[(d[:, :outputs], d[:, outputs:]) for d in map(read, files)] for files in of["runs"]]
        pairs, settings = [], []
        for i, test in enumerate(runs):
            train = [part for j, parts in enumerate(runs) if j != i for part in parts]
            y, c = (np.concatenate(column) for column in zip(*train))
            sy, sc = y.std(0), np.sqrt((c**2).mean(0)) + 1e-9
            scale = lambda parts: [(y / sy, c / sc) for y, c in parts]
            model, limit, (_, setting) = identify(scale(train), horizon, step, warm_up)
            settings.append(setting)
            for y, c in test:
                origins = np.arange(warm_up, len(y) - horizon, 5)
                if len(origins):
                    predicted = rollout(model, (y / sy, c / sc), origins, horizon // step, step, limit) * sy
                    pairs.append((predicted, y[origins + horizon]))
        errors = nrmse(pairs)
        shown = " | ".join(f"{x:.3f}" for x in errors)
        print(f"| {of['name']} | {shown} | {errors.mean():.3f} | {settings} |", flush=True)


if __name__ == "__main__":
    main()
