"""The tests of the page with the page of `hydroid live`, which shows the simulated boat."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest
from conftest import TOKEN

PAGE = pathlib.Path(__file__).parents[1] / "page"


@pytest.mark.skipif(not shutil.which("chromium"), reason="there is no Chromium")
def test_page_of_a_session(sea):
    boat, hydroid = sea("new")
    boat.sticks(0.2, 0.6)
    hydroid.wait(lambda s: s["motion"], 30, "a motion")
    settings = os.environ | {"HYDROID_URL": hydroid.url, "HYDROID_TOKEN": TOKEN}
    words = [sys.executable, "-m", "pytest", "--quiet", "--timeout", "120", "-p", "no:cacheprovider", str(PAGE)]
    done = subprocess.run(words, env=settings, capture_output=True, text=True, timeout=550)
    assert done.returncode == 0, done.stdout[-4000:]
