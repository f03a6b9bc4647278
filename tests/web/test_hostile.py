"""Logs with names and numbers that no boat writes: each ends with a model or a message, and the page goes on."""

import pytest
from playwright.sync_api import expect
from steps import NAMES, boat, check, choose, columns_of, csv, goes_on, identify, role

HEAD = ["t", "u", "v", "r", "n_cmd", "delta_cmd"]


def poisoned(cell, every=7, columns=(1, 2, 3, 4, 5)):
    """Rows at equal distances have a cell of another content, in each of the columns."""
    rows = boat(600)
    for k in range(3, len(rows), every):
        for column in columns:
            rows[k][column] = cell(k) if callable(cell) else cell
    return csv(rows)


def only(value):
    """A log in which all values of the outputs are the same."""
    return csv([[row[0], value, value, value, *row[4:]] for row in boat(600)])


LOGS = {
    "huge": lambda: poisoned("1e308"),
    "huge-of-both-signs": lambda: poisoned(lambda k: "1e308" if k % 2 else "-1e308"),
    "beyond-numbers": lambda: poisoned("1e999"),
    "tiny": lambda: poisoned("1e-320", every=1),
    "nan": lambda: poisoned("NaN"),
    "inf": lambda: poisoned(lambda k: "inf" if k % 2 else "-inf"),
    "text": lambda: poisoned("<b>none</b>"),
    "one-huge-command": lambda: poisoned("1e308", every=10_000, columns=[4]),
    "all-nan": lambda: only("NaN"),
    "all-huge": lambda: only("1e308"),
    "at-rest": lambda: only("0"),
    "huge-times": lambda: csv([[row[0] * 1e300, *row[1:]] for row in boat(600)]),
    "one-time": lambda: csv([[5.0, *row[1:]] for row in boat(600)]),
    "back-in-time": lambda: csv(boat(600)[::-1]),
    "same-names": lambda: csv(boat(600), ["t", "u", "u", "u", "n_cmd", "n_cmd"]),
}


def ends(page):
    """The check and the identification end, with a model or a message."""
    if page.locator("#columns").is_hidden():
        return page.locator("#files-message").inner_text()
    check(page)
    if page.locator("#identify").is_hidden():
        expect(page.locator("#columns-message")).not_to_be_empty()
        return "not identified: " + page.locator("#notes").inner_text()
    identify(page)
    expect(page.locator("#run")).to_be_enabled(timeout=240_000)
    if message := page.locator("#identify-message").inner_text():
        return message
    expect(page.locator("#verdicts li")).not_to_have_count(0)
    return "a model"


@pytest.mark.parametrize("kind", LOGS)
def test_numbers_of_no_boat_end_with_a_model_or_a_message(tab, kind):
    page = tab()
    choose(page, (f"{kind}.csv", LOGS[kind]()))
    expect(page.locator("#files-message[data-level=error], #column-table tbody tr").first).to_be_visible(timeout=30_000)
    for column, part in zip(HEAD[1:], ["output"] * 3 + ["input"] * 2):
        if page.get_by_role("rowheader", name=column, exact=True).count() == 1:
            role(page, column, part)
    end = ends(page)
    print(kind, end[:300])
    # The page of a phone shows the whole of it.
    assert len(end) < 450
    goes_on(page)


def test_a_log_with_names_of_no_boat_ends_with_a_model_or_a_message(tab):
    page = tab()
    columns_of(page, (f"{NAMES[1]}.csv", csv(boat(), ["t", *NAMES])))
    for name, part in zip(NAMES, ["output"] * 3 + ["input"] * 2):
        role(page, name, part)
    print(ends(page))
    assert page.evaluate("document.querySelectorAll('img, script[src]').length") == 0
    goes_on(page)
