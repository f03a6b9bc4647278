"""Models of every kind as CasADi: HYDROID_EXPORTS names a folder of `cargo run -p hydroid-export --example exports`."""

import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest


def exports():
    """The folders of the models."""
    folder = os.environ.get("HYDROID_EXPORTS")
    if folder is None:
        raise pytest.UsageError(
            "HYDROID_EXPORTS is not set: `cargo run -p hydroid-export --example exports -- FOLDER`, then "
            "`HYDROID_EXPORTS=FOLDER pytest tests/export/casadi`"
        )
    folders = sorted(path.parent for path in Path(folder).glob("*/vessel.py"))
    if not folders:
        raise pytest.UsageError(f"HYDROID_EXPORTS={folder} contains no vessel.py")
    return folders


def load(folder):
    """The module of a model."""
    spec = importlib.util.spec_from_file_location("vessel", folder / "vessel.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Run:
    """A run with hydroid's predictions: tables with a row for each sample."""

    def __init__(self, folder, outputs, inputs):
        run = json.loads((folder / "run.json").read_text())
        widths = {"first": outputs, "held": inputs, "along": inputs, "measured": outputs}
        widths |= {"ahead": inputs, "predicted": outputs, "stepped": outputs}
        for name, width in widths.items():
            numbers = [np.nan if number is None else number for number in run[name]]
            setattr(self, name, np.array(numbers, float).reshape(-1, width))

    def follow(self, model):
        """The state after the steady motion and the measurements."""
        x = model.start(self.first[0], self.held[0])
        for command, measured in zip(self.along, self.measured):
            x = model.observe(model.step(x, command), measured)
        return x


def pytest_generate_tests(metafunc):
    if "folder" in metafunc.fixturenames:
        folders = exports()
        metafunc.parametrize("folder", folders, ids=[folder.name for folder in folders])


@pytest.fixture
def model(folder):
    return load(folder)


@pytest.fixture
def run(folder, model):
    return Run(folder, len(model.OUTPUTS), len(model.INPUTS))
