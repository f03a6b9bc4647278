"""The way by hand: from an unknown boat to a steered one by clicks on the page in Chromium.

With the variable `HYDROID_FILM`, the name of a folder, each step leaves a screenshot there. Those of docs/live.md:

    HYDROID_FILM=docs/film pytest tests/boat/test_film.py
    pip install pillow
    python3 -c 'import glob, PIL.Image as I; [I.open(p).convert("RGB").quantize(64).save(p) for p in glob.glob("docs/film/*")]'
"""

import os
import pathlib
import re
import shutil

import pytest
from boat import HOLD, LOITER, MANUAL
from playwright.sync_api import expect, sync_playwright
from test_live import FAST

# It is the way of test_live.py once more, with a browser that needs the processor, too.
pytestmark = pytest.mark.skipif("HYDROID_FILM" not in os.environ, reason="skipped: no HYDROID_FILM")

DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


class Operator:
    """Reads the page and presses its buttons. It knows nothing else of hydroid."""

    def __init__(self, page, folder):
        self.page, self.folder, self.shots = page, folder, 0

    def see(self, where, text, seconds=15.0):
        """Waits until a part of the page contains a text."""
        expect(self.page.locator(where)).to_contain_text(text, timeout=1000 * seconds)

    def steered_until(self, holds, seconds, what):
        """Waits until something holds of the page, while hydroid steers."""
        for _ in range(int(4 * seconds)):
            if holds():
                return
            steers = "STEERING" in self.page.locator("#s-helm").inner_text()
            assert steers, self.page.locator("#said").inner_text()
            self.page.wait_for_timeout(250)
        raise AssertionError(f"{what}: not within {seconds} s\n{self.page.locator('body').inner_text()}")

    def figure(self, where):
        """The first number in a part of the page; NaN without one."""
        text = self.page.locator(where).first.inner_text().replace("−", "-")
        found = re.search(r"-?\d+(\.\d+)?", text)
        return float(found[0]) if found else float("nan")

    def button(self, action):
        return self.page.locator(f"[data-action={action}]")

    def press(self, action):
        expect(self.button(action)).to_be_enabled()
        self.button(action).click()

    def confirm(self):
        self.page.locator("#confirm-yes").click()
        expect(self.page.locator("#confirm")).to_be_hidden()

    def errors(self, output):
        """Errors of an output at the longest horizon, frozen and adapted, as a screen reader reads them."""
        plot = self.page.locator(f"[aria-label^='{output}, error after 10 s']")
        return re.search(r"frozen (\S+), adapted (\S+)", plot.get_attribute("aria-label", timeout=60000)).groups()

    def shot(self, name):
        """A picture of the present step."""
        self.shots += 1
        if self.folder:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.page.wait_for_timeout(1200)  # all parts of the page are drawn
            self.page.screenshot(path=self.folder / f"{self.shots:02}-{name}.png", animations="disabled")


@pytest.fixture
def page():
    """A tab in which no script may fail."""
    faults = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        # The page then draws once per second: the boat and hydroid need the computer, too.
        tab = browser.new_context(viewport=DESKTOP, color_scheme="light", reduced_motion="reduce").new_page()
        tab.on("pageerror", lambda error: faults.append(str(error)))
        yield tab
        browser.close()
    assert not faults


@pytest.mark.skipif(not shutil.which("chromium"), reason="there is no Chromium")
def test_by_hand_from_an_unknown_boat_to_a_steered_one(sea, page, tmp_path, monkeypatch):
    film = os.environ.get("HYDROID_FILM")
    operator = Operator(page, pathlib.Path(film).resolve() if film else None)
    # Paths on the page are those of a crew, which starts hydroid in the folder of its boat.
    monkeypatch.chdir(tmp_path)
    water = {"scale": FAST, "seed": 1, "current": (0.15, 0.1)}
    boat, hydroid = sea("new", "--allow-commands", "--fence", "90", "-o", "live", **water)
    boat.armed = False
    boat.mode_switch(HOLD)
    hydroid.wait(lambda s: s["motion"] and s["recording"]["seconds"] > 5.0, 60, "a motion")

    # The address that hydroid has printed opens the page, and the autopilot is there.
    page.goto(re.search(r"page: (\S+)", (tmp_path / "live.log").read_text())[1])
    operator.see("#s-autopilot", "ArduPilot (boat), system 1")
    operator.see("#s-link", "connected")
    operator.see("#s-recording", ".mcap")
    assert "token" not in page.url
    expect(page.locator("#no-token")).to_be_hidden()

    # Before the departure, the page lists what is missing, and a click moves nothing.
    operator.see("#s-mode", "HOLD")
    operator.see("#refusals", "the mode is HOLD: switch to MANUAL")
    operator.see("#refusals", "the autopilot is not armed: arm it")
    page.locator("#experiment").select_option("auto")
    operator.press("experiment")
    operator.confirm()
    operator.see("#result", "the mode is HOLD")
    operator.see("#s-helm", "OFF")
    for action in ("steer", "adopt", "learn", "roll-back"):
        expect(operator.button(action)).to_be_disabled()
    operator.shot("refused")

    # The pilot arms, and selects the mode in which hydroid may command.
    boat.mode_switch(MANUAL)
    boat.armed = True
    operator.see("#s-mode", "MANUAL")
    operator.see("#s-armed", "ARMED")
    expect(page.locator("#refusals li")).to_have_count(0, timeout=60000)

    # The experiment, within the fence.
    operator.press("experiment")
    operator.see("#confirm-text", "commands throttle, steering")
    operator.see("#confirm-text", "radius 90 m")
    operator.shot("question")
    operator.confirm()
    operator.see("#s-helm", "EXPERIMENT")
    recorded = page.locator("#s-recording dd").first.inner_text()
    operator.see("#experiment-text", "execute 3", 200)  # of a zigzag
    assert page.locator("#s-recording dd").first.inner_text() != recorded, "the recording does not grow"
    assert operator.figure("#m-speed dd") > 0.3
    operator.shot("experiment")
    operator.see("#s-helm", "OFF", 400)
    operator.see("#said", "the experiment auto is complete")
    operator.see("#excitation-seconds", "✓ sufficient")

    # The pilot keeps the boat at its place while the computer works: the current would carry it to the fence.
    boat.mode_switch(LOITER)
    operator.see("#s-mode", "LOITER")

    # A model is identified, offered with its errors, and taken on board.
    operator.press("identify")
    operator.see("#identifying", "Identifying a model")
    operator.see("#offered", "NRMSE", 300)
    operator.see("#offered", "live/model-1/")
    operator.shot("offered")
    boat.mode_switch(MANUAL)
    operator.see("#s-mode", "MANUAL")
    operator.press("adopt")
    operator.see("#result", "is on board")
    operator.see("#s-model", "learning")
    expect(page.locator("#outputs .output")).to_have_count(3)

    # It steers along the path of the settings.
    operator.press("steer")
    operator.see("#confirm-title", "Steer along the path?")
    operator.see("#confirm-text", "path")
    operator.confirm()
    operator.see("#s-helm", "STEERING", 60)
    expect(operator.button("adopt")).to_be_disabled()
    # The first leg leads north from its start in the south-west.
    operator.steered_until(lambda: operator.figure("#m-north dd") < -20, 150, "the start of the path")
    operator.steered_until(lambda: operator.figure("#m-north dd") > 20, 200, "the first leg")
    operator.see("#s-helm", "STEERING")
    operator.see("#helm-note", "from the reference")
    assert operator.figure("#helm-note") < 10.0
    assert 0.05 < operator.figure("#m-current dd") < 0.4, "the current of 0.18 m/s"
    # A band beside each prediction, and errors of both models at the longest horizon.
    for output in ("u", "v", "r"):
        frozen, adapted = operator.errors(output)
        print(f"error of {output} after 10 s: frozen {frozen}, adapted {adapted}")
        assert "–" not in (frozen, adapted)
    for figures in page.locator(".output .now").all_inner_texts():
        assert re.fullmatch(r"measured −?[\d.]+, predicted −?[\d.]+ ± [\d.]+ \S+", figures), figures
    operator.shot("steering")
    page.set_viewport_size(PHONE)
    expect(page.locator("#stop")).to_be_in_viewport()
    operator.shot("phone")
    page.set_viewport_size(DESKTOP)

    # The pilot takes over by the mode switch, and hydroid does not begin again.
    boat.mode_switch(HOLD)
    operator.see("#s-helm", "OFF", 5)
    operator.see("#warnings", "hands off: the mode is HOLD")
    operator.shot("hands-off")
    boat.mode_switch(MANUAL)
    operator.see("#s-mode", "MANUAL")
    page.wait_for_timeout(2000)
    operator.see("#s-helm", "OFF")
    assert hydroid.stop() == 130
