"""Viewers that speak Foxglove's WebSocket protocol, and what may not read or move drives through it."""

import json
import math
import socket
import time
from urllib.parse import urlsplit

import pytest
from mcap.reader import make_reader
from websockets.exceptions import ConnectionClosed, InvalidStatus

from foxglove import CURRENT, OLDER, Viewer, opened
from monitoring import Site
from peers import Plug
from program import Running, eventually
from sharing import Client

SIGNALS = "/st0/motor1/signals"
USUAL = ["/joint_states", "/diagnostics", "/events", SIGNALS, "/st0/motor1/signals_2_hz", "/rmd0/motor3/signals"]
DOORS = ["foxglove_url", "foxglove_url_without_token"]


@pytest.fixture(scope="module")
def ready(motorlink):
    """What a monitor of simulated drives says, which all tests use."""
    monitor = Running([motorlink, "monitor", "--listen", "127.0.0.1:0", "--foxglove", "127.0.0.1:0", "--json"])
    yield json.loads(monitor.line(0))
    monitor.end()


@pytest.fixture
def url(ready):
    return ready["foxglove_url"]


def refused(url, status, **options):
    with pytest.raises(InvalidStatus) as error:
        opened(url, **options).close()
    assert error.value.response.status_code == status, error.value.response.body


def lines(ready):
    """The share, to command a motor."""
    return Client(ready["at"].removeprefix("unix:"), "test")


def turned(client, rpm):
    """Turns the first ST motor, once it rests: SET_RAMP within 200 ms, START_MOTOR."""
    eventually(lambda: client.status() == 0, "a motor that can start", within=20)
    ramp = [7, *rpm.to_bytes(4, "little"), *(200).to_bytes(2, "little")]
    for code in (ramp, [3, 1]):
        assert client.command("st0", 1, *code, within=2)["kind"] == "answer"


def test_a_viewer_sees_what_the_motor_does(ready, url):
    with Viewer(url) as viewer:
        assert viewer.info["op"] == "serverInfo" and viewer.info["capabilities"] == []
        assert "supportedEncodings" not in viewer.info
        for topic in USUAL:
            viewer.until(lambda topic=topic: topic in viewer.channels)
        viewer.subscribe("/events")
        for topic in (SIGNALS, "/joint_states"):
            viewer.subscribe(topic)
        client = lines(ready)
        turned(client, 1000)

        def fast():
            return [it for _, it in viewer.of(SIGNALS) if it.speed_meas > 950 and it.status == 6]

        viewer.until(lambda: len(viewer.messages) % 20 == 0 and fast())
        joints = [it for _, it in viewer.of("/joint_states") if it.name == ["st0_motor1"]]
        stamps = {(it.header.stamp.sec, it.header.stamp.nanosec): it for it in joints}
        rows = viewer.of(SIGNALS)
        for at, row in rows:
            assert at == row.stamp.sec * 10**9 + row.stamp.nanosec
            joint = stamps.get((row.stamp.sec, row.stamp.nanosec))
            if joint:
                assert math.isclose(joint.velocity[0], row.speed_meas * math.pi / 30)
        assert abs(rows[-1][0] / 1e9 - time.time()) < 5
        viewer.until(lambda: any(it.function == "commanded" for _, it in viewer.of("/events")))
        client.socket.close()
        viewer.until(lambda: viewer.of(SIGNALS)[-1][1].speed_meas == 0)


def test_a_viewer_sees_the_topics_and_types_of_a_recording(ready, start, tmp_path):
    path, share = tmp_path / "run.mcap", ready["at"].removeprefix("unix:")
    with Viewer(ready["foxglove_url"]) as viewer:
        viewer.subscribe(SIGNALS)
        words = ["-p", f"share:{share}/st0", "-p", f"share:{share}/rmd0", "-o", path, "--rate", "50", "--json"]
        recording = start("record", *words)
        recording.line(0)
        end = time.time_ns() + 10**9
        viewer.until(lambda: viewer.messages and viewer.messages[-1].time > end)
        recording.interrupt()
        assert recording.wait() == 0
        with open(path, "rb") as file:
            recorded = make_reader(file).iter_messages()
            types = {channel.topic: (schema.name, schema.data.decode()) for schema, channel, _ in recorded}
        for topic, channel in viewer.channels.items():
            if topic in types:
                assert (channel["schemaName"], channel["schema"]) == types[topic], topic
        assert {SIGNALS, "/joint_states", "/diagnostics", "/rmd0/motor3/signals"} <= set(types) & set(viewer.channels)


def test_both_names_of_the_protocol_are_known_and_no_others(url):
    for protocols in ([OLDER], [OLDER, CURRENT]):
        with Viewer(url, protocols=protocols) as viewer:
            assert viewer.socket.subprotocol == protocols[-1]
            assert viewer.reads(SIGNALS, 3)
    for protocols in ([], ["other"]):
        refused(url, 400, protocols=protocols)


def test_who_comes_late_or_again_gets_the_same_channels_and_messages(url):
    with Viewer(url) as first:
        first.reads(SIGNALS, 50)
        with Viewer(url) as late:
            late.until(lambda: late.channels and set(first.channels) <= set(late.channels))
            assert late.reads(SIGNALS, 20)
            first.until(lambda: first.messages[-1].time >= late.messages[-1].time)
            both = {it.time: it.data for it in first.messages}
            assert [both.get(it.time) for it in late.messages] == [it.data for it in late.messages]
            known, session = late.channels, late.info["sessionId"]
    with Viewer(url) as again:
        assert again.reads(SIGNALS, 5)
        assert again.info["sessionId"] == session
        assert all(known[topic] == channel for topic, channel in again.channels.items())


def narrow(url):
    """A viewer with little room in the system, that reads when it is told to."""
    parts = urlsplit(url)
    stream = socket.socket()
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stream.connect((parts.hostname, parts.port))
    # The replies to pings of the library would wait behind messages that it has not read.
    return Viewer(url, sock=stream, max_queue=1, ping_interval=None)


def test_a_viewer_that_does_not_read_delays_nobody_and_gets_what_has_waited(ready):
    with Viewer(ready[DOORS[0]]) as other, narrow(ready[DOORS[1]]) as slow:
        for topic in USUAL:
            other.until(lambda topic=topic: topic in other.channels)
        for viewer in (other, slow):
            for topic in list(other.channels):
                viewer.subscribe(topic)
        slow.until(lambda: slow.messages)
        # More than what the systems store for it, and less than what the server stores.
        end = time.time_ns() + 6 * 10**9
        other.until(lambda: other.messages[-1:] and other.messages[-1].time > end)
        assert abs(other.messages[-1].time / 1e9 - time.time()) < 2
        slow.until(lambda: slow.messages[-1].time > end)
        assert not other.statuses and not slow.statuses
        times = [it.time for it in slow.messages if it.topic == SIGNALS]
        assert max(b - a for a, b in zip(times, times[1:])) < 10**9


def test_nothing_that_a_viewer_sends_moves_or_stops_a_motor(ready, url):
    client = lines(ready)
    turned(client, 600)
    with Viewer(url) as viewer:
        viewer.reads(SIGNALS, 5)
        viewer.until(lambda: (last := viewer.of(SIGNALS)[-1][1]).status == 6 and last.speed_meas > 500)
        channel = {"id": 1, "topic": "/cmd", "encoding": "cdr", "schemaName": "std_msgs/msg/Float64"}
        parameter = {"name": "/st0/motor1/SPEED_REF", "value": 0}
        for op, members in {
            "advertise": {"channels": [channel]}, "setParameters": {"parameters": [parameter]}, "stop": {},
        }.items():
            viewer.send(op, **members)
            assert viewer.is_told(f'does not do "{op}"') == 2
        for binary in (b"\1\1\0\0\0" + bytes(8), b"\2" + bytes(12)):
            viewer.socket.send(binary)
        # The same as texts of a page or of a share.
        viewer.socket.send('{"id":1,"ask":"stop"}')
        viewer.socket.send('{"id":1,"ask":"command","line":"st0","motor":1,"bytes":[3,2],"time_to_live":1}')
        viewer.until(lambda: sum(level == 2 for level, _ in viewer.statuses) >= 7)
        viewer.messages.clear()
        viewer.until(lambda: len(viewer.messages) > 20)
        rows = viewer.of(SIGNALS)
        assert all(row.status == 6 for _, row in rows) and rows[-1][1].speed_meas > 500
    # Nor does its end.
    assert client.command("st0", 1, 2, 2, within=2)["kind"] == "answer"
    client.socket.close()


def test_too_much_ends_a_connection(url):
    for many in (["x"] * 5000, ["x" * 70_000], [b"x" * 70_000]):
        viewer = opened(url)
        with pytest.raises(ConnectionClosed):
            for message in many:
                viewer.send(message)
            while True:
                viewer.recv(timeout=20)
    with Viewer(url) as viewer:
        assert viewer.reads(SIGNALS, 2)


OTHERS = ["http://evil.example", "null", "file://", "https://127.0.0.1.evil.example", "http://localhost.evil.example",
          "http://evil.example:8765", "ftp://127.0.0.1", "http://127.0.0.1@evil.example", "http://192.168.0.7"]


def test_pages_of_other_sites_read_nothing(ready):
    for origin in OTHERS:
        refused(ready["foxglove_url_without_token"], 403, origin=origin)
    site, origin = Site(ready), OTHERS[0]
    bare = ready["foxglove_url"].split("?")[0]
    for cookies in (site.operator, site.viewer):
        refused(bare, 403, origin=origin, additional_headers=cookies)
    refused(f"{bare}?token={'0' * 32}", 403, origin=origin)
    # A viewer that is a page itself has the token from a person.
    with Viewer(ready["foxglove_url"], origin=origin) as viewer:
        assert viewer.reads(SIGNALS, 2)


def test_programs_and_pages_of_this_computer_read_without_a_token(ready):
    for origin in (None, "http://127.0.0.1:3000", "http://localhost:8080", "https://[::1]"):
        with Viewer(ready["foxglove_url_without_token"] + "/any?path=1", origin=origin) as viewer:
            assert viewer.reads(SIGNALS, 2)


def test_the_port_of_the_page_needs_a_token(ready):
    site = Site(ready)
    bare = ready["foxglove_url"].split("?")[0]
    for query in ("", "?token=", f"?token={'0' * 32}", "?token=%00"):
        refused(bare + query, 401, origin=site.origin)
    for token in site.tokens.values():
        with Viewer(f"{bare}?token={token}") as viewer:
            assert viewer.reads(SIGNALS, 2)
    with Viewer(bare, origin=site.origin, additional_headers=site.viewer) as viewer:
        assert viewer.reads(SIGNALS, 2)
    # A token in the address opens nothing else.
    token = ready["foxglove_url"].split("?")[1]
    assert site.request("GET", f"/ws?{token}", {"Origin": site.origin})[0] == 401
    assert site.request("POST", f"/api/stop-all?{token}", {"Origin": site.origin})[0] == 401


def test_a_name_that_another_site_gave_this_address_is_refused(ready):
    for door in DOORS:
        parts = urlsplit(ready[door])
        with socket.create_connection((parts.hostname, parts.port), timeout=20) as stream:
            words = [
                f"GET {parts.path or '/'}?{parts.query} HTTP/1.1", "Host: evil.example", "Upgrade: websocket",
                "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                f"Sec-WebSocket-Protocol: {CURRENT}",
            ]
            stream.sendall("\r\n".join([*words, "", ""]).encode())
            assert stream.recv(100).split(b" ")[1] == b"403"


def test_a_page_that_is_no_viewer_gets_nothing_at_the_port_without_a_token(ready):
    address = urlsplit(ready["foxglove_url_without_token"])
    site = Site({**ready, "url": f"http://{address.netloc}/?token={'0' * 32}"})
    for path in ("/", "/ws", "/api/stop-all"):
        assert site.request("GET", path)[0] == 400
    assert site.request("POST", "/api/stop-all", site.operator)[0] == 405


def test_the_port_without_a_token_is_for_this_computer(run):
    for address in ("0.0.0.0:0", "192.0.2.1:8765"):
        tried = run("monitor", "--listen", "127.0.0.1:0", "--foxglove", address)
        assert tried.code == 2 and "anybody can read the drives" in tried.err


def test_nobody_reads_the_drives_when_no_viewer_is_there(ready, url):
    client = lines(ready)

    def read():
        return [it["line"] for it in client.ask("rates")["rates"]]

    eventually(lambda: read() == [], "the end of viewers before")
    with Viewer(url) as viewer:
        viewer.reads(SIGNALS, 5)
        assert eventually(lambda: {"st0", "rmd0"} <= set(read()), "rates")
    eventually(lambda: read() == [], "no rates", within=20)
    client.socket.close()


def test_a_drive_that_answers_later_appears(sim, start):
    drives = sim(st=("tcp",), rmd=())
    cable = Plug(drives.st_address)
    monitor = start("monitor", "-p", cable.port, "--timeout", "300ms", "--listen", "127.0.0.1:0", "--json")
    ready = json.loads(monitor.line(0))
    cable.unplug()
    with Viewer(ready["foxglove_url"]) as early:
        assert early.is_told("no motor of st0 answers") == 1
        with Viewer(ready["foxglove_url"]) as late:
            assert late.is_told("no motor of st0 answers") == 1
            cable.plug_in()
            assert late.reads(SIGNALS, 3) and early.reads(SIGNALS, 3)
            cable.unplug()
            early.subscribe("/diagnostics")
            early.until(lambda: any(it.status[0].level == 3 for _, it in early.of("/diagnostics")))
            cable.plug_in()
            seen = len(late.messages)
            late.until(lambda: len(late.messages) > seen + 3)
        with Viewer(ready["foxglove_url"]) as last:
            last.reads(SIGNALS, 3)
            assert not last.statuses
