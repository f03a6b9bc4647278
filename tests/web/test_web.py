"""Tests of the page in a browser, from the single file: `pytest tests/web` after `build-page` (see web/README.md)."""

import json
import os
import pathlib
import re
import subprocess
import tempfile
import time

import pytest
from playwright.sync_api import expect

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "web/dist/hydroid.html"
SHOTS = ROOT / "target/web-shots"
DATA = os.environ.get("HYDROID_DATA")
SHIP = pathlib.Path(DATA or "") / "cybership-enterprise1"
THRUSTERS = ["u1_vsp1_x", "u2_vsp1_y", "u3_vsp2_x", "u4_vsp2_y", "u5_bowthruster"]
needs_data = pytest.mark.skipif(not DATA, reason="no HYDROID_DATA")


@pytest.fixture
def tab(browser):
    """Opens the page; at the end it may have had no error, no violation of its policy, no dialog, and no request."""
    faults, contexts = [], []

    def open_tab(width=1280, height=900, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(f"script: {error}"))
        page.on("dialog", lambda dialog: (faults.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.on("console", lambda m: faults.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
        page.on("request", lambda r: faults.append(f"request: {r.url[:80]}") if not re.match("file:|blob:|data:|about:", r.url) else None)
        page.goto(PAGE.as_uri())
        return page

    yield open_tab
    for context in contexts:
        context.close()
    assert faults == []


def shot(page, name):
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / f"{name}.png", full_page=True)


def choose(page, *files):
    """Files by their paths, or as a name and a content."""
    payload = [
        str(f) if not isinstance(f, tuple) else {"name": f[0], "mimeType": "application/octet-stream", "buffer": f[1]} for f in files
    ]
    page.set_input_files("#choose", payload)


def role(page, column, value):
    row = page.locator("#column-table tbody tr", has=page.get_by_role("rowheader", name=column, exact=True))
    row.locator("select").first.select_option(value)


def check(page):
    page.click("#check")
    expect(page.locator("#check")).to_be_enabled(timeout=60_000)


def identify(page, methods=("committee", "sindy")):
    for box in page.locator("#methods input").all():
        box.set_checked(False)
    for method in methods:
        page.evaluate("(m) => { state.methods = [...state.methods, m]; options(); }", method)
    page.click("#run")


def figures(page):
    text = page.locator("#driving .figures").inner_text().replace("−", "-")
    return [float(x) for x in re.findall(r"-?\d+\.?\d*", text)]


def test_the_example_is_driven_and_turns_a_circle(tab):
    page = tab()
    page.click("#example")
    chart = page.locator("canvas.chart")
    chart.focus()
    expect(page.locator("#driving .figures")).to_contain_text("m/s", timeout=20_000)
    page.keyboard.down("ArrowUp")
    page.wait_for_timeout(2500)
    page.keyboard.up("ArrowUp")
    page.keyboard.down("ArrowRight")
    page.wait_for_timeout(800)
    page.keyboard.up("ArrowRight")
    page.wait_for_timeout(1500)
    time_s, u, _, r, _, heading = figures(page)[:6]
    assert time_s > 3 and u > 0.5 and r > 1 and 1 < heading < 180, figures(page)
    shot(page, "example")
    page.get_by_role("button", name="Turning circle").click()
    expect(page.locator(".results")).to_contain_text("tactical", timeout=60_000)
    shot(page, "circle")
    page.get_by_role("button", name="Start again").click()
    page.keyboard.press(" ")
    expect(page.locator(".results tr")).to_have_count(0)


@needs_data
def test_a_log_becomes_the_model_of_the_command_and_survives_a_reload(tab):
    page = tab()
    choose(page, SHIP / "random_run1.csv", SHIP / "run1.csv", SHIP / "random_run3.csv")
    expect(page.locator("#column-table tbody tr")).not_to_have_count(0, timeout=30_000)
    for column, name in [("u_mps", "u"), ("v_mps", "v"), ("r_radps", "r")]:
        assert page.evaluate("(c) => state.roles.get(c).role === 'output' && state.roles.get(c).name", column) == name
    for column in THRUSTERS:
        role(page, column, "input")
    check(page)
    expect(page.locator("#curves details")).to_have_count(3)
    page.locator("#parts select").nth(1).select_option("validate")
    page.locator("#parts select").nth(2).select_option("test")
    begun = time.monotonic()
    identify(page)
    expect(page.locator("#report")).to_be_visible(timeout=240_000)
    print(f"identified in {time.monotonic() - begun:.1f} s")
    expect(page.locator("#verdicts li")).to_have_count(3)
    shot(page, "identified")
    summary = page.evaluate("state.result.summary")
    command = os.environ.get("HYDROID_COMMAND")
    if command:
        compare(summary, command)
    page.reload()
    expect(page.locator("#verdicts li")).to_have_count(3, timeout=60_000)
    expect(page.locator("#driving .figures")).to_contain_text("m/s", timeout=20_000)
    assert page.evaluate("state.result.summary") == summary


def compare(summary, command):
    """The models of the page have the errors that the command states: it computes with rounded products and sums."""
    with tempfile.TemporaryDirectory() as folder:
        files = [SHIP / "random_run1.csv", "--validate", SHIP / "run1.csv", "--test", SHIP / "random_run3.csv"]
        channels = ["--outputs", "u=u_mps,v=v_mps,r=r_radps", "--inputs", ",".join(THRUSTERS)]
        methods = ["--methods", "committee,sindy"]
        subprocess.run([command, "identify", *map(str, files), *channels, *methods, "-o", folder, "-q"], check=True, capture_output=True)
        with open(f"{folder}/identify.json", encoding="utf-8") as file:
            truth = json.load(file)

    def same(a, b, path):
        if isinstance(a, dict):
            for key in a.keys() & b.keys():
                if "second" not in key and key not in ("file", "warnings", "notes"):
                    same(a[key], b[key], f"{path}/{key}")
        elif isinstance(a, list):
            assert len(a) == len(b), path
            for i, (x, y) in enumerate(zip(a, b)):
                same(x, y, f"{path}[{i}]")
        elif isinstance(a, (int, float)) and isinstance(b, (int, float)):
            assert a == pytest.approx(b, rel=1e-9, abs=1e-12), path
        else:
            assert a == b, path

    same(summary["models"], truth["models"], "")


@needs_data
def test_a_cancelled_identification_can_be_started_again(tab):
    page = tab()
    choose(page, SHIP / "random_run1.csv")
    expect(page.locator("#column-table tbody tr")).not_to_have_count(0, timeout=30_000)
    for column in THRUSTERS:
        role(page, column, "input")
    check(page)
    identify(page)
    expect(page.locator(".progress")).to_be_visible()
    page.wait_for_timeout(700)
    page.click(".cancel")
    expect(page.locator("#identify-message")).to_contain_text("Cancelled")
    check(page)
    identify(page, ["sindy"])
    expect(page.locator("#report")).to_be_visible(timeout=240_000)


NAMES = ["</script><script>alert(1)</script>", "<img src=x onerror=alert(1)>", "a\"'`]", "ü" * 30, "__proto__"]


def table(names, rows=400):
    head = "t," + ",".join('"' + n.replace('"', '""') + '"' for n in names)
    lines = [head]
    for k in range(rows):
        lines.append(f"{0.1 * k}," + ",".join(str((k * (i + 3)) % 17 - 8 + 0.1 * i) for i in range(len(names))))
    return "\n".join(lines).encode()


def test_what_is_no_log_is_an_error_and_the_page_goes_on(tab):
    page = tab()
    for name, content, words in [
        ("empty.csv", b"", "empty"),
        ("picture.png", bytes(range(256)) * 40, "picture.png"),
        ("cut.mcap", b"\x89MCAP0\r\n" + bytes(50), "cut.mcap"),
        ("broken.toml", b"mass = [", "broken.toml"),
        ("model.safetensors", bytes(64), "model.safetensors"),
        ("numbers.csv", b"t,u\n0,1e999\n0.1,NaN\n0.2,-1e308\n", "numbers.csv"),
    ]:
        choose(page, (name, content))
        expect(page.locator("#files")).to_contain_text(words, timeout=20_000)
    choose(page, ("good.csv", table(["u", "r", "n_cmd"])))
    expect(page.get_by_role("rowheader", name="n_cmd", exact=True)).to_be_visible(timeout=20_000)
    shot(page, "errors")


def test_names_of_a_log_are_text(tab):
    page = tab()
    choose(page, (f"{NAMES[1]}.csv", table(["u", "r", *NAMES])))
    for name in NAMES:
        expect(page.get_by_role("rowheader", name=name, exact=True)).to_be_visible(timeout=20_000)
        role(page, name, "input")
    check(page)
    identify(page, ["sindy"])
    expect(page.locator("#report, #identify-message:not(:empty)").first).to_be_visible(timeout=240_000)
    page.wait_for_timeout(500)
    assert page.evaluate("document.querySelectorAll('img, script[src]').length") == 0
    shot(page, "hostile")


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_its_window(tab, width, scheme):
    page = tab(width=width, height=740, color_scheme=scheme)
    choose(page, ("good.csv", table(["u", "v", "r", "n_cmd", "delta_cmd"])))
    expect(page.get_by_role("rowheader", name="n_cmd", exact=True)).to_be_visible(timeout=20_000)
    check(page)
    page.click("#example")
    expect(page.locator("#driving .figures")).to_contain_text("m/s", timeout=20_000)
    page.wait_for_timeout(700)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    unnamed = page.evaluate(
        "[...document.querySelectorAll('button, input, select, canvas, iframe')]"
        ".filter((e) => !e.closest('[role=img]') && !(e.textContent.trim() || e.getAttribute('aria-label') || e.title || e.labels?.length)).map((e) => e.outerHTML)"
    )
    assert unnamed == []
    shot(page, f"{scheme}-{width}")


def test_a_boat_that_is_driven_leaves_a_track(tab):
    page = tab(width=1180, height=900)
    page.click("#example")
    expect(page.locator("#driving .figures")).to_contain_text("m/s", timeout=20_000)
    page.locator("#driving select").select_option("10")
    for turn in [0.12, -0.3, 0.45, -0.2]:
        page.evaluate("(turn) => view.set(0.6, turn)", turn)
        page.wait_for_timeout(1300)
    north, east = page.evaluate("[Math.max(...view.track.map((p) => p[0])), Math.max(...view.track.map((p) => p[1]))]")
    assert north > 10 or east > 10
    # The first picture of README.
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.locator("#drive").screenshot(path=SHOTS / "drive.png")
