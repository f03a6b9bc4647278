"""The browser, and the page in it."""

import re

import pytest
from playwright.sync_api import sync_playwright
from steps import PAGE


@pytest.fixture(scope="session")
def chromium():
    """Starts a browser of its own for each call."""
    browsers = []
    with sync_playwright() as playwright:

        def start():
            browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            browsers.append(browser)
            return browser

        yield start
        for browser in browsers:
            browser.close()


@pytest.fixture(scope="session")
def browser(chromium):
    return chromium()


@pytest.fixture
def tab(browser):
    """Opens the page; at the end it may have had no error, no violation of its policy, no dialog, and no request."""
    faults, contexts = [], []

    def open_tab(width=1280, height=900, address=PAGE.as_uri(), within=browser, **options):
        single = address.startswith("file:")
        own = re.compile("(file|blob|data|about):" if single else f"(blob:|data:|about:|{re.escape(address)})")
        context = within.new_context(viewport={"width": width, "height": height}, offline=single, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(f"script: {error}"))
        page.on("dialog", lambda dialog: (faults.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.on("crash", lambda: faults.append("the page crashed"))
        page.on("console", lambda m: faults.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
        context.on("request", lambda r: faults.append(f"request: {r.url[:80]}") if not own.match(r.url) else None)
        page.goto(address)
        return page

    yield open_tab
    for context in contexts:
        context.close()
    assert faults == []
