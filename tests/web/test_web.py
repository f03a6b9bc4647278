"""Tests of the page in a browser, from the single file: `pytest tests/web` after `build-page` (see web/README.md)."""

import json
import re
import subprocess
import tempfile
import time

import pytest
from playwright.sync_api import expect
from steps import (
    COMMAND,
    NAMES,
    SHIP,
    SHOTS,
    THRUSTERS,
    boat,
    check,
    choose,
    columns_of,
    csv,
    driven,
    figures,
    identified,
    identify,
    needs_data,
    role,
    shot,
    table,
    thrusters,
)


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
    columns_of(page, SHIP / "random_run1.csv", SHIP / "run1.csv", SHIP / "random_run3.csv")
    for column, name in [("u_mps", "u"), ("v_mps", "v"), ("r_radps", "r")]:
        assert page.evaluate("(c) => state.roles.get(c).role === 'output' && state.roles.get(c).name", column) == name
    thrusters(page)
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
    if COMMAND:
        compare(summary, COMMAND)
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
    columns_of(page, SHIP / "random_run1.csv")
    thrusters(page)
    check(page)
    identify(page)
    expect(page.locator(".progress")).to_be_visible()
    page.wait_for_timeout(700)
    page.click(".cancel")
    expect(page.locator("#identify-message")).to_contain_text("Cancelled")
    check(page)
    identify(page, ["sindy"])
    expect(page.locator("#report")).to_be_visible(timeout=240_000)


def test_what_is_no_log_is_an_error_and_the_page_goes_on(tab):
    page = tab()
    for name, content, words in [
        ("empty.csv", b"", "empty"),
        ("picture.png", bytes(range(256)) * 40, "picture.png"),
        ("cut.mcap", b"\x89MCAP0\r\n" + bytes(50), "cut.mcap"),
        ("broken.toml", b"mass = [", "unclosed array"),
        ("model.safetensors", bytes(64), "model.safetensors"),
    ]:
        choose(page, (name, content))
        error = page.locator("#files-message[data-level=error]")
        expect(error.filter(has_text=words)).to_be_visible(timeout=60_000)
    choose(page, ("numbers.csv", b"t,u\n0,1e999\n0.1,NaN\n0.2,-1e308\n"))
    expect(page.locator("#file-list")).to_contain_text("numbers.csv", timeout=60_000)
    choose(page, ("good.csv", table(["u", "r", "n_cmd"])))
    expect(page.get_by_role("rowheader", name="n_cmd", exact=True)).to_be_visible(timeout=20_000)
    shot(page, "errors")


def test_after_the_end_of_a_worker_the_logs_are_there(tab):
    page = tab()
    columns_of(page, ("boat.csv", csv(boat())), ("other.csv", csv(boat(seed=1))))
    page.evaluate("bench.end(new Error(TEXT.lost))")
    check(page)
    expect(page.locator("#curves details")).to_have_count(2)
    identified(page, ["sindy"])
    page.evaluate("helm.end(new Error(TEXT.lost))")
    page.get_by_role("button", name="Turning circle").click()
    expect(page.locator(".driving .message")).to_contain_text("Approach", timeout=60_000)


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
    page.get_by_label("Speed of time").select_option("10")
    for turn in [0.12, -0.3, 0.45, -0.2]:
        page.evaluate("(turn) => view.set(0.6, turn)", turn)
        page.wait_for_timeout(1300)
    north, east = page.evaluate("[Math.max(...view.track.map((p) => p[0])), Math.max(...view.track.map((p) => p[1]))]")
    assert north > 10 or east > 10
    # The first picture of README.
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.locator("#drive").screenshot(path=SHOTS / "drive.png")


def test_a_short_log_shows_what_over_fitting_is(tab):
    page = tab(width=390, height=780, has_touch=True)
    page.click("#example-logs")
    expect(page.locator("#identify")).to_be_visible(timeout=60_000)
    assert page.locator("#advice button").count() == 0, "the neutral positions of the example are set"
    identified(page)
    page.locator("#parts select").nth(0).select_option("unused")
    page.locator("#parts select").nth(1).select_option("train")
    identified(page)
    heads = page.locator("#tries thead th").all_inner_texts()
    rows = page.evaluate("state.tries.map(({ name, learnt, weights, fitted, judged }) => [name, learnt, weights, ...[fitted, judged].map(mean)])")
    print(heads, *rows, page.locator("#ahead").inner_text(), sep="\n")
    errors = {(name, learnt): (own, new) for name, learnt, _, own, new in rows}
    assert len(errors) == 4
    own, new = errors["committee", "short.csv"]
    assert new > 1.5 * own, "many numbers from a short log"
    own, new = errors["sindy", "short.csv"]
    assert new < 1.5 * own, "few numbers from a short log"
    own, new = errors["committee", "long.csv"]
    assert new < 1.5 * own and new < errors["committee", "short.csv"][1]
    page.locator("#tries button").last.click()
    expect(page.locator("#drive-name")).to_contain_text("Equations: short.csv")
    driven(page)
    page.reload()
    expect(page.locator("#tries tbody tr")).to_have_count(4, timeout=60_000)
    shot(page, "class")


@needs_data
def test_trials_of_the_logs_stand_beside_their_predictions(tab):
    page = tab()
    esso = SHIP.parent / "esso-osaka"
    columns_of(page, esso / "random_03-Aug-2020_11_04_37.csv", esso / "zigzag_31-Jul-2020_13_22_52.csv")
    assert page.evaluate("[...state.roles].filter(([, own]) => own.role === 'input').map(([name]) => name).sort()") == ["delta_rudder", "n_prop"]
    assert page.evaluate("[...state.roles].filter(([, own]) => own.role === 'output').map(([, own]) => own.name).sort()") == ["r", "u", "v"]
    check(page)
    identified(page)
    page.get_by_role("button", name="Trials in the logs", exact=True).click()
    expect(page.locator(".results")).to_contain_text("overshoot", timeout=60_000)
    expect(page.locator(".results thead")).to_contain_text("measured")
    expect(page.get_by_role("button", name=re.compile("zigzag (of|reversed)"))).not_to_have_count(0)
    shot(page, "trials")


def test_without_a_command_the_page_asks_for_one(tab):
    page = tab()
    columns_of(page, ("still.csv", table(["u", "v", "r", "first", "second"])))
    check(page)
    expect(page.locator("#columns-message")).to_contain_text("No column is an input")
    expect(page.locator("#identify")).to_be_hidden()
    role(page, "first", "input")
    check(page)
    expect(page.locator("#identify")).to_be_visible()
    assert "--" not in page.locator("#notes").inner_text()


def test_a_result_of_earlier_settings_says_so(tab):
    page = tab()
    columns_of(page, ("boat.csv", csv(boat())))
    check(page)
    identified(page, ["sindy"])
    expect(page.locator("#report-stale")).to_be_empty()
    role(page, "v", "none")
    expect(page.locator("#report-stale")).to_contain_text("earlier")
    check(page)
    identified(page, ["sindy"])
    expect(page.locator("#report-stale")).to_be_empty()
    expect(page.locator("#driving .figures")).to_contain_text("–")
