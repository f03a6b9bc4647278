"""What the page writes is used by the command and by others."""

import json
import re
import subprocess

import pytest
from playwright.sync_api import expect
from steps import COMMAND, boat, check, columns_of, csv, identified, needs_command, saved


@pytest.fixture
def visited(tab):
    """The page with a model of a log."""
    page = tab()
    columns_of(page, ("boat.csv", csv(boat())))
    check(page)
    identified(page)
    return page


def run(*arguments, **options):
    return subprocess.run([COMMAND, *map(str, arguments)], check=True, capture_output=True, text=True, **options).stdout


@needs_command
def test_the_command_reads_what_was_saved(visited, tmp_path):
    page = visited
    model = saved(page, "Model", tmp_path)
    assert model.suffix == ".safetensors"
    text = run("inspect", model, "--json")
    assert {"u", "v", "r"} <= set(re.findall(r'"name": *"(\w+)"', text)), text[:500]

    report = saved(page, "Report", tmp_path)
    assert report.read_text(encoding="utf-8").lower().startswith("<!doctype html>") and report.suffix == ".html"
    summary = json.loads(saved(page, "JSON", tmp_path).read_text(encoding="utf-8"))

    settings = saved(page, "hydroid.toml", tmp_path)
    (tmp_path / "boat.csv").write_bytes(csv(boat()))
    # The file is read from the folder of the logs, without an option.
    assert settings.name == "hydroid.toml"
    run("identify", "--methods", ",".join(page.evaluate("state.methods")), "-o", "out", "-q", cwd=tmp_path)
    truth = json.loads((tmp_path / "out/identify.json").read_text(encoding="utf-8"))
    assert [v["channel"] for v in summary["verdicts"]] == [v["channel"] for v in truth["verdicts"]]
    for own, of_command in zip(summary["verdicts"], truth["verdicts"]):
        assert own["nrmse"] == pytest.approx(of_command["nrmse"], rel=1e-6), (own, of_command)


def test_each_export_is_a_file_or_a_message(visited, tmp_path):
    page = visited
    downloads = []
    page.on("download", lambda download: downloads.append(download))
    message = page.locator("#save-message")
    for format, text in page.evaluate("Object.entries(TEXT.exports)"):
        downloads.clear()
        page.evaluate("say('save-message', '')")
        page.locator("#save").get_by_role("button", name=text, exact=True).click()
        expect(message).not_to_be_empty(timeout=60_000)
        if message.get_attribute("data-level") == "error":
            print(format, message.inner_text())
            assert not downloads
            continue
        page.wait_for_timeout(500)
        names = sorted(download.suggested_filename for download in downloads)
        print(format, names)
        assert names and all(name in message.inner_text() for name in names)
        for download in downloads:
            download.save_as(tmp_path / format / download.suggested_filename)
        if format == "c":
            assert {name.rpartition(".")[2] for name in names} >= {"c", "h"}
            sources = (tmp_path / "c").glob("*.c")
            subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", "-fsyntax-only", *sources], check=True, cwd=tmp_path / "c")


@needs_command
def test_the_exported_c_is_that_of_the_command(visited, tmp_path):
    page = visited
    model = saved(page, "Model", tmp_path)
    downloads = []
    page.on("download", lambda download: downloads.append(download))
    page.locator("#save").get_by_role("button", name="C", exact=True).click()
    expect(page.locator("#save-message")).not_to_be_empty(timeout=60_000)
    page.wait_for_timeout(500)
    run("export", model, "--to", "c", "-o", tmp_path / "c")
    truth = {path.name: path.read_bytes() for path in (tmp_path / "c").iterdir()}
    assert {d.suggested_filename: d.path().read_bytes() for d in downloads} == truth
