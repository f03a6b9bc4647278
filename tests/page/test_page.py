"""Tests of the page of `hydroid live` in Chromium.

Without settings they run against mock.py. Against a running server, which is not made to move a boat, since all actions
but those of test_http are answered by the test:

    HYDROID_URL=http://127.0.0.1:8600 HYDROID_TOKEN=... pytest tests/page
"""

import http.client
import json
import os
import pathlib
import time
import urllib.parse

import pytest
from mock import HOSTILE, Mock
from playwright.sync_api import expect, sync_playwright

REAL = os.environ.get("HYDROID_URL", "").rstrip("/")
TOKEN = os.environ.get("HYDROID_TOKEN", "secret")
SHOTS = pathlib.Path(__file__).parents[2] / "target/page-shots"
NETWORK = ("net::ERR_CONNECTION_REFUSED", "net::ERR_INCOMPLETE_CHUNKED_ENCODING", "net::ERR_CONNECTION_RESET", "net::ERR_EMPTY_RESPONSE")
# The service answers that it does not know an action or an experiment; the mock is the server, too.
UNKNOWN = 409 if REAL else 400
PLAIN = ["record", "stop-recording", "freeze", "learn", "identify", "adopt", "roll-back"]
MOVING = ["experiment", "steer"]


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        yield browser
        browser.close()


class RealServer:
    url, token = REAL, TOKEN


@pytest.fixture
def server():
    """The server that runs already, or a mock."""
    if REAL:
        yield RealServer
    else:
        mock = Mock(token=TOKEN, warm=90.0).start()
        yield mock
        mock.stop()


@pytest.fixture
def mock(server):
    """A server whose state the test can change."""
    if REAL:
        pytest.skip("needs the mock")
    return server


@pytest.fixture
def tab(browser, server):
    """Opens tabs; at the end none of them may have had an error, a violation of the CSP or a script's dialog."""
    contexts, faults = [], []

    def listen(page):
        page.on("pageerror", lambda error: faults.append(f"script: {error}"))
        page.on("dialog", lambda dialog: (faults.append(f"dialog: {dialog.message}"), dialog.dismiss()))
        page.on("console", lambda m: faults.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
        page.add_init_script("addEventListener('securitypolicyviolation', (e) => console.error('CSP', e.violatedDirective))")

    def open_tab(token=True, context=None, wait=True, **options):
        if context is None:
            context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
            contexts.append(context)
        page = context.new_page()
        listen(page)
        page.goto(f"{server.url}/" + (f"#token={urllib.parse.quote(server.token)}" if token else ""))
        if wait:
            expect(page.locator("body")).not_to_have_class("old")
        return page

    open_tab.allowed = ()
    yield open_tab
    for context in contexts:
        context.close()
    assert [f for f in faults if not any(text in f for text in open_tab.allowed)] == []


def catch(page, status=200, answer=None):
    """Answers the actions of the page in place of the server and returns the list of (body, authorization)."""
    sent = []

    def handle(route):
        request = route.request
        assert request.method == "POST" and request.headers["content-type"] == "application/json"
        sent.append((json.loads(request.post_data), request.headers.get("authorization")))
        route.fulfill(status=status, content_type="application/json", body=json.dumps(answer or {"done": "done by the test"}))

    page.route("**/action", handle)
    return sent


def wait_for(condition, seconds=8.0, page=None):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "not in time"
        page.wait_for_timeout(50) if page else time.sleep(0.05)


def button(page, action):
    return page.locator(f"[data-action={action}]")


def value(page, name):
    return page.locator(f"#m-{name} dd").first


def result(page):
    return page.locator("#result")


# ---- HTTP ----


def ask(server, method, path, body=None, **headers):
    address = urllib.parse.urlsplit(server.url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=5)
    connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
    response = connection.getresponse()
    data = b"" if path == "/events" and response.status == 200 else response.read()
    connection.close()
    return response, data


@pytest.mark.parametrize("path", ["/", "/page.css", "/page.js", "/plots.js", "/uplot.js", "/uplot.css", "/licence.txt", "/events", "/nothing"])
def test_http_headers(server, path):
    response, _ = ask(server, "GET", path)
    assert response.status == (404 if path == "/nothing" else 200)
    policy = {part.strip() for part in response.headers["Content-Security-Policy"].split(";")}
    assert {"default-src 'none'", "script-src 'self'", "style-src 'self'", "frame-ancestors 'none'"} <= policy
    assert response.headers["X-Content-Type-Options"] == "nosniff"
    assert response.headers["Referrer-Policy"] == "no-referrer"
    assert response.headers["Cache-Control"] == "no-store"


def test_http_actions(server):
    good = {"Authorization": f"Bearer {server.token}", "Content_Type": "application/json"}

    def post(body, **headers):
        response, data = ask(server, "POST", "/action", body, **headers)
        return response.status, json.loads(data)

    stop = '{"action": "stop"}'
    host = urllib.parse.urlsplit(server.url).netloc
    status, answer = post(stop, **good)
    assert status == 200 and answer["done"]
    assert post(stop, **good, Origin=f"http://{host}", Sec_Fetch_Site="same-origin")[0] == 200
    for expected, body, headers in [
        (401, stop, {"Content_Type": "application/json"}),
        (401, stop, {**good, "Authorization": "Bearer wrong"}),
        (403, stop, {**good, "Origin": "http://example.org"}),
        (403, stop, {**good, "Sec_Fetch_Site": "cross-site"}),
        (400, "no json", good),
        (UNKNOWN, '{"action": "sink"}', good),
        (UNKNOWN, '{"action": "experiment", "name": "no such"}', good),
    ]:
        status, answer = post(body, **headers)
        assert status == expected and answer["error"], (expected, body, headers)
    assert ask(server, "GET", "/action")[0].status in (404, 405)
    assert ask(server, "POST", "/", stop, **good)[0].status in (404, 405)


# ---- Figures ----


def test_figures_move(tab):
    page = tab()
    before = page.evaluate("[document.querySelector('#m-north dd').textContent, document.querySelector('#chart').toDataURL()]")
    page.wait_for_timeout(2500)
    after = page.evaluate("[document.querySelector('#m-north dd').textContent, document.querySelector('#chart').toDataURL()]")
    assert before[0] != after[0] and before[1] != after[1]


def test_all_parts_have_figures(tab, mock):
    page = tab()
    page.wait_for_timeout(700)
    expect(page.locator("#outputs .output")).to_have_count(3)
    expect(page.locator("#outputs canvas")).to_have_count(6)
    expect(page.locator("#sensors tr")).to_have_count(5)
    expect(page.locator(".histogram")).to_have_count(2)
    expect(page.locator(".histogram").first.locator("span")).to_have_count(20)
    expect(page.locator("#commands li")).to_have_count(2)
    expect(page.locator("#experiment option")).to_have_count(6)
    expect(page.locator("#status")).to_contain_text("ArduPilot (boat), system 1")
    expect(page.locator("#fence")).to_have_text("Geofence: north −50 to 50 m, east −80 to 80 m.")


def test_units(tab, mock):
    mock.patch = {
        "motion": {"psi": -0.1, "north": -0.001, "u": 3.0, "v": 4.0, "current": [0.0, -0.5]},
        "outputs": [{"name": "r", "unit": "rad/s", "measured": 0.1, "predicted": -0.1, "band_95": 0.01}],
        "link": {"clock_offset_s": -0.02},
        "errors": {"seconds": [10, 1], "frozen": {"r": [0.2, 0.1]}, "adapted": {"r": [0.1, 0.05]}},
    }
    page = tab()
    expect(value(page, "heading")).to_have_text("354°")
    expect(value(page, "north")).to_have_text("0.0\u00a0m")
    expect(value(page, "speed")).to_have_text("5.00\u00a0m/s")
    expect(value(page, "current")).to_have_text("0.50\u00a0m/s to\u00a0270°")
    expect(page.locator(".output h3")).to_have_text("yaw rate r [deg/s]")
    expect(page.locator(".output .now")).to_have_text("measured 5.7, predicted −5.7 ± 0.6 deg/s")
    expect(page.locator("#s-clock")).to_contain_text("−20\u00a0ms")
    expect(page.get_by_label("error after 10 s: frozen 11.5, adapted 5.7 deg/s")).to_be_visible()


def test_unknown_values_of_a_session(tab, mock):
    mock.patch = {
        "motion": {"current": [0.0, 0.001]},
        "identifying": {"progress": None, "text": ""},
        "helm": {"state": "steering", "distance": 0.34, "status": "saturated"},
        "model": {"name": "live/model-1/committee.safetensors"},
        "path": None,
    }
    page = tab()
    expect(value(page, "current")).to_have_text("0.00\u00a0m/s")
    expect(page.locator("#identifying-text")).to_have_text("Identifying a model: this takes minutes")
    expect(page.locator("#helm-note")).to_have_text("0.3\u00a0m from the reference; a command is at its limit")
    expect(page.locator("#s-model dd").first).to_have_text("model-1/committee")
    button(page, "steer").click()
    expect(page.locator("#confirm")).to_contain_text("The path is that of the settings")
    mock.patch = {"helm": {"state": "preparing", "distance": None, "status": None}}
    expect(page.locator("#helm-state")).to_contain_text("as soon as it is ready")
    expect(page.locator("#helm-note")).to_have_text("")


def test_fit_and_follow(tab, mock):
    page = tab()
    page.wait_for_timeout(500)
    fit = page.locator("#chart").screenshot()
    page.locator("#view-follow").click()
    expect(page.locator("#view-follow")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#view-fit")).to_have_attribute("aria-pressed", "false")
    page.wait_for_timeout(300)
    assert page.locator("#chart").screenshot() != fit


def test_round_fence_and_diverged_prediction(tab, mock):
    page = tab()
    mock.patch = {"fence": {"radius": 80, "north": 0, "east": 5}}
    expect(page.locator("#fence")).to_have_text("Geofence: radius 80 m around north 0 m, east 5 m.")
    mock.patch = {"fence": None}
    expect(page.locator("#fence")).to_have_text("No geofence is set.")
    mock.patch = {"prediction": {"north": [1e6] * 5, "position_95": [1e5] * 5}}
    page.wait_for_timeout(500)
    expect(page.locator("#warnings")).not_to_contain_text("cannot show")


def test_messages_newest_first(tab, mock):
    page = tab()
    with mock.world.lock:
        mock.world.say("warning", "first new")
        mock.world.say("error", "second new")
    log = page.locator("#said li")
    expect(log.nth(0)).to_contain_text("second new")
    expect(log.nth(1)).to_contain_text("first new")
    expect(log.nth(0).locator("b")).to_have_text("error")
    expect(page.locator("#warnings")).to_contain_text("second new")
    count = log.count()
    page.reload()
    expect(log).to_have_count(count)


def test_stale_sensor_is_marked_by_text(tab, mock):
    mock.patch = {"sensors": [{"name": "heading", "column": "ATTITUDE.yaw", "rate_hz": 10.0, "age_s": 4.0, "latency_ms": 12, "outliers": 0}]}
    page = tab()
    expect(page.locator("#sensors tr td").last).to_have_text("✕ stale")
    expect(page.locator("#warnings")).to_contain_text("No fresh data from: heading.")


def test_warnings(tab, mock):
    page = tab()
    button(page, "record").click()
    expect(page.locator("#s-recording")).to_contain_text("boat-2026-11-26T21-00-00Z.mcap")
    mock.switches |= {"lost", "trouble"}
    expect(page.locator("#warnings")).to_contain_text("Link to the autopilot is lost.")
    expect(page.locator("#warnings")).to_contain_text("Recording: the disk is full: free some space")
    expect(page.locator("#s-link")).to_contain_text("LOST")
    expect(page.locator("#refusals")).to_contain_text("check the radio")
    for action in MOVING:
        expect(button(page, action)).to_be_disabled()
    mock.switches.clear()
    expect(page.locator("#warnings")).not_to_contain_text("Link")


def test_session_from_record_to_adopted_model(tab, mock):
    page = tab()
    for action, text in [("record", "recording to"), ("stop-recording", "recording closed"), ("freeze", "frozen"), ("learn", "learns"), ("identify", "has begun")]:
        button(page, action).click()
        expect(result(page)).to_contain_text(text)
    expect(page.locator("#identifying")).to_be_visible()
    expect(button(page, "adopt")).to_be_enabled(timeout=15000)
    expect(page.locator("#offered")).to_contain_text("cross-validated NRMSE u 0.08")
    button(page, "adopt").click()
    expect(page.locator("#s-model")).to_contain_text("recorded-1.toml")
    button(page, "roll-back").click()
    expect(page.locator("#s-model")).to_contain_text("boat.hydroid.toml")
    page.locator("#experiment").select_option("circle")
    button(page, "experiment").click()
    page.locator("#confirm-yes").click()
    expect(page.locator("#experiment-now")).to_contain_text("circle")
    expect(page.locator("#helm-state")).to_contain_text("EXPERIMENT")
    expect(page.locator("#s-helm")).to_contain_text("EXPERIMENT")
    page.locator("#stop").click()
    expect(result(page)).to_contain_text("the helm is released")
    expect(page.locator("#experiment-now")).to_be_hidden()
    button(page, "steer").click()
    page.locator("#confirm-yes").click()
    expect(page.locator("#helm-state")).to_contain_text("STEERING")
    page.keyboard.press("Escape")
    expect(page.locator("#s-helm")).to_contain_text("OFF")
    assert [r["action"] for r in mock.requests][-4:] == ["experiment", "stop", "steer", "stop"]


# ---- Actions ----


def test_buttons_send_body_and_token(tab, server):
    if not REAL:
        server.patch = {"actions": PLAIN + MOVING + ["stop"]}
    page = tab()
    sent = catch(page)
    for action in PLAIN + MOVING:
        if REAL and button(page, action).is_disabled():
            continue
        expect(button(page, action)).to_be_enabled()
        button(page, action).click()
        body = {"action": action}
        if action in MOVING:
            page.locator("#confirm-yes").click()
        if action == "experiment":
            body["name"] = page.locator("#experiment").input_value()
        wait_for(lambda: sent, page=page)
        assert sent == [(body, f"Bearer {server.token}")]
        expect(result(page)).to_contain_text("done by the test")
        sent.clear()
    page.locator("#stop").click()
    wait_for(lambda: sent, page=page)
    assert sent == [({"action": "stop"}, f"Bearer {server.token}")]


def test_disabled_buttons_send_nothing(tab, mock):
    mock.patch = {"actions": []}
    page = tab()
    sent = catch(page)
    page.wait_for_timeout(400)
    for action in PLAIN + MOVING:
        expect(button(page, action)).to_be_disabled()
        button(page, action).click(force=True)
        button(page, action).dispatch_event("click")
    page.wait_for_timeout(300)
    assert sent == []
    expect(page.locator("#stop")).to_be_enabled()
    page.locator("#stop").click()
    wait_for(lambda: sent, page=page)


def test_double_click_sends_once(tab, mock):
    page = tab()
    release = []
    page.route("**/action", lambda route: release.append(route))
    button(page, "record").dblclick()
    page.wait_for_timeout(300)
    assert len(release) == 1
    expect(button(page, "record")).to_be_disabled()
    release[0].fulfill(status=200, content_type="application/json", body='{"done": "ok"}')
    expect(button(page, "record")).to_be_enabled()


@pytest.mark.parametrize("place", ["page", "select", "confirm", "token"])
def test_escape_sends_stop(tab, server, place):
    if not REAL:
        server.patch = {"actions": PLAIN + MOVING}
    page = tab()
    sent = catch(page)
    if place == "select":
        page.locator("#experiment").focus()
    if place == "confirm":
        if button(page, "steer").is_disabled():
            pytest.skip("steering is not possible now")
        button(page, "steer").click()
    if place == "token":
        page.evaluate("sessionStorage.clear()")
        page.reload()
        expect(page.locator("body")).not_to_have_class("old")
        page.locator(".model [data-action]:enabled").first.click()
        expect(page.locator("#token")).to_be_visible()
    page.keyboard.press("Escape")
    if place == "token":
        expect(page.locator("#token-why")).to_contain_text("STOP")
        page.locator("#token-field").fill(server.token)
        page.keyboard.press("Enter")
    wait_for(lambda: sent, page=page)
    assert sent == [({"action": "stop"}, f"Bearer {server.token}")]
    expect(page.locator("dialog[open]")).to_have_count(0)


def test_held_escape_sends_one_stop(tab, server):
    page = tab()
    sent = catch(page)
    for _ in range(5):
        page.keyboard.down("Escape")
    page.keyboard.up("Escape")
    wait_for(lambda: sent, page=page)
    page.wait_for_timeout(300)
    assert len(sent) == 1


def test_stop_works_and_stays_in_place_while_a_dialog_is_open(tab, mock):
    for size in [(1280, 900), (360, 740)]:
        page = tab(viewport={"width": size[0], "height": size[1]})
        before = page.locator("#stop").bounding_box()
        button(page, "steer").click()
        expect(page.locator("#confirm")).to_be_visible()
        assert page.locator("#stop").bounding_box() == before
        page.mouse.click(before["x"] + before["width"] / 2, before["y"] + before["height"] / 2)
        expect(result(page)).to_contain_text("the helm is released")
        expect(page.locator("#confirm")).to_be_hidden()
        assert page.locator("#stop").bounding_box() == before
    assert [r["action"] for r in mock.requests] == ["stop", "stop"]


def test_confirmation(tab, mock):
    page = tab()
    page.locator("#experiment").select_option("zigzag-20")
    button(page, "experiment").click()
    confirm = page.locator("#confirm")
    for text in ["Run experiment zigzag-20?", "commands throttle, rudder", "The boat will move", "Geofence: north −50 to 50 m", "mode MANUAL, armed", "Escape"]:
        expect(confirm).to_contain_text(text)
    expect(confirm.get_by_role("button", name="Cancel")).to_be_focused()
    page.keyboard.press("Enter")
    expect(confirm).to_be_hidden()
    button(page, "steer").click()
    expect(confirm).to_contain_text("The path has 7 points")
    mock.patch = {"actions": ["stop"]}
    expect(page.locator("#confirm-yes")).to_be_disabled()
    mock.patch = {}
    expect(page.locator("#confirm-yes")).to_be_enabled()
    assert mock.requests == []
    page.locator("#confirm-yes").click()
    wait_for(lambda: mock.requests == [{"action": "steer"}], page=page)


@pytest.mark.parametrize(
    "status, answer, text",
    [(409, {"error": "refused: arm the boat first"}, "record: refused: arm the boat first"), (400, {"error": "not understood"}, "not understood"),
     (403, {"error": "other site"}, "other site"), (500, {"x": 1}, "status 500"), (200, {"done": HOSTILE}, HOSTILE), (200, [1], "record: –")],
)
def test_results_and_errors_are_shown(tab, server, status, answer, text):
    tab.allowed = ("the server responded with a status of",)
    if not REAL:
        server.patch = {"actions": ["record", "stop"]}
    page = tab()
    if button(page, "record").is_disabled():
        pytest.skip("already recording")
    catch(page, status, answer)
    button(page, "record").click()
    expect(result(page)).to_contain_text(text)
    assert result(page).get_attribute("aria-live") == "assertive"
    assert page.locator("#result *").count() == 0


# ---- Token ----


def test_token_leaves_the_address_bar(tab, server):
    page = tab()
    assert page.url == f"{server.url}/"
    assert page.evaluate("sessionStorage.getItem('hydroid-token')") == server.token
    sent = catch(page)
    page.reload()
    page.locator("#stop").click()
    wait_for(lambda: sent, page=page)
    assert sent[0][1] == f"Bearer {server.token}"


@pytest.mark.parametrize("entry", ["{token}", "  {token} ", "http://127.0.0.1:8600/#token={token}"])
def test_token_dialog(tab, mock, entry):
    page = tab(token=False)
    button(page, "record").click()
    expect(page.locator("#token")).to_contain_text("record")
    expect(page.locator("#token-field")).to_be_focused()
    assert mock.requests == []
    page.locator("#token-field").fill(entry.format(token=mock.token).strip())
    page.get_by_role("button", name="Use this token").click()
    expect(result(page)).to_contain_text("recording to")
    assert mock.requests == [{"action": "record"}]
    expect(button(page, "stop-recording")).to_be_enabled()
    button(page, "stop-recording").click()
    expect(result(page)).to_contain_text("closed")


def test_missing_token_is_shown_and_can_be_entered_early(tab, mock):
    page = tab(token=False)
    expect(page.locator("#no-token")).to_contain_text("STOP and the other buttons will ask for it")
    page.locator("#give-token").click()
    page.locator("#token-field").fill(mock.token)
    page.keyboard.press("Enter")
    expect(page.locator("#no-token")).to_be_hidden()
    page.keyboard.press("Escape")
    wait_for(lambda: mock.requests == [{"action": "stop"}], page=page)


def test_token_dialog_cancelled(tab, mock):
    page = tab(token=False)
    page.locator("#stop").click()
    page.locator("#token [data-cancel]").click()
    expect(result(page)).to_contain_text("STOP: not sent, the token is missing")
    expect(button(page, "record")).to_be_enabled()
    assert mock.requests == []


def test_wrong_token_asks_again(tab, mock):
    tab.allowed = ("status of 401",)
    page = tab()
    mock.token = "another"
    button(page, "record").click()
    expect(page.locator("#token-why")).to_contain_text("the token is missing or wrong")
    page.locator("#token-field").fill("wrong")
    page.keyboard.press("Enter")
    expect(page.locator("#token-field")).to_have_value("")
    expect(page.locator("#token")).to_be_visible()
    page.locator("#token-field").fill("another")
    page.keyboard.press("Enter")
    expect(result(page)).to_contain_text("recording to")
    assert mock.requests == [{"action": "record"}]


# ---- Connection ----


def test_silence_is_shown(tab, mock):
    page = tab()
    mock.switches.add("silent")
    expect(page.locator("#warnings")).to_contain_text("No connection to hydroid. What is shown is old.", timeout=3500)
    expect(page.locator("#warnings")).to_contain_text("for 2\u00a0s")
    expect(page.locator("#warnings")).to_contain_text("for 4\u00a0s")
    for action in PLAIN + MOVING:
        expect(button(page, action)).to_be_disabled()
    page.locator("#stop").click()
    expect(result(page)).to_contain_text("the helm is released")
    mock.switches.clear()
    expect(page.locator("#warnings")).not_to_contain_text("No connection")
    expect(button(page, "record")).to_be_enabled()


def test_repeated_state_counts_as_silence(tab, mock):
    page = tab()
    mock.patch = {"time": 1764190000.0}
    expect(page.locator("#warnings")).to_contain_text("No connection to hydroid.", timeout=4000)
    mock.patch = {}
    expect(page.locator("#warnings")).not_to_contain_text("No connection")


def test_hanging_connection_is_replaced(tab, mock):
    page = tab()
    requests = []
    page.on("request", lambda request: requests.append(request.url) if request.url.endswith("/events") else None)
    mock.switches.add("silent")
    wait_for(lambda: requests, 9, page)
    mock.switches.clear()
    expect(page.locator("body")).not_to_have_class("old")


def test_server_restart(tab, mock):
    tab.allowed = NETWORK
    page = tab()
    mock.stop()
    expect(page.locator("#warnings")).to_contain_text("No connection to hydroid", timeout=4000)
    page.wait_for_timeout(2500)
    mock.start()
    expect(page.locator("body")).not_to_have_class("old", timeout=15000)
    button(page, "record").click()
    expect(result(page)).to_contain_text("recording to")


def test_page_opened_while_the_events_fail(tab, mock):
    tab.allowed = ("status of 503",)
    context = tab().context
    refuse = lambda route: route.fulfill(status=503, body="")  # noqa: E731
    context.route("**/events", refuse)
    page = tab(context=context, wait=False)
    expect(page.locator("#warnings")).to_contain_text("No connection to hydroid.for 3", timeout=5000)
    context.unroute("**/events", refuse)
    expect(page.locator("body")).not_to_have_class("old", timeout=10000)


def test_stop_is_repeated_until_it_arrives(tab, mock):
    tab.allowed = NETWORK
    page = tab()
    mock.stop()
    page.locator("#stop").click()
    expect(result(page)).to_contain_text("STOP has not reached hydroid. Trying again")
    expect(result(page)).to_contain_text("remote control")
    mock.start()
    expect(result(page)).to_contain_text("the helm is released", timeout=9000)
    assert mock.requests == [{"action": "stop"}]


def test_other_actions_are_not_repeated(tab, mock):
    tab.allowed = ("net::ERR",)
    page = tab()
    page.route("**/action", lambda route: route.abort())
    button(page, "record").click()
    expect(result(page)).to_contain_text("record: hydroid does not answer")


def test_two_tabs(tab, mock):
    one = tab()
    two = tab(context=one.context, token=False)
    button(one, "record").click()
    expect(button(two, "stop-recording")).to_be_enabled()
    expect(two.locator("#said")).to_contain_text("recording to")
    button(two, "stop-recording").click()
    expect(two.locator("#token")).to_be_visible()
    two.locator("#token-field").fill(mock.token)
    two.keyboard.press("Enter")
    expect(button(one, "record")).to_be_enabled()


def test_reload(tab, mock):
    page = tab()
    page.wait_for_timeout(1500)
    page.reload()
    expect(page.locator("body")).not_to_have_class("old")
    expect(page.locator("#said")).to_contain_text("autopilot found")
    expect(page.locator("#outputs canvas")).to_have_count(6)


def test_hidden_tab_gives_up_its_connection(tab, mock):
    page = tab()
    expect(value(page, "north")).not_to_have_text("–")
    page.evaluate("""() => {
        Object.defineProperty(document, 'hidden', {configurable: true, get: () => window.asleep === true});
        window.asleep = true;
        document.dispatchEvent(new Event('visibilitychange'));
    }""")
    page.wait_for_timeout(300)
    north = value(page, "north").text_content()
    page.wait_for_timeout(3000)
    assert value(page, "north").text_content() == north
    expect(page.locator("body")).to_have_class("old")
    page.evaluate("window.asleep = false; document.dispatchEvent(new Event('visibilitychange'))")
    expect(page.locator("body")).not_to_have_class("old")


def test_wall_clock_reveals_a_sleep(tab, mock):
    page = tab()
    mock.switches.add("silent")
    page.evaluate("() => { const now = Date.now; Date.now = () => now() + 3600e3; }")
    expect(page.locator("#warnings")).to_contain_text("for 1\u00a0h 00\u00a0min", timeout=1500)


# ---- Faulty and hostile data ----


def test_hostile_texts_appear_as_text(tab, mock):
    mock.switches.add("hostile")
    mock.patch = {"actions": PLAIN + MOVING, "experiments": [HOSTILE, "<b>x</b>"], "helm": {"refusals": [HOSTILE]},
                  "outputs": [{"name": HOSTILE, "unit": HOSTILE, "measured": 1, "predicted": 1, "band_95": 1}],
                  "link": {"mode": HOSTILE}, "experiment": {"name": HOSTILE, "progress": 0.5, "remaining_s": 3, "text": HOSTILE},
                  "offered": {"name": HOSTILE, "text": HOSTILE}, "identifying": {"progress": 0.5, "text": HOSTILE},
                  "recording": {"path": HOSTILE, "seconds": 1, "lost": 1, "trouble": HOSTILE}}
    tab.allowed = ("status of 400",)
    page = tab()
    for place in ["#s-autopilot", "#s-mode", "#s-model", "#s-recording", "#warnings", "#said", "#sensors", ".output h3", "#inputs", "#commands",
                  "#refusals", "#experiment-name", "#experiment-text", "#offered", "#identifying-text", "#excitation-text"]:
        expect(page.locator(place).first).to_contain_text("<img src=x onerror=alert(1)>")
    button(page, "experiment").click()
    expect(page.locator("#confirm-title")).to_contain_text(HOSTILE)
    page.wait_for_timeout(500)
    assert page.locator("img, b b, script:not([src])").count() == 0
    page.locator("#confirm-yes").click()
    wait_for(lambda: mock.requests == [{"action": "experiment", "name": HOSTILE}], page=page)
    expect(result(page)).to_contain_text("not understood")


@pytest.mark.parametrize("switches", [{"nulls"}, {"empty"}, {"new"}, {"weird"}, {"weird", "hostile"}])
def test_faulty_states(tab, mock, switches):
    page = tab()
    mock.switches |= switches
    page.wait_for_timeout(2000)
    expect(page.locator("#warnings")).not_to_contain_text("cannot show")
    if switches & {"nulls", "empty"}:
        for place in ["#m-north dd >> nth=0", "#m-heading dd >> nth=0", "#m-speed dd >> nth=0", "#m-current dd >> nth=0", "#s-mode dd >> nth=0", "#s-armed dd >> nth=0", "#s-link dd >> nth=0"]:
            expect(page.locator(place)).to_have_text("–")
        expect(page.locator("#stop")).to_be_enabled()
    if switches == {"nulls"}:
        expect(page.locator("#sensors td:last-child")).to_have_text(["✕ stale"] * 5)
    if "weird" in switches:
        expect(page.locator(".output h3").last).to_contain_text("__proto__ [furlong]")
        expect(value(page, "north")).to_have_text("1.00e+300\u00a0m")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    mock.switches.clear()
    expect(value(page, "north")).not_to_have_text("–")
    expect(page.locator("#outputs canvas")).to_have_count(6)
    expect(page.locator("#warnings")).not_to_contain_text("cannot show")


@pytest.mark.parametrize("data", ["no json", "null", "[]", "5", '{"track": 7, "series": {"names": 3, "rows": [[], null, [1]]}, "said": [null, {"id": {}}]}'])
def test_faulty_events(tab, mock, data):
    context = tab().context
    text = "".join(f"event: {name}\ndata: {data}\n\n" for name in ("history", "said", "state"))
    context.route("**/events", lambda route: route.fulfill(status=200, content_type="text/event-stream", body=text))
    page = tab(context=context, wait=False)
    page.wait_for_timeout(1500)
    expect(page.locator("#warnings")).not_to_contain_text("cannot show")


def test_clock_set_back(tab, mock):
    page = tab()
    mock.world.start -= 3600
    page.wait_for_timeout(1500)
    expect(page.locator("body")).not_to_have_class("old")
    expect(page.locator("#warnings")).not_to_contain_text("cannot show")


# ---- Form ----


@pytest.mark.parametrize("size", [(360, 740), (740, 360), (820, 1180), (1280, 900)])
@pytest.mark.parametrize("hostile", [False, True])
def test_fits_and_stop_is_visible(tab, server, size, hostile):
    if hostile and REAL:
        pytest.skip("needs the mock")
    if hostile:
        server.switches |= {"hostile", "lost"}
    page = tab(viewport={"width": size[0], "height": size[1]}, has_touch=True)
    page.wait_for_timeout(500)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    for position in [0, 600, 100000]:
        page.evaluate("(y) => scrollTo(0, y)", position)
        expect(page.locator("#stop")).to_be_in_viewport(ratio=1)
        box = page.locator("#stop").bounding_box()
        top = page.evaluate("([x, y]) => document.elementFromPoint(x, y).closest('#stop') !== null", [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        assert top and box["height"] >= 44 and box["width"] >= 150
    small = page.evaluate("""() => [...document.querySelectorAll('button, select, input')].filter((e) => e.offsetParent || e.id === 'stop')
        .filter((e) => e.offsetHeight < 44 || e.offsetWidth < 44).map((e) => e.outerHTML)""")
    assert small == []


def test_last_part_is_not_hidden_by_stop(tab, server):
    page = tab(viewport={"width": 360, "height": 740})
    page.wait_for_timeout(800)
    page.evaluate("scrollTo(0, 100000)")
    page.wait_for_timeout(200)
    footer, stop = page.locator("footer").bounding_box(), page.locator("#stop").bounding_box()
    assert footer["y"] + footer["height"] <= stop["y"] + 1


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast(tab, server, scheme):
    page = tab(color_scheme=scheme)
    ratios = page.evaluate("""() => {
        const style = getComputedStyle(document.documentElement), canvas = new OffscreenCanvas(1, 1), g = canvas.getContext('2d', {willReadFrequently: true});
        const light = (name) => {
            g.fillStyle = style.getPropertyValue('--' + name).trim();
            g.fillRect(0, 0, 1, 1);
            const [r, green, b] = [...g.getImageData(0, 0, 1, 1).data].map((x) => x / 255).map((x) => (x > 0.04045 ? ((x + 0.055) / 1.055) ** 2.4 : x / 12.92));
            return 0.2126 * r + 0.7152 * green + 0.0722 * b;
        };
        const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
        return {text: ratio('ink', 'surface'), muted: ratio('muted', 'surface'), model: ratio('model', 'surface'), command: ratio('command', 'surface'),
                alarm: ratio('alarm', 'surface'), good: ratio('good', 'surface'), warn: ratio('warn', 'warn-ink')};
    }""")
    assert ratios["text"] > 15 and ratios["muted"] > 7 and min(ratios["alarm"], ratios["good"], ratios["warn"]) > 4.5
    assert min(ratios["model"], ratios["command"]) > 3.9, ratios


def test_everything_has_a_name(tab, mock):
    page = tab()
    unnamed = page.evaluate("""() => [...document.querySelectorAll('button:not(dialog *), select, input, progress, canvas#chart, section, dialog, [role=img], [role=region], [role=log]')]
        .filter((e) => !(e.ariaLabel || e.getAttribute('aria-labelledby') || e.textContent.trim() || e.labels?.length)).map((e) => e.outerHTML.slice(0, 99))""")
    assert unnamed == []
    page.locator("#view-fit").focus()
    reached = set()
    for _ in range(30):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.dataset.action"))
    assert {"view-follow", "record", "experiment", "steer", "stop"} <= reached


def test_reduced_motion_draws_slower(tab, server):
    page = tab(reduced_motion="reduce")
    page.wait_for_timeout(1200)
    changes = page.evaluate("""async () => {
        let changes = 0, last = '';
        for (let i = 0; i < 30; i += 1) {
            const now = document.querySelector('#chart').toDataURL();
            changes += last !== '' && now !== last;
            last = now;
            await new Promise((done) => setTimeout(done, 100));
        }
        return changes;
    }""")
    assert 1 <= changes <= 5


def test_screenshots(tab, server):
    SHOTS.mkdir(parents=True, exist_ok=True)
    for name, size, scheme in [("desktop-light", (1280, 900), "light"), ("desktop-dark", (1280, 900), "dark"), ("phone", (360, 740), "light")]:
        page = tab(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, device_scale_factor=1 if size[0] > 900 else 2)
        if not REAL and name == "desktop-dark":
            button(page, "steer").click()
            page.locator("#confirm-yes").click()
        page.wait_for_timeout(3000)
        page.screenshot(path=SHOTS / f"{name}-{size[0]}x{size[1]}.png")
        if name == "phone":
            page.screenshot(path=SHOTS / "phone-whole.png", full_page=True)
