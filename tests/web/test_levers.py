"""Gamepad and wind in the driving view."""

import math
import pathlib
import subprocess

import pytest
from steps import COMMAND, DATA, choose, driven, needs_command, needs_data

PAD = "(axes) => { navigator.getGamepads = () => [null, { axes }]; }"


def becomes(page, what, condition):
    """Waits for a value. The policy of the page forbids functions from texts, with which Playwright waits."""
    for _ in range(100):
        value = page.evaluate(what)
        if condition(value):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"{what}: {value}")


def at(page, push, turn):
    becomes(page, "[view.levers.push, view.levers.turn]", lambda levers: levers == pytest.approx([push, turn]))


def slide(page, name, value):
    page.get_by_label(name).evaluate("(range, value) => { range.value = value; range.dispatchEvent(new Event('input')); }", value)


def test_a_gamepad_pushes_and_turns(tab):
    page = tab()
    page.click("#example")
    driven(page)
    page.evaluate(PAD, [0.05, -0.8, 0.6, 0])
    at(page, 0.8, 0.6)
    # At rest it leaves the levers to the keys.
    page.evaluate(PAD, [0, -0.05, 0.03, 0])
    at(page, 0, 0)
    page.locator("canvas.chart").focus()
    page.keyboard.press("ArrowUp")
    page.wait_for_timeout(300)
    push, turn = page.evaluate("[view.levers.push, view.levers.turn]")
    assert 0.1 <= push < 0.5 and turn == 0, (push, turn)
    # A single stick.
    page.evaluate(PAD, [0.5, 0.5])
    at(page, -0.5, 0.5)


@needs_data
@needs_command
def test_wind_moves_a_vessel_that_was_identified_with_it(tab, tmp_path):
    runs = pathlib.Path(DATA) / "esso-osaka"
    logs = [runs / f"random_{name}.csv" for name in ["03-Aug-2020_11_04_37", "06-Aug-2020_16_24_25_1"]]
    options = ["--methods", "committee", "--outputs", "u=u_velo,v=vm_velo,r=r_angvelo", "--inputs", "n=n_prop,delta=delta_rudder"]
    wind = ["--wind", "wind_velo_relative_mid,wind_dir_relative_mid"]
    subprocess.run([COMMAND, "identify", *logs, *options, *wind, "-q", "-o", tmp_path], check=False, timeout=300)
    page = tab()
    choose(page, tmp_path / "committee.safetensors")
    driven(page)
    names = page.evaluate("view.vessel.inputs.map((port) => port.channel.name)")
    assert "wind_x" in names and page.get_by_label("wind_x").count() == 0
    slide(page, "Wind [m/s]", 3)
    slide(page, "direction of the wind", 120)
    strength = float(page.get_by_label("Wind [m/s]").input_value())
    assert strength > 1
    for _ in range(2):
        command = dict(zip(names, page.evaluate("view.command")))
        assert command["wind_x"] == pytest.approx(strength**2 * math.cos(math.radians(120)))
        assert command["wind_y"] == pytest.approx(strength**2 * math.sin(math.radians(120)))
        # Levers leave the wind as it is.
        page.evaluate("view.set(0, 0)")
    becomes(page, "view.plant.nu()[1]", lambda v: abs(v) > 0.005)
