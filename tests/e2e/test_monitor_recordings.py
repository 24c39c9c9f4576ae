"""The recordings of `motorlink monitor`: made by pages, read by other people's tools, and their ends."""

import json
import resource
import signal
import socket
import struct
import time

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from monitoring import Site, is_kind, kind

PLACES = ["../outside.mcap", "..%2foutside.mcap", "%2fetc%2fpasswd", "outside.mcap%00.mcap", "link.mcap", "notes.txt"]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "recordings"


@pytest.fixture
def begin(start, folder):
    """Starts a monitor of simulated drives."""

    def begin(*words, **options):
        process = start("monitor", "--listen", "127.0.0.1:0", "--json", "--recordings", folder, *words, **options)
        return process, Site(json.loads(process.line(0)))

    return begin


@pytest.fixture
def site(begin):
    return begin()[1]


def told(page, phase, **least):
    """What a page is told of the recording when it is so far, with so many bytes or values at least."""
    def is_so(it):
        return is_kind(it, "recorded") and it["phase"] == phase and all(it[name] >= least[name] for name in least)

    return page.until(is_so, 40)


def record(page):
    """Begins a recording, and waits until its file has values."""
    answer = page.ask("record", within=40)
    assert answer["kind"] == "answer", answer
    told(page, "recording", values=1000, bytes=10_000)
    return answer["name"]


def speeds(path):
    """The values of a motor in a file, as the readers of ROS give them."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        rows = reader.iter_decoded_messages(topics=["/st0/motor1/signals"])
        return [message.speed_meas for _, _, _, message in rows]


def frames(body):
    """The payloads of messages of a share, with their kinds."""
    while body:
        length, number = struct.unpack_from("<IB", body)
        yield number, body[8:8 + length]
        body = body[8 + length:]


def test_a_recording_is_seen_and_downloaded_by_viewers_and_made_by_operators(site, folder):
    with site.page() as page, site.page(site.viewer) as viewer:
        for ask in ("record", "end-recording"):
            assert viewer.ask(ask, rate=None)["reason"] == "forbidden"
        assert page.ask("recordings") | {"id": 0} == {
            "kind": "answer", "id": 0, "to": "recordings", "folder": str(folder), "recordings": [], "older": 0,
        }
        name = record(page)
        # Pages that come later are told at once.
        with site.page(site.viewer) as later:
            assert told(later, "recording")["name"] == name
        assert told(viewer, "recording", values=1)["by"] == page.welcome["name"]
        assert page.ask("record", rate=None)["reason"] == "busy"
        ended = page.ask("end-recording")["recording"]
        assert (ended["phase"], ended["lost"], ended["message"]) == ("ended", 0, None)
        assert told(viewer, "ended")["bytes"] == ended["bytes"]
        with site.page(site.viewer) as later:
            assert later.until(kind("recorded"))["name"] == name

        [listed] = viewer.ask("recordings")["recordings"]
        assert (listed["name"], listed["condition"], listed["bytes"]) == (name, "whole", ended["bytes"])
        assert {"st0/motor1", "rmd0/motor1"} <= set(listed["motors"])
        status, headers, body = site.request("GET", f"/api/recordings/{name}", site.viewer)
        assert status == 200 and body == (folder / name).read_bytes()
        assert headers["Content-Disposition"] == f"attachment; filename*=UTF-8''{name}"
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cache-Control"] == "no-store"

        signals = viewer.ask("recording", name=name)["signals"]
        number = next(n for n, it in enumerate(signals) if (it["motor"], it["name"]) == ("st0/motor1", "SPEED_MEAS"))
        path = f"/api/recordings/{name}/part?signals={number}&from=0&to=1000&points=20000"
        status, _, body = site.request("GET", path, site.viewer)
        (text, head), (data, columns) = frames(body)
        assert (status, text, data) == (200, 1, 2)
        assert json.loads(head)["damage"] is None
        version, group, _, rows, wide, _, _ = struct.unpack_from("<IIIIIId", columns)
        assert (version, group, wide) == (1, number, 3)
        values = struct.unpack_from(f"<{rows}d", columns, 32 + 16 * rows)
        assert [value for value in values if value == value] == speeds(folder / name)


def test_recordings_need_a_token_and_a_name_of_the_folder_and_parts_need_numbers(site, folder):
    with site.page() as page:
        name = record(page)
    path = f"/api/recordings/{name}"
    for headers in ({}, {"Cookie": f"motorlink-{site.port}=0"}):
        assert site.request("GET", path, headers)[0] == 401
    assert site.request("GET", path, {**site.operator, "Origin": "http://evil.example"})[0] == 403
    wrong = ["", "signals=x&from=0&to=1&points=9", "signals=0&from=NaN&to=1&points=9", "signals=0&from=2&to=1&points=9",
             f"signals={','.join('0' * 65)}&from=0&to=1&points=9"]
    for query in wrong:
        assert site.request("GET", f"{path}/part?{query}", site.operator)[0] == 400, query
    outside = folder.parent / "outside.mcap"
    outside.write_text("secret")
    (folder / "notes.txt").write_text("secret")
    (folder / "link.mcap").symlink_to(outside)
    for place in PLACES:
        for path_ in (f"/api/recordings/{place}", f"/api/recordings/{place}/part?signals=0&from=0&to=1&points=10"):
            status, _, body = site.request("GET", path_, site.operator)
            assert status in (400, 404) and b"secret" not in body, (path_, status, body)
    # Any number of points is possible: the server gives as many as it has room for.
    for points in (0, 10**18):
        query = f"signals=0,999&from=-1e300&to=1e300&points={points}"
        assert site.request("GET", f"{path}/part?{query}", site.operator)[0] == 200


def test_a_server_that_ends_makes_its_recording_whole_and_a_killed_one_leaves_what_it_has(begin, folder, run):
    process, site = begin()
    with site.page() as page:
        name = record(page)
        process.process.send_signal(signal.SIGKILL)
        assert process.wait(10) == -signal.SIGKILL
    recovered = run("recover", folder / name).ended(4)
    assert "the file was not finished" in recovered.out + recovered.err
    assert len(speeds(folder / name.replace(".mcap", ".recovered.mcap"))) > 10
    # The next server lists it, and draws it.
    process, site = begin()
    with site.page() as page:
        listed = {it["name"]: it for it in page.ask("recordings")["recordings"]}
        assert listed[name]["condition"] == "cut" and listed[name]["seconds"] > 0
        assert page.ask("recording", name=name)["damage"]
        name = record(page)
    # Its page has left. It is whole when the server ends.
    process.interrupt()
    assert process.wait(20) == 0, process.err
    run("recover", folder / name).ended(0)
    assert len(speeds(folder / name)) > 50


def limited(size):
    """A file may have this size; more is an error, as on a full disk."""

    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_a_full_disk_ends_the_recording_and_nothing_else(begin, folder):
    _, site = begin(first=limited(200_000))
    with site.page() as page:
        name = page.ask("record", within=40)["name"]
        failed = told(page, "failed")
        assert f"cannot write {folder / name} any more: File too large" in failed["message"]
        assert "stays readable" in failed["message"]
        assert page.ask("end-recording")["message"] == "nothing is recorded"
        assert page.ask("lines")["kind"] == "answer"
        # It has its end, so that readers of others open it.
        assert page.ask("recordings")["recordings"][0]["condition"] == "whole"
    assert speeds(folder / name)


def test_a_reader_that_reads_nothing_slows_nothing(begin, folder):
    _, site = begin()
    folder.mkdir()
    (folder / "large.mcap").write_bytes(bytes(20_000_000))
    slow = []
    for _ in range(5):
        stream = socket.create_connection((site.host, site.port), timeout=20)
        lines = ["GET /api/recordings/large.mcap HTTP/1.1", f"Host: {site.authority}",
                 f"Cookie: {site.operator['Cookie']}"]
        stream.sendall("\r\n".join([*lines, "", ""]).encode())
        slow.append(stream)
    with site.page() as page:
        record(page)
        before = told(page, "recording")["values"]
        told(page, "recording", values=before + 500)
        began = time.monotonic()
        assert page.ask("end-recording", within=20)["recording"]["lost"] == 0
        assert time.monotonic() - began < 15
    # The bytes come when they are read.
    slow[0].settimeout(20)
    received = 0
    while piece := slow[0].recv(1 << 16):
        received += len(piece)
    assert received > 20_000_000
    for stream in slow:
        stream.close()


def test_a_file_that_becomes_shorter_is_no_whole_download(site, folder):
    folder.mkdir()
    path = folder / "large.mcap"
    path.write_bytes(bytes(30_000_000))
    stream = socket.create_connection((site.host, site.port), timeout=20)
    head = f"GET /api/recordings/large.mcap HTTP/1.1\r\nHost: {site.authority}\r\nCookie: "
    stream.sendall(f"{head}{site.operator['Cookie']}\r\n\r\n".encode())
    stream.recv(1000)
    path.write_bytes(b"")
    received = 0
    while piece := stream.recv(1 << 16):
        received += len(piece)
    assert received < 30_000_000
    assert site.request("GET", "/api/recordings/large.mcap", site.viewer)[0] == 200
    stream.close()
