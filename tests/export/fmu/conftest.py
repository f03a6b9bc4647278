"""FMUs of all kinds of models, with the rollouts of the models, as the tests of hydroid-fmu write them."""

import json
import os
import pathlib
import subprocess

import pytest

REPOSITORY = pathlib.Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """The folder `HYDROID_FMU_FOLDER` if it contains FMUs; else a new one, which cargo fills."""
    path = pathlib.Path(os.environ.get("HYDROID_FMU_FOLDER") or tmp_path_factory.mktemp("fmus"))
    if not any(path.glob("*.fmu")):
        command = ["cargo", "test", "-p", "hydroid-fmu", "--test", "it", "--", "--ignored", "write_fmus"]
        environment = {**os.environ, "HYDROID_FMU_FOLDER": str(path)}
        subprocess.run(command, cwd=REPOSITORY, env=environment, check=True)
    return path


@pytest.fixture(scope="session")
def manifest(folder):
    def read(name):
        return json.loads((folder / f"{name}.json").read_text())

    return read
