"""Exported vessels: files of `cargo run -p hydroid-export --example coefficients`, or of the binary in HYDROID_COEFFICIENTS."""

import importlib.util
import json
import os
import pathlib
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
VESSELS = ["otter", "mariner", "tug", "workboat", "simple", "hydrofoil", "hydrofoil_low_speed", "launch"]


def write(folder, *models):
    binary = os.environ.get("HYDROID_COEFFICIENTS")
    command = [binary] if binary else ["cargo", "run", "--quiet", "-p", "hydroid-export", "--example", "coefficients", "--"]
    subprocess.run([*command, str(folder), *map(str, models)], cwd=ROOT, check=True)


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    write(folder)
    return folder


@pytest.fixture(params=VESSELS)
def vessel(request, exported):
    """Name, module and run of a vessel."""
    return request.param, load(exported / f"{request.param}.py"), json.loads((exported / f"{request.param}.json").read_text())


def load(path):
    spec = importlib.util.spec_from_file_location(f"exported_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def octave():
    command = shutil.which("octave-cli") or shutil.which("octave")
    if command is None:
        pytest.skip("no octave")

    def run(folder, script):
        result = subprocess.run([command, "--norc", "--quiet", "--eval", script], cwd=folder, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run
