"""What tries to reach motors, or to harm the server of `motorlink monitor`, and does not succeed."""

import json
import os
import socket
import struct
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from monitoring import Site, frame, is_kind, upgraded
from program import Running, eventually
from sharing import Client

@pytest.fixture(scope="module")
def monitor(motorlink):
    """A monitor of simulated drives, which all tests use."""
    monitor = Running([motorlink, "monitor", "--listen", "127.0.0.1:0", "--json"])
    yield monitor
    monitor.end()


@pytest.fixture
def site(monitor):
    return Site(json.loads(monitor.line(0)))


@pytest.fixture
def own(start):
    """A monitor of the test's own, and its site."""
    monitor = start("monitor", "--listen", "127.0.0.1:0", "--json")
    return monitor, Site(json.loads(monitor.line(0)))


def is_well(site):
    """A page works as usual."""
    with site.page() as page:
        assert page.ask("lines")["kind"] == "answer"


def refused(site, status, **options):
    """The handshake of a WebSocket is refused."""
    with pytest.raises(InvalidStatus) as error:
        site.open(**options).close()
    assert error.value.response.status_code == status


def test_a_name_that_another_site_gave_this_address_is_refused(site):
    host = f"evil.example:{site.port}"
    for headers in (site.operator, {**site.operator, "Origin": f"http://{host}"}):
        for method, path in (("GET", "/"), ("GET", f"/?token={site.tokens['url']}"), ("POST", "/api/stop-all")):
            status, answer, body = site.request(method, path, {**headers, "Host": host})
            assert status == 403, (method, path, headers)
            assert "Set-Cookie" not in answer and site.tokens["url"].encode() not in body


def test_a_page_of_another_site_opens_no_connection_and_posts_nothing(site):
    for origin in ("http://evil.example", f"https://{site.authority}"):
        refused(site, 403, origin=origin)
        for path in ("/api/stop-all", "/api/let-go?run=x&page=page%201"):
            assert site.request("POST", path, {**site.operator, "Origin": origin})[0] == 403
        assert site.request("GET", "/", {**site.operator, "Origin": origin})[0] == 403
    # Nor does what does not say where it comes from.
    refused(site, 403, origin=None)
    assert site.request("POST", "/api/stop-all", site.operator)[0] == 403


def test_nothing_is_given_without_a_token(site):
    other = "0" * 32
    for headers in ({}, {"Cookie": f"motorlink-{site.port}={other}"}):
        for path in ("/", "/assets/index.js", "/ws", f"/?token={other}", "/?token=", "/no-such-path"):
            assert site.request("GET", path, {**headers, "Origin": site.origin})[0] == 401, (headers, path)
        assert site.post("/api/stop-all", headers)[0] == 401
        refused(site, 401, headers=headers)


def test_a_token_becomes_a_cookie_that_scripts_and_other_sites_do_not_get(site):
    for name, headers in (("url", site.operator), ("viewer_url", site.viewer)):
        status, answer, _ = site.request("GET", f"/?token={site.tokens[name]}")
        assert (status, answer["Location"]) == (303, "/")
        cookie, *attributes = answer["Set-Cookie"].split("; ")
        assert {"Cookie": cookie} == headers
        assert set(attributes) == {"HttpOnly", "SameSite=Strict", "Path=/"}


def test_each_answer_says_what_browsers_may_do_with_it(site):
    for path, headers in (("/", site.operator), ("/", {}), ("/x", site.operator), ("/", {"Host": "evil.example"})):
        _, answer, _ = site.request("GET", path, headers)
        policy = answer["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; ") and "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer["X-Content-Type-Options"] == "nosniff" and answer["Referrer-Policy"] == "no-referrer"
        assert answer["Cache-Control"] == "no-store" and "Access-Control-Allow-Origin" not in answer


def test_files_outside_of_the_page_are_not_given(site):
    paths = ["/../Cargo.toml", "/assets/../../Cargo.toml", "/%2e%2e/Cargo.toml", "//etc/passwd", "/..%2fCargo.toml"]
    for path in paths:
        status, _, body = site.request("GET", path, site.operator)
        assert status == 404 and b"workspace" not in body and b"root:" not in body, path


def test_a_viewer_sees_and_stops_and_does_nothing_else(site):
    motor = {"line": "st0", "motor": 1}
    forbidden = [
        ("write", {**motor, "name": "SPEED_KP", "value": 1.0, "to_rom": False}),
        ("act", {**motor, "command": "START_MOTOR", "values": {}, "hold": False}),
        ("run", {**motor, "mode": "speed", "target": 1.0, "rate": 1.0, "hold": True}),
        ("limit", {**motor, "mode": "speed", "most": None}),
        ("restore", {**motor, "text": "", "to_rom": False}),
        ("latch", {}), ("release", {}),
        ("open", {"port": "/dev/ttyUSB0", "protocol": "st"}), ("close", {"line": "st0"}),
        ("scan", {"port": "/dev/ttyUSB0", "protocol": "st"}),
        ("command", {**motor, "bytes": [3, 1], "time_to_live": 1.0}),
        ("confirm", motor), ("hello", {"protocol": 1, "name": "x"}),
    ]
    with site.page() as page:
        # These go past the server.
        for ask, members in forbidden[-3:]:
            assert page.ask(ask, **members)["reason"] == "forbidden"
    with site.page(site.viewer) as page:
        assert page.welcome["role"] == "viewer"
        for ask, members in forbidden:
            answer = page.ask(ask, **members)
            assert (answer["kind"], answer["reason"]) == ("refusal", "forbidden"), ask
        signals = [{**motor, "name": "SPEED_MEAS"}]
        for ask, members in (
            ("lines", {}), ("signals", {"line": "st0"}), ("rates", {}), ("stop", {"motor": motor}),
            ("subscribe", {"signals": signals, "period": 0.1, "queue": 9, "drop": "oldest"}), ("stop-all", {}),
        ):
            assert page.ask(ask, **members)["kind"] == "answer", ask
        assert site.post("/api/stop-all", site.viewer)[0] == 200
        # The latch of its stop is not the viewer's to release.
        assert page.ask("release")["reason"] == "forbidden"
    with site.page() as page:
        assert page.ask("release")["kind"] == "answer"


def test_requests_that_are_wrong_are_refused_and_the_connection_goes_on(site):
    wrong = [
        {"id": 101, "ask": "fly"}, {"id": 102, "ask": "stop", "motor": 7}, {"id": 103, "ask": "read", "line": "st0"},
        {"id": 104, "ask": 5}, {"id": 105}, {"id": 1 << 31, "ask": "lines"}, {"id": 106, "ask": "stop-all", "id2": {}},
        {"id": 107, "ask": "subscribe", "signals": [], "period": -1, "queue": 0, "drop": "oldest"},
        {"id": 108, "ask": "run", "line": "st0", "motor": 300, "mode": "speed", "target": 1, "rate": 1, "hold": 0},
    ]
    with site.page() as page:
        for text in wrong:
            page.socket.send(json.dumps(text))
            answer = page.until(lambda it: isinstance(it, dict) and it.get("id") == text["id"])
            expected = ("answer", None) if text.get("ask") == "stop-all" else ("refusal", "usage")
            assert (answer["kind"], answer.get("reason")) == expected, (text, answer)
        assert page.ask("lines")["kind"] == "answer"


def test_what_is_no_message_ends_the_connection_with_a_reason(site):
    for text in ("", "{", "null", '{"ask":"stop-all"}', '{"id":-1,"ask":"lines"}', '{"id":4294967296}', '{"beat":-1}',
                 '{"beat":1,"frame":1e999,"held":true,"at":0}', "[" * 10000, b"\0\1\2"):
        with site.page(lives=False) as page:
            page.socket.send(text)
            assert page.closed(), text
    is_well(site)


def test_a_text_that_is_too_long_ends_the_connection(site):
    with site.page(lives=False) as page:
        page.socket.send(json.dumps({"id": 1, "ask": "x" * (1 << 16)}))
        page.closed()
    with upgraded(site) as stream:
        # It announces a gigabyte, and sends none of it.
        stream.sendall(b"\x81\xff" + (1 << 30).to_bytes(8) + bytes(4))
        ended(stream)
    with upgraded(site) as stream:
        # Parts of one text, each short enough.
        with pytest.raises(OSError):
            for _ in range(1000):
                stream.sendall(frame(b"x" * 1000, 1 if _ == 0 else 0, final=False))
                time.sleep(0)
            ended(stream)
            raise ConnectionError
    is_well(site)


def ended(stream, within=20):
    """Waits until the server closes a connection; gives what it sent."""
    stream.settimeout(within)
    received = b""
    with suppress(ConnectionError):
        while more := stream.recv(65536):
            received += more
    return received


def test_what_no_browser_sends_ends_the_connection(site):
    sign = frame(json.dumps({"beat": 1, "frame": 1, "held": True, "at": 0}).encode())
    # Noise, no UTF-8, without a mask, pings, and more than a thousand messages in a second.
    for bytes_ in (b"\xff" * 100, frame(b"\xff\xfe\xfd"), b"\x81\x05hello", frame(b"", opcode=9) * 2000, sign * 50_000):
        with upgraded(site) as stream:
            with suppress(ConnectionError):
                stream.sendall(bytes_)
            ended(stream)
    is_well(site)


def test_pages_beyond_the_limit_are_told_so_and_the_others_go_on(own):
    _, site = own
    with ExitStack() as stack:
        pages = [stack.enter_context(site.page()) for _ in range(32)]
        for _ in range(2):
            with site.open() as extra:
                assert "as many pages" in json.loads(extra.recv(10))["message"]
                with pytest.raises(ConnectionClosed):
                    extra.recv(10)
        for page in pages:
            assert page.ask("lines")["kind"] == "answer"
        assert len({page.welcome["name"] for page in pages}) == 32
        # A stop needs no place.
        assert site.post("/api/stop-all")[0] == 200
    eventually(lambda: tries(site), "a place for a page")


def tries(site):
    with site.open() as opened:
        return is_kind(json.loads(opened.recv(10)), "welcome")


def test_requests_that_never_end_are_ended(site):
    halves = [b"", b"GET / HTTP/1.1\r\n", b"POST /api/stop-all HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nx",
              b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: "]
    began = time.monotonic()
    streams = [socket.create_connection((site.host, site.port), timeout=40) for _ in range(10) for _ in halves]
    for number, stream in enumerate(streams):
        stream.sendall(halves[number % len(halves)])
    # They take no place of those who ask properly.
    is_well(site)
    with ThreadPoolExecutor(len(streams)) as pool:
        list(pool.map(lambda stream: ended(stream, 40), streams))
    assert time.monotonic() - began < 35
    for stream in streams:
        stream.close()


def test_requests_that_are_too_big_are_refused(site):
    for head in ([("X", "y" * 20_000)], [(f"X-{number}", "y") for number in range(2000)]):
        status, _, _ = site.request("GET", "/", {**site.operator, **dict(head)})
        assert status == 431
    assert site.request("GET", "/" + "x" * 100_000, site.operator)[0] in (414, 431)
    is_well(site)


def test_noise_on_the_port_ends_that_connection_only(site):
    for _ in range(10):
        with socket.create_connection((site.host, site.port), timeout=20) as stream:
            stream.sendall(os.urandom(500) + b"\r\n\r\n")
            ended(stream)
    is_well(site)


def test_a_page_that_does_not_read_slows_nobody_and_is_closed(own):
    _, site = own
    signals = [{"line": "st0", "motor": motor, "name": "SPEED_MEAS"} for motor in (1, 2)]
    members = {"signals": signals, "period": 0.01, "queue": 10_000, "drop": "oldest"}
    with upgraded(site) as deaf, site.page() as page:
        for number in range(16):
            text = {"id": number + 1, "ask": "subscribe", **members, "period": 0.001}
            deaf.sendall(frame(json.dumps(text).encode()))
        assert page.ask("subscribe", **members)["kind"] == "answer"
        page.until(lambda it: is_kind(it, "event") and (it["event"], it.get("by")) == ("left", "page 1"), 60)
        rows, sequences, lost = 0, {}, 0
        for message in list(page.heard):
            if isinstance(message, bytes):
                _, group, sequence, count, _, missing = struct.unpack_from("<6I", message)
                assert sequence == sequences.get(group, -1) + 1
                sequences[group], lost, rows = sequence, lost + missing, rows + count
        assert lost == 0 and rows > 1000
        assert page.ask("stop-all")["kind"] == "answer"


def test_the_socket_of_the_share_is_this_users_alone_and_removed_at_the_end(own):
    monitor, site = own
    assert os.stat(site.path).st_mode & 0o077 == 0
    assert os.stat(os.path.dirname(site.path)).st_mode & 0o077 == 0
    assert Client(site.path, "program").ask("lines")["kind"] == "answer"
    monitor.interrupt()
    assert monitor.wait() == 0
    assert not os.path.exists(os.path.dirname(site.path))


def test_strangers_whose_requests_do_not_arrive_keep_nobody_out(site):
    """Half-open connections without a token. Pages, and the stop by HTTP, come in all the same, also a
    stop that arrives slowly from another address."""
    slow = socket.create_connection((site.host, site.port), 10)
    cookie = site.operator["Cookie"]
    words = f"POST /api/stop-all HTTP/1.1\r\nHost: {site.authority}\r\nOrigin: {site.origin}\r\nCookie: {cookie}\r\n\r\n"
    slow.sendall(words[:40].encode())
    with ExitStack() as strangers:
        for _ in range(300):
            there = ("127.0.0.2", 0)
            strangers.enter_context(socket.create_connection((site.host, site.port), 10, there)).sendall(b"G")
        slow.sendall(words[40:].encode())
        assert slow.recv(12) == b"HTTP/1.1 200"
        slow.close()
        for _ in range(int(os.environ.get("ROUNDS", "1"))):
            for number in range(300):
                stranger = strangers.enter_context(socket.create_connection((site.host, site.port), 10))
                stranger.sendall(b"POST /api/stop-all HTTP/1.1\r\n" if number % 2 else b"G")
            assert site.post("/api/stop-all")[0] == 200
            is_well(site)


def test_a_flood_of_strangers_keeps_nobody_out(site):
    """Connections that come while a stop arrives, as fast as they can."""
    # The first one also waits for IDs without a motor.
    assert site.post("/api/stop-all")[0] == 200
    done = threading.Event()
    with ExitStack() as strangers, ThreadPoolExecutor(2) as pool:

        def flood():
            for _ in range(5000):
                if done.is_set():
                    return
                stranger = strangers.enter_context(socket.create_connection((site.host, site.port), 10))
                stranger.sendall(b"G")

        floods = [pool.submit(flood) for _ in range(2)]
        try:
            for _ in range(5):
                assert site.post("/api/stop-all")[0] == 200
        finally:
            done.set()
        for one in floods:
            one.result()
