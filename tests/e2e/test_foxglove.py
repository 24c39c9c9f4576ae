"""Viewers that speak Foxglove's WebSocket protocol, and what may not read or move drives through it."""

import json
import math
import socket
import time
from contextlib import ExitStack
from operator import attrgetter
from urllib.parse import urlsplit

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from websockets.exceptions import ConnectionClosed, InvalidStatus

from foxglove import CURRENT, OLDER, Viewer, opened
from monitoring import Site
from peers import Plug
from program import eventually
from sharing import Client

SIGNALS = "/st0/motor1/signals"
USUAL = ["/joint_states", "/diagnostics", "/events", SIGNALS, "/st0/motor1/signals_2_hz", "/rmd0/motor3/signals"]
DOORS = ["foxglove_url", "foxglove_url_without_token"]
#: The most bytes of messages that wait for a viewer, and what the systems and its library store besides.
WAITING, STORED = 1 << 20, 1 << 17
#: A viewer that hardly reads takes one message while this many come.
TO_ONE = 20


@pytest.fixture
def ready(start):
    """What a monitor of simulated drives says."""
    return json.loads(start("monitor", "--listen", "127.0.0.1:0", "--foxglove", "127.0.0.1:0", "--json").line(0))


@pytest.fixture(params=DOORS)
def url(request, ready):
    return ready[request.param]


def refused(url, status, **options):
    with pytest.raises(InvalidStatus) as error:
        opened(url, **options).close()
    assert error.value.response.status_code == status, error.value.response.body


def lines(ready, motor=1):
    """The share, to command a motor."""
    return Client(ready["at"].removeprefix("unix:"), "test")


def turned(client, rpm):
    """Turns the first ST motor: SET_RAMP within 200 ms, START_MOTOR."""
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


def test_a_viewer_sees_what_a_recording_has(ready, start, tmp_path):
    path, share = tmp_path / "run.mcap", ready["at"].removeprefix("unix:")
    client = lines(ready)
    turned(client, 700)
    with Viewer(ready["foxglove_url"]) as viewer:
        for topic in ("/st0/motor1/signals_2_hz", SIGNALS, "/rmd0/motor3/signals"):
            viewer.subscribe(topic)
        words = ["-p", f"share:{share}/st0", "-p", f"share:{share}/rmd0", "-o", path, "--rate", "50", "--json"]
        recording = start("record", *words)
        recording.line(0)
        end = time.time_ns() + 3 * 10**9
        viewer.until(lambda: viewer.messages and viewer.messages[-1].time > end)
        recording.interrupt()
        assert recording.wait() == 0
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            recorded = [(schema, channel, decoded) for schema, channel, _, decoded in reader.iter_decoded_messages()]
        types = {channel.topic: (schema.name, schema.data.decode()) for schema, channel, _ in recorded}
        for topic, channel in viewer.channels.items():
            if topic in types:
                assert (channel["schemaName"], channel["schema"]) == types[topic], topic
        assert {SIGNALS, "/joint_states", "/diagnostics", "/rmd0/motor3/signals"} <= set(types) & set(viewer.channels)

        # Both read the values of the same exchanges, where their rhythms meet.
        def values(it):
            return tuple(getattr(it, name) for name in ("status", "flags", "speed_ref", "speed_meas", "torque_meas"))

        there = {values(it) for _, channel, it in recorded if channel.topic == SIGNALS}
        mine = {values(it) for _, it in viewer.of(SIGNALS)}
        assert len(mine & there) >= 5, (len(mine), len(there))
        volts = {it.bus_voltage for _, it in viewer.of("/st0/motor1/signals_2_hz")}
        assert volts & {it.bus_voltage for _, channel, it in recorded if channel.topic == "/st0/motor1/signals_2_hz"}
    client.socket.close()


@pytest.mark.parametrize("protocols", [[CURRENT], [OLDER], [OLDER, CURRENT], ["other", OLDER]])
def test_both_names_of_the_protocol_are_known(url, protocols):
    with Viewer(url, protocols=protocols) as viewer:
        assert viewer.socket.subprotocol == (CURRENT if CURRENT in protocols else OLDER)
        assert viewer.reads(SIGNALS, 3)


@pytest.mark.parametrize("protocols", [[], ["other"], ["foxglove.websocket.v2", "foxglove.sdk"]])
def test_another_protocol_is_refused(url, protocols):
    refused(url, 400, protocols=protocols)


def test_who_comes_late_or_again_gets_the_same_channels(url):
    with Viewer(url) as first:
        first.reads(SIGNALS, 50)
        with Viewer(url) as late:
            late.until(lambda: set(late.channels) == set(first.channels) and late.channels)
            assert late.reads("/joint_states", 5)
            known, session = late.channels, late.info["sessionId"]
    with Viewer(url) as again:
        assert again.reads(SIGNALS, 5)
        assert again.info["sessionId"] == session
        assert all(known[topic] == channel for topic, channel in again.channels.items())


def test_a_subscription_ends(url):
    with Viewer(url) as viewer:
        number = viewer.subscribe(SIGNALS)
        viewer.until(lambda: viewer.messages)
        viewer.send("unsubscribe", subscriptionIds=[number])
        viewer.send("unsubscribe", subscriptionIds=[number])
        viewer.is_told("there is no subscription")
        viewer.messages.clear()
        viewer.reads("/joint_states", 20)
        assert {it.topic for it in viewer.messages} == {"/joint_states"}


def test_ten_viewers_see_the_same(url):
    with ExitStack() as stack:
        viewers = [stack.enter_context(Viewer(url)) for _ in range(10)]
        for viewer in viewers:
            viewer.subscribe(SIGNALS)
        messages = []
        for viewer in viewers:
            viewer.until(lambda viewer=viewer: len(viewer.messages) >= 60)
            messages.append({it.time: it.data for it in viewer.messages})
        common = set.intersection(*map(set, messages))
        assert len(common) >= 10
        assert all(len({each[at] for each in messages}) == 1 for at in common)


def narrow(url):
    """A viewer with little room in the system, that reads when it is told to."""
    parts = urlsplit(url)
    stream = socket.socket()
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stream.connect((parts.hostname, parts.port))
    # The replies to pings of the library would wait behind messages that it has not read.
    return Viewer(url, sock=stream, max_queue=1, ping_interval=None)


def test_a_viewer_that_hardly_reads_loses_the_oldest_is_told_how_many_and_delays_nobody(ready):
    with Viewer(ready[DOORS[0]]) as other, narrow(ready[DOORS[1]]) as slow:
        for topic in USUAL:
            other.until(lambda topic=topic: topic in other.channels)
        for topic in list(other.channels):
            other.subscribe(topic)
        usual = set(other.topics.values()) - {"/events"}
        other.until(lambda: {it.topic for it in other.messages} >= usual)
        for topic in other.topics.values():
            slow.subscribe(topic)
        # Subscriptions begin one after the other.
        slow.until(lambda: {it.topic for it in slow.messages} >= usual)
        slow.messages.clear()
        key = attrgetter("topic", "time", "data")
        #: What the slow viewer is told: how many messages are lost, and how many it has read before.
        told = []

        def read():
            slow.receive()
            for level, text in slow.statuses[len(told):]:
                assert level == 1 and text.endswith(" messages are lost here: this viewer is too slow"), text
                told.append((int(text.split()[0]), len(slow.messages)))

        while len(told) < 2:
            seen = len(other.messages)
            other.until(lambda seen=seen: len(other.messages) >= seen + TO_ONE)
            read()
            other.catch_up()
        # Now it reads all that waited for it.
        waited_from, until = len(slow.messages), len(other.messages)
        known = set(map(key, other.messages))
        while key(slow.messages[-1]) in known:
            read()
        last = key(slow.messages[-1])
        other.until(lambda: key(other.messages[-1]) == last)
        other.until(lambda: abs(other.messages[-1].time / 1e9 - time.time()) < 2)
        assert not other.statuses
        assert not any(b.time - a.time > 1e9 for a, b in zip(other.messages, other.messages[1:]))

        numbers = {key(it): number for number, it in enumerate(other.messages)}
        arrived = [numbers[key(it)] for it in slow.messages]
        assert arrived == sorted(set(arrived))

        def size(some):
            return sum(len(other.messages[it].data) for it in some)

        # What waits is bounded, and the newest of it is complete.
        assert size(it for it in arrived[waited_from:] if it < until) <= WAITING + STORED
        newest = until
        while size(range(newest, until)) < WAITING // 2:
            newest -= 100
        assert set(arrived) >= set(range(newest, until))

        def lost(count):
            """How many messages are missing among the first ones that arrived."""
            return arrived[count - 1] - arrived[0] + 1 - count

        for number, (_, count) in enumerate(told, 1):
            assert lost(count) <= sum(said for said, _ in told[:number]) <= lost(count + 1), (told, number)


WRONG = [
    "", "{", "null", "[]", "5", '{"op":7}', '{"op":"subscribe"}', '{"op":"subscribe","subscriptions":7}',
    '{"op":"subscribe","subscriptions":[{"id":1}]}', '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":0}]}',
    '{"op":"subscribe","subscriptions":[{"id":1,"channelId":99999}]}', '{"op":"unsubscribe","subscriptionIds":[5]}',
    "[" * 60_000, '{"op":"subscribe","op":"x"}', b"", b"\1", b"\1\0\0\0\0abc", b"\2" + bytes(20), bytes(range(256)),
]


def test_what_is_no_message_is_refused_and_harms_nothing(url):
    with Viewer(url) as viewer:
        for number, said in enumerate(WRONG, 1):
            viewer.socket.send(said)
            viewer.until(lambda number=number: len(viewer.statuses) == number)
            level, text = viewer.statuses[-1]
            assert level == 2 and len(text) < 300, (said, text)
        assert viewer.reads(SIGNALS, 2)


def test_nothing_that_a_viewer_sends_moves_or_stops_a_motor(ready, url):
    client = lines(ready)
    turned(client, 600)
    with Viewer(url) as viewer:
        viewer.reads(SIGNALS, 5)
        viewer.until(lambda: (last := viewer.of(SIGNALS)[-1][1]).status == 6 and last.speed_meas > 500)
        channel = {"id": 1, "topic": "/cmd", "encoding": "cdr", "schemaName": "std_msgs/msg/Float64"}
        parameter = {"name": "/st0/motor1/SPEED_REF", "value": 0}
        for op, members in {
            "advertise": {"channels": [channel]}, "unadvertise": {"channelIds": [1]},
            "setParameters": {"parameters": [parameter]}, "getParameters": {"parameterNames": []},
            "subscribeParameterUpdates": {"parameterNames": []}, "subscribeConnectionGraph": {},
            "fetchAsset": {"uri": "file:///etc/passwd", "requestId": 1}, "stop": {}, "latch": {},
        }.items():
            viewer.send(op, **members)
            assert viewer.is_told(f'does not do "{op}"') == 2
        for binary in (b"\1\1\0\0\0" + bytes(8), b"\2" + bytes(12)):
            viewer.socket.send(binary)
        # The same as texts of a page or of a share.
        viewer.socket.send('{"id":1,"ask":"stop"}')
        viewer.socket.send('{"id":1,"ask":"command","line":"st0","motor":1,"bytes":[3,2],"time_to_live":1}')
        viewer.until(lambda: sum(level == 2 for level, _ in viewer.statuses) >= 13)
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


@pytest.mark.parametrize("origin", OTHERS)
def test_pages_of_other_sites_read_nothing(ready, origin):
    refused(ready["foxglove_url_without_token"], 403, origin=origin)
    site = Site(ready)
    bare = ready["foxglove_url"].split("?")[0]
    for cookies in (site.operator, site.viewer):
        refused(bare, 403, origin=origin, additional_headers=cookies)
    refused(f"{bare}?token={'0' * 32}", 403, origin=origin)
    # A viewer that is a page itself has the token from a person.
    with Viewer(ready["foxglove_url"], origin=origin) as viewer:
        assert viewer.reads(SIGNALS, 2)


@pytest.mark.parametrize("origin", [None, "http://127.0.0.1:3000", "http://localhost:8080", "https://[::1]"])
def test_programs_and_pages_of_this_computer_read_without_a_token(ready, origin):
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


@pytest.mark.parametrize("name", ["evil.example", "127.0.0.1.evil.example:1", "a@127.0.0.1", ""])
def test_a_name_that_another_site_gave_this_address_is_refused(ready, name):
    for door in DOORS:
        parts = urlsplit(ready[door])
        with socket.create_connection((parts.hostname, parts.port), timeout=20) as stream:
            words = [
                f"GET {parts.path or '/'}?{parts.query} HTTP/1.1", f"Host: {name}", "Upgrade: websocket",
                "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                f"Sec-WebSocket-Protocol: {CURRENT}",
            ]
            stream.sendall("\r\n".join([*words, "", ""]).encode())
            assert stream.recv(100).split(b" ")[1] in (b"403", b"400")


def test_a_page_that_is_no_viewer_gets_nothing_at_the_port_without_a_token(ready):
    address = urlsplit(ready["foxglove_url_without_token"])
    site = Site({**ready, "url": f"http://{address.netloc}/?token={'0' * 32}"})
    for path in ("/", "/ws", "/foxglove", "/api/stop-all", "/assets/index.js"):
        assert site.request("GET", path)[0] == 400
    assert site.request("POST", "/api/stop-all", site.operator)[0] == 405


@pytest.mark.parametrize("address", ["0.0.0.0:0", "192.0.2.1:8765", "[::]:0"])
def test_the_port_without_a_token_is_for_this_computer(run, address):
    tried = run("monitor", "--listen", "127.0.0.1:0", "--foxglove", address)
    assert tried.code == 2 and "anybody can read the drives" in tried.err


def test_nobody_reads_the_drives_when_no_viewer_is_there(ready, url):
    client = lines(ready)

    def read():
        return [it["line"] for it in client.ask("rates")["rates"]]

    assert read() == []
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
