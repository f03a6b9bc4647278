"""Steps of a visit to the page, and what the tests share."""

import math
import os
import pathlib
import random
import re
import time
from contextlib import contextmanager

import pytest
from playwright.sync_api import expect

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "web/dist/hydroid.html"
SITE = ROOT / "web/dist/site"
SHOTS = ROOT / "target/web-shots"
DATA = os.environ.get("HYDROID_DATA")
COMMAND = os.environ.get("HYDROID_COMMAND")
SHIP = pathlib.Path(DATA or "") / "cybership-enterprise1"
THRUSTERS = ["u1_vsp1_x", "u2_vsp1_y", "u3_vsp2_x", "u4_vsp2_y", "u5_bowthruster"]
NAMES = ["</script><script>alert(1)</script>", "<img src=x onerror=alert(1)>", "a\"'`]", "ü" * 30, "__proto__"]
needs_data = pytest.mark.skipif(not DATA, reason="no HYDROID_DATA")
needs_command = pytest.mark.skipif(not COMMAND, reason="no HYDROID_COMMAND")


@contextmanager
def timed(what):
    """Prints a duration: no test asserts one."""
    begun = time.monotonic()
    yield
    print(f"{what}: {time.monotonic() - begun:.2f} s")


def shot(page, name):
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", full_page=True)


def choose(page, *files):
    """Files by their paths, or as a name and a content."""
    payload = [
        str(f) if not isinstance(f, tuple) else {"name": f[0], "mimeType": "application/octet-stream", "buffer": f[1]} for f in files
    ]
    page.set_input_files("#choose", payload)


def columns_of(page, *files, timeout=30_000):
    """Chooses files, and waits for the table of their columns."""
    choose(page, *files)
    expect(page.locator("#column-table tbody tr")).not_to_have_count(0, timeout=timeout)


def role(page, column, value):
    row = page.locator("#column-table tbody tr", has=page.get_by_role("rowheader", name=column, exact=True))
    row.locator("select").first.select_option(value)


def thrusters(page):
    """The thrusters of the model ship are inputs."""
    for column in THRUSTERS:
        role(page, column, "input")


def check(page, timeout=60_000):
    page.click("#check")
    expect(page.locator("#check")).to_be_enabled(timeout=timeout)


def identify(page, methods=("committee", "sindy")):
    for box in page.locator("#methods input").all():
        box.set_checked(False)
    for method in methods:
        page.evaluate("(m) => { state.methods = [...state.methods, m]; options(); }", method)
    page.click("#run")


def identified(page, methods=("committee", "sindy"), timeout=240_000):
    """Identifies, and waits for the vessel that can be driven."""
    # What is shown of an earlier model is not an answer.
    page.evaluate("$('verdicts').replaceChildren(); $('driving').replaceChildren()")
    identify(page, methods)
    page.wait_for_timeout(100)
    expect(page.locator("#run")).to_be_enabled(timeout=timeout)
    assert page.locator("#identify-message").inner_text() == ""
    expect(page.locator("#verdicts li")).not_to_have_count(0)
    driven(page)


def driven(page):
    expect(page.locator("#driving .figures")).to_contain_text("m/s", timeout=20_000)


def figures(page):
    """Time [s], u, v [m/s], yaw rate [deg/s], speed [m/s], heading [deg]."""
    text = page.locator("#driving .figures").inner_text().replace("−", "-")
    return [float(x) for x in re.findall(r"-?\d+\.?\d*", text)]


def table(names, rows=400):
    """A CSV file of waves."""
    head = "t," + ",".join('"' + n.replace('"', '""') + '"' for n in names)
    lines = [head]
    for k in range(rows):
        lines.append(f"{0.1 * k}," + ",".join(str((k * (i + 3)) % 17 - 8 + 0.1 * i) for i in range(len(names))))
    return "\n".join(lines).encode()


def boat(rows=1500, seed=0):
    """Rows of t, u, v, r, n_cmd, delta_cmd of a boat that follows steps of its commands, sampled at 10 Hz with noise."""
    draw = random.Random(seed)
    u = v = r = n = delta = 0.0
    found = []
    for k in range(rows):
        if k % 40 == 0:
            n, delta = draw.uniform(0, 2), draw.uniform(-0.5, 0.5)
        noisy = [x + draw.gauss(0, 0.003) for x in (u, v, r)]
        found.append([k / 10, *noisy, n, delta])
        u, v, r = (
            u + 0.1 * (n - 0.4 * u - 0.3 * u * abs(u)) + 0.02 * v * r,
            v + 0.1 * (-0.8 * v - 0.5 * u * r),
            r + 0.1 * (0.6 * delta * u - 0.5 * r - 0.4 * r * abs(r)),
        )
    assert all(math.isfinite(x) for row in found for x in row)
    return found


def csv(rows, names=("t", "u", "v", "r", "n_cmd", "delta_cmd")):
    """A table as a CSV file."""
    head = ",".join('"' + name.replace('"', '""') + '"' for name in names)
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]).encode()


def goes_on(page):
    """A log that is chosen next becomes a vessel that is driven, without the logs before it."""
    while left := page.locator("#file-list li").count():
        page.locator("#file-list button").first.click()
        expect(page.locator("#file-list li")).to_have_count(left - 1)
    choose(page, ("good.csv", csv(boat())))
    expect(page.get_by_role("rowheader", name="delta_cmd", exact=True)).to_be_visible(timeout=60_000)
    check(page)
    identified(page, ["sindy"])


def saved(page, button, folder):
    """The file of a button, of which a part of the text is given."""
    with page.expect_download() as download:
        page.locator("#save").get_by_role("button", name=button).click()
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path
