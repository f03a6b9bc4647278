"""Reports of the command in a browser: `hydroid report --interactive`. The command is that of HYDROID_COMMAND."""

import csv
import os
import pathlib
import re
import subprocess

import pytest
from playwright.sync_api import expect

ROOT = pathlib.Path(__file__).parents[2]
COMMAND = os.environ.get("HYDROID_COMMAND")
DATA = os.environ.get("HYDROID_DATA")
pytestmark = pytest.mark.skipif(not COMMAND, reason="no HYDROID_COMMAND")

# The poses and velocities over ground of a simulated log in a current, from its commands, in the page.
REPLAY = """(rows) => {
  const { vessel } = JSON.parse(document.getElementById("vessel").textContent);
  const plant = new Plant(vessel);
  plant.x.set(plant.functions.start(vessel.rest, rows[0]));
  plant.current = [0.3, -0.2];
  return rows.map((command) => { const row = [...plant.eta, ...plant.over_ground()]; plant.advance(command); return row; });
}"""


# The velocities in a turning circle, after an approach with the propulsion of its first command.
TURN = """(commands) => {
  const { vessel } = JSON.parse(document.getElementById("vessel").textContent);
  const plant = new Plant(vessel);
  for (let k = 0; k < 20000; k += 1) plant.advance([commands[0][0], 0]);
  return commands.map((command) => { const row = plant.nu(); plant.advance(command); return row; });
}"""


def hydroid(*words):
    done = subprocess.run([COMMAND, *map(str, words), "-q"], capture_output=True, text=True, check=False)
    # 1: a model that is not good enough is a model.
    assert done.returncode in (0, 1), done.stderr


@pytest.fixture
def opened(browser):
    """Opens the page of a report; an error in it fails the test, and so does a request or a dialog."""
    faults, contexts = [], []

    def open_page(path):
        context = browser.new_context(offline=True)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda m: faults.append(m.text) if m.type in ("error", "warning") else None)
        page.on("dialog", lambda dialog: (faults.append(dialog.message), dialog.dismiss()))
        page.on("request", lambda r: faults.append(r.url[:80]) if not re.match("file:|blob:|data:", r.url) else None)
        page.goto(pathlib.Path(path).as_uri())
        return page

    yield open_page
    # A page that is left open drives on.
    for context in contexts:
        context.close()
    assert faults == []


def replayed(opened, model, folder, steps=400):
    """The largest difference between the page and the command, relative to the largest value of each quantity."""
    log, report = folder / "log.csv", folder / "report.html"
    hydroid("simulate", model, "--duration", 40, "--noise", 0, "--seed", 5, "--current", "0.3,-0.2", "-o", log)
    hydroid("report", model, "--interactive", "-o", report)
    with open(log, encoding="utf-8") as file:
        heads, *rows = csv.reader(file)
    names = [head.split(" [")[0] for head in heads]
    rows = [[float(x) for x in row] for row in rows[:steps]]
    page = opened(report)
    inputs = page.evaluate('() => JSON.parse(document.getElementById("vessel").textContent).vessel.inputs.map((port) => port.channel.name)')
    inputs = [names.index(name) for name in inputs]
    columns = [names.index(name) for name in ["x", "y", "psi", "u_true", "v_true", "r_true"]]
    truth = [[row[i] for i in columns] for row in rows]
    found = page.evaluate(REPLAY, [[row[i] for i in inputs] for row in rows])
    assert len(found) == len(truth) > 100
    largest = [max(abs(row[c]) for row in truth) for c in range(len(truth[0]))]
    assert max(largest[3:]) > 0.1, "the vessel moves"
    return max(abs(a[c] - b[c]) / max(largest[c], 1e-3) for a, b in zip(found, truth) for c in range(len(a)))


# `hydroid simulate hydrofoil` has an integration of its own.
@pytest.mark.parametrize("vessel", ["mariner", "otter", "tug"])
def test_a_vessel_moves_on_the_page_as_in_the_command(opened, tmp_path, vessel):
    assert replayed(opened, ROOT / f"vessels/{vessel}.toml", tmp_path) < 1e-9


@pytest.mark.parametrize("plant", ["simple", "hydrofoil"])
def test_a_built_in_vessel_turns_on_the_page_as_in_the_command(opened, tmp_path, plant):
    """The velocities of a turning circle. `hydroid manoeuvre` samples it every 0.01 s, the page every 0.1 s; a step of the
    integration has an error of about 3e-6 of the change of the motion (`CraftModel`)."""
    hydroid("manoeuvre", plant, "--trials", "turning-circle", "-o", tmp_path)
    hydroid("report", plant, "--interactive", "-o", tmp_path / "boat.html")
    with open(tmp_path / "tracks.csv", encoding="utf-8") as file:
        heads, *rows = csv.reader(file)
    assert heads[8:11] == ["u [m/s]", "v [m/s]", "r [rad/s]"]
    truth = [[float(x) for x in row[2:]] for row in rows if row[0] == "0"][::10]
    assert [round(row[0], 9) for row in truth[:3]] == [0, 0.1, 0.2]
    found = opened(tmp_path / "boat.html").evaluate(TURN, [row[1:3] for row in truth])
    largest = [max(abs(row[c]) for row in truth) for c in (6, 7, 8)]
    assert max(abs(a[i] - b[6 + i]) / largest[i] for a, b in zip(found, truth) for i in range(3)) < 3e-6


@pytest.mark.skipif(not DATA, reason="no HYDROID_DATA")
# Not direct: the trials of its report can take minutes.
@pytest.mark.parametrize("method", ["committee", "sindy", "gru", "lstm", "affine"])
def test_a_model_moves_on_the_page_as_in_the_command(opened, tmp_path, method):
    ship = pathlib.Path(DATA) / "cybership-enterprise1"
    files = [ship / "random_run1.csv", "--validate", ship / "run1.csv", "--test", ship / "random_run3.csv"]
    inputs = "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster"
    options = ["--methods", method, "--outputs", "u=u_mps,v=v_mps,r=r_radps", "--inputs", inputs, "--budget", "5s"]
    hydroid("identify", *files, *options, "-o", tmp_path / "out")
    assert replayed(opened, tmp_path / f"out/{method}.safetensors", tmp_path) < 1e-9


@pytest.mark.skipif(not DATA, reason="no HYDROID_DATA")
def test_a_report_is_driven_beside_the_trials_of_a_log(opened, tmp_path):
    runs = pathlib.Path(DATA) / "esso-osaka"
    logs = [runs / f"random_{name}.csv" for name in ["03-Aug-2020_11_04_37", "06-Aug-2020_16_24_25_1"]]
    options = ["--methods", "committee", "--outputs", "u=u_velo,v=vm_velo,r=r_angvelo", "--inputs", "n=n_prop,delta=delta_rudder"]
    hydroid("identify", *logs, *options, "-o", tmp_path / "out")
    report = tmp_path / "report.html"
    hydroid("report", tmp_path / "out/committee.safetensors", runs / "zigzag_31-Jul-2020_13_22_52.csv", "--interactive", "-o", report)
    page = opened(report)
    page.locator("canvas.chart").focus()
    page.keyboard.down("ArrowUp")
    page.wait_for_timeout(1500)
    page.keyboard.up("ArrowUp")
    page.locator(".driving select").select_option("10")
    expect(page.locator(".driving .figures")).to_contain_text(re.compile(r"ahead u\s*0\.[0-9]*[1-9]"), timeout=10_000)
    page.get_by_role("button", name=re.compile("13_22_52.*zigzag")).click()
    expect(page.locator(".results")).to_contain_text("measured")
    expect(page.locator(".results")).to_contain_text("overshoot")
    page.get_by_role("button", name="Back to driving").click()
    expect(page.locator(".results")).to_have_count(0)


def test_a_name_of_a_model_is_text(opened, tmp_path):
    text = (ROOT / "vessels/otter.toml").read_text(encoding="utf-8")
    hostile = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    vessel = tmp_path / "boat.toml"
    vessel.write_text(text.replace('name = "otter"', f'name = "{hostile}"', 1), encoding="utf-8")
    hydroid("report", vessel, "--interactive", "-o", tmp_path / "report.html")
    page = opened(tmp_path / "report.html")
    expect(page.locator("h1")).to_contain_text(hostile)
    expect(page.locator(".driving .figures")).to_contain_text("m/s", timeout=10_000)
    assert page.locator("img").count() == 0
