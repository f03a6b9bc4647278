"""Exported models: folders of `cargo run -p hydroid-export --example exports`, or those in HYDROID_EXPORTS."""

import importlib.util
import json
import math
import os
import pathlib
import subprocess

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def exports(tmp_path_factory):
    known = os.environ.get("HYDROID_EXPORTS")
    if known:
        return pathlib.Path(known)
    folder = tmp_path_factory.mktemp("exports")
    command = ["cargo", "run", "--quiet", "-p", "hydroid-export", "--example", "exports", "--", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True)
    return folder


def load(path):
    spec = importlib.util.spec_from_file_location(f"exported_{path.parent.name}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_of(folder):
    """The run of a model as arrays; a missing measurement is NaN."""
    run = json.loads((folder / "run.json").read_text())
    return {key: np.array([math.nan if x is None else x for x in values]) for key, values in run.items()}
