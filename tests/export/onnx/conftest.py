"""Exported models: the folders that `cargo run -p hydroid-export --example exports -- FOLDER` writes; HYDROID_EXPORTS names
the folder, and without it the command runs."""

import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]


def written():
    folder = os.environ.get("HYDROID_EXPORTS")
    if folder:
        return pathlib.Path(folder)
    folder = ROOT / "target" / "exports"
    command = ["cargo", "run", "--quiet", "-p", "hydroid-export", "--example", "exports", "--", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True)
    return folder


def pytest_generate_tests(metafunc):
    if "folder" in metafunc.fixturenames:
        folders = sorted(path for path in written().iterdir() if (path / "vessel_step.onnx").exists())
        assert len(folders) > 40, "models of every kind"
        metafunc.parametrize("folder", folders, ids=lambda path: path.name, scope="session")


@pytest.fixture(params=["vessel", "vessel_float"], ids=["double", "float"])
def name(request):
    return request.param
