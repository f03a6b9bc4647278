"""Large logs: time and memory."""

import itertools
import math
import random
import subprocess

import pytest
from memory import Peaks
from playwright.sync_api import expect
from steps import COMMAND, ROOT, check, choose, columns_of, goes_on, identified, needs_command, role, timed

LARGE = 500_000_000


def write_log(path, size):
    """A table of outputs and commands, of a size [bytes]; returns its rows."""
    # The times count; the rest repeats every 1,000 rows.
    def wave(k, period, scale):
        return scale * math.sin(2 * math.pi * k / period)

    rest = [
        "".join(f",{x!r}" for x in (1 + wave(k, 500, 0.5), wave(k, 250, 0.1), wave(k, 250, 0.2), 50 + wave(k, 500, 25), wave(k, 125, 0.3)))
        for k in range(1000)
    ]
    with open(path, "w", encoding="utf-8") as file:
        written, rows = file.write("t,u,v,r,n_cmd,delta_cmd\n"), 0
        for block in itertools.count():
            if written >= size:
                return rows
            written += file.write("".join(f"{block * 100 + k / 10:.1f}{text}\n" for k, text in enumerate(rest)))
            rows += len(rest)


@pytest.fixture
def large(chromium, tab):
    """The page in a browser of its own, with the peaks of its memory, which are printed."""
    with Peaks() as peaks:
        own = chromium()
        page = tab(within=own)
        yield page, peaks
    print(peaks)
    own.close()


def read_or_refused(page, path):
    """Whether a file of any size is read; else there is a message that names it."""
    with timed(f"{path.name}, {path.stat().st_size / 1e6:.0f} MB: columns or a message"):
        choose(page, path)
        message = page.locator("#files .message[data-level=error]:not(:empty)")
        expect(message.or_(page.locator("#column-table tbody tr")).first).to_be_visible(timeout=280_000)
    for text in message.all_inner_texts():
        print(text[:300])
        assert path.name in page.locator("#files").inner_text() and len(text) < 1000
    return message.count() == 0


def test_a_table_of_500_mb_is_read_or_refused(large, tmp_path):
    page, peaks = large
    rows = write_log(tmp_path / "large.csv", LARGE)
    if read_or_refused(page, tmp_path / "large.csv"):
        expect(page.locator("#file-list")).to_contain_text(str(rows))
        with timed("check"):
            check(page, timeout=280_000)
        expect(page.locator("#curves canvas").first).to_be_visible()
    goes_on(page)


@pytest.mark.parametrize("kind", ["noise", "zeros", "line"])
def test_500_mb_that_are_no_log_are_refused(large, tmp_path, kind):
    page, _ = large
    path = tmp_path / f"{kind}.csv"
    block = {"noise": random.Random(0).randbytes(LARGE // 100), "zeros": bytes(LARGE // 100), "line": b"a" * (LARGE // 100)}[kind]
    with open(path, "wb") as file:
        for _ in range(100):
            file.write(block)
    assert not read_or_refused(page, path)
    goes_on(page)


@needs_command
def test_72_000_samples_are_identified_within_a_gigabyte(large, tmp_path):
    page, peaks = large
    log = tmp_path / "otter.csv"
    subprocess.run([COMMAND, "simulate", ROOT / "vessels/otter.toml", "--duration", "7200", "-o", log, "-q"], check=True)
    columns_of(page, log)
    for column in ["pwm_left", "pwm_right"]:
        role(page, column, "input")
    with timed("check"):
        check(page)
    expect(page.locator("#curves summary")).to_contain_text("72000")
    with timed("identification"):
        identified(page, timeout=280_000)
    assert 0 < peaks.of("renderer") < 1e9, peaks
    with timed("the command on one thread"):
        channels = ["--outputs", "u,v,r", "--inputs", "pwm_left,pwm_right"]
        subprocess.run([COMMAND, "identify", log, *channels, "--threads", "1", "-o", tmp_path / "out", "-q"], check=True, capture_output=True)


def test_a_table_of_10_mb_is_drawn(large, tmp_path):
    page, _ = large
    rows = write_log(tmp_path / "ten.csv", 10_000_000)
    with timed(f"{rows} rows: table of the columns"):
        columns_of(page, tmp_path / "ten.csv")
    with timed("from the check to the first curve"):
        page.click("#check")
        expect(page.locator("#curves canvas").first).to_be_visible(timeout=60_000)
    assert page.locator("#curves .plot").count() == 5
