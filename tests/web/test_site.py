"""The folder for a web server."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from playwright.sync_api import expect
from steps import SITE, boat, check, columns_of, csv, driven, figures, identified


class Handler(SimpleHTTPRequestHandler):
    asked = []

    def log_message(self, *_):
        self.asked.append(self.path)


@pytest.fixture
def site():
    """The address of the folder, and the paths that were asked for."""
    Handler.asked = []
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=SITE))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/", Handler.asked
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_example_is_driven_from_a_server(tab, site):
    address, asked = site
    page = tab(address=address)
    page.click("#example")
    driven(page)
    page.evaluate("view.set(1, 0)")
    expect(page.locator("#driving .figures")).to_contain_text("m/s")
    page.wait_for_timeout(2000)
    assert figures(page)[1] > 0.2
    assert set(asked) <= {"/", *(f"/{file.name}" for file in SITE.iterdir())}, asked


def test_a_log_is_identified_from_a_server_and_stays_on_the_device(tab, site):
    address, asked = site
    page = tab(address=address)
    columns_of(page, ("boat.csv", csv(boat())))
    before = len(asked)
    check(page)
    identified(page, ["sindy"])
    page.locator("#report details").first.evaluate("(e) => { e.open = true; }")
    expect(page.frame_locator("#page").locator("h1").first).to_be_visible()
    # Driving may start the second worker.
    assert set(asked[before:]) <= {"/worker.js"}, asked
