"""The dissector that `motorlink spec wireshark` writes, in tshark, against what `motorlink-proto` reads
in the same frames (crates/spec/examples/wireshark_frames).
"""

import math
import random
import shutil

import pytest
from pcapng import COOKED, EXTENDED, REMOTE, RTAC_SERIAL, SOCKETCAN, USER0, Capture
from wireshark import ALL_RMD, ALL_ST, GET_SPEED, NACK, PROFILES, SPEED_1500, USER0_IS_ST, on_can, on_line, some

pytestmark = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")


def same(name, got, expected):
    if isinstance(expected, str):
        return got == expected or got.replace(":", "") == expected
    number = float(got) if not got.startswith("0x") else int(got, 0)
    if isinstance(expected, float) and name.startswith("motorlink.st"):
        # tshark prints a float of 32 bits with 6 digits.
        number, expected = float32(number), float32(expected)
    elif isinstance(expected, int) and not got.startswith("0x"):
        number = int(got)
    return math.isclose(number, expected, rel_tol=1e-14)


def float32(number):
    """The number with 6 digits."""
    return float(f"{number:.6g}")


def values(fields):
    """The fields of the dissector without what the other tests look at."""
    apart = ("type.source", "response_to", "response_time", "response_in", "whole_in", "checksum.calculated")
    return {name: got for name, got in fields.items() if name.startswith("motorlink.") and not name.endswith(apart)}


def check(frame, fields, number):
    """The fields of a packet are those of the frame, and no others."""
    got = values(fields)
    layer = "motorlink.rmd" if "id" in frame else "motorlink.st"
    expected = {name: value if isinstance(value, list) else [value] for name, value in frame["fields"].items()}
    for note in frame["notes"]:
        expected[f"{layer}.{note}"] = None
    assert got.keys() == expected.keys(), (number, frame, fields)
    for name, value in expected.items():
        if value is None:
            continue
        assert len(got[name]) == len(value), (number, name, got[name], frame)
        for one, other in zip(got[name], value):
            assert same(name, one, other), (number, name, one, other, frame)
    link = fields[f"{layer}.response_to"], fields[f"{layer}.response_time"]
    if frame.get("answers"):
        assert link[0] == [str(number - 1)] and [float(time) for time in link[1]] == [0.001], (number, link)
    else:
        assert link == ([], [])


AS_HOST = [*ALL_RMD, "motorlink.rmd.direction:host"]
ASK, STATUS = bytes.fromhex("9a00000000000000"), bytes.fromhex("9a1900f000000000")


def test_every_frame_of_rmd_has_the_values_and_the_text_of_the_core(packets, tshark, sets):
    frames = sets["rmd"] + sets["rmd told"]
    codes = {frame["data"][0] for frame in frames}
    assert len(codes) == 256 and len(frames) > 1000
    for number, (frame, fields) in enumerate(zip(frames, packets(on_can(frames), preferences=AS_HOST)), 1):
        check(frame, fields, number)
        assert fields["motorlink.rmd.type.source"] == (["frame"] if frame["id"] == 0x280 else ["capture"])
    out = tshark(on_can(frames), "-T", "fields", "-e", "_ws.col.Info", preferences=AS_HOST)
    assert out.splitlines() == [frame["info"] for frame in frames]


def test_the_direction_is_that_of_the_host_of_the_motor_or_what_no_request_looks_like(packets, sets):
    """Three buses: captured by a host, by a motor, and without directions."""
    frames, capture = sets["rmd"], Capture(*[SOCKETCAN] * 3)
    motors = sorted({frame["id"] for frame in frames})
    for bus, by_host in enumerate((True, False, None)):
        # First of each motor a request and its reply, which no request looks like.
        exchanges = [(motor, data, data is ASK) for motor in motors for data in (ASK, STATUS)]
        for identifier, data, sent in [*exchanges, *((it["id"], it["data"], it["sent"]) for it in frames)]:
            capture.can(identifier, data, None if by_host is None else sent == by_host, interface=bus)
    got = list(enumerate(packets(capture), 1))
    host, motor, untold = (got[bus * len(got) // 3 :][: len(got) // 3] for bus in range(3))
    first = 2 * len(motors)
    for shown in (host, motor):
        for frame, (number, fields) in zip(frames, shown[first:]):
            check(frame, fields, number)
    assert [fields["motorlink.rmd.type"][0] for _, fields in untold[:first]] == ["0", "2"] * len(motors)
    known = 0
    for frame, (number, fields) in zip(frames, untold[first:]):
        if fields["motorlink.rmd.type"] == ["0"]:
            assert frame["answers"] and fields["motorlink.rmd.type.source"] == ["nothing"]
        else:
            known += 1
            check(frame, fields, number)
    assert known > 0.6 * len(frames)


@pytest.mark.parametrize("profile", PROFILES)
def test_every_frame_of_st_has_the_values_that_the_core_reads(packets, tshark, sets, profile):
    frames = sets[f"st {profile}"]
    assert len(frames) > 5000
    # The profiles have a few other types and units.
    frames = frames if profile == "spec" else some(frames, 1 / 2)
    preferences = [f"motorlink.st.profile:{profile}"]
    for number, (frame, fields) in enumerate(zip(frames, packets(on_line(frames), preferences=preferences)), 1):
        check(frame, fields, number)
        assert fields["motorlink.st.type.source"] == ["capture"]
    if profile != "spec":
        return  # test_decoders.py compares the texts of this one.
    out = tshark(on_line(frames), "-T", "fields", "-e", "_ws.col.Info", preferences=preferences)
    for frame, info in zip(frames, out.splitlines()):
        assert frame["info"] is None or info == frame["info"], frame
        name, version = (frame["fields"].get(f"motorlink.st.{key}") for key in ("name", "version"))
        if name is not None and version is not None:
            assert info == f"< ACK {name} {version}", frame


def test_every_beginning_of_a_frame_is_shown_as_one(packets, sets):
    frames = sets["st spec prefixes"]
    assert len(frames) > 15
    # Nothing follows on the line of a frame.
    capture = Capture(*[RTAC_SERIAL] * len(frames))
    for interface, frame in enumerate(frames):
        capture.serial(frame["data"], frame["sent"], interface=interface)
    for number, (frame, fields) in enumerate(zip(frames, packets(capture, preferences=ALL_ST)), 1):
        check(frame, fields, number)


def test_a_frame_that_the_other_end_or_a_silence_cuts_is_truncated(packets, sets):
    for cut in ("other end", "silence"):
        frames, capture = sets["st spec prefixes"], Capture(RTAC_SERIAL)
        for frame in frames:
            capture.serial(frame["data"], frame["sent"], after_ms=1001 if cut == "silence" else 1)
            if cut == "other end":
                capture.serial(NACK if frame["sent"] else GET_SPEED, not frame["sent"])
        step = 2 if cut == "other end" else 1
        got = packets(capture, "-2", preferences=ALL_ST)[::step]
        for number, (frame, fields) in enumerate(zip(frames, got), 1):
            is_last = cut == "silence" and number == len(frames)
            check(frame if is_last else {**frame, "notes": ["truncated"]}, fields, number)


def test_frames_are_found_however_packets_divide_them(packets, sets):
    """One packet for each byte, and packets of many frames, in place of a packet for each frame."""
    frames = [frame for frame in sets["st spec"] if len(frame["data"]) < 12][:200]
    exchanges = Capture(RTAC_SERIAL)
    for frame in frames:
        for at in range(len(frame["data"])):
            exchanges.serial(frame["data"][at : at + 1], frame["sent"], after_ms=0.01)
    got = packets(exchanges, preferences=ALL_ST)
    number = 0
    for frame in frames:
        number += len(frame["data"])
        fields = values(got[number - 1])
        assert fields["motorlink.st.checksum.status"] == ["1"], frame
        for name, value in frame["fields"].items():
            assert len(fields[name]) == len(value if isinstance(value, list) else [value]), (name, frame)
    sent = [frame["data"] for frame in frames if frame["sent"]]
    together = Capture(RTAC_SERIAL)
    together.serial(b"".join(sent), True)
    [fields] = packets(together)
    assert len(fields["motorlink.st.checksum.status"]) == len(sent)
    assert [int(code, 0) for code in fields["motorlink.st.header"]] == [data[0] for data in sent]


def test_requests_and_replies_are_linked(packets):
    can = Capture(SOCKETCAN)
    for motor in (1, 2):
        can.can(0x140 + motor, bytes.fromhex("9c00000000000000"), True)
    for motor in (2, 1):
        can.can(0x140 + motor, bytes.fromhex("9c19000000000010"), False)
    can.can(0x280, bytes(8), True)
    for motor in (1, 2, 3, 4):
        can.can(0x140 + motor, bytes.fromhex("a119000000000010"), False)
    can.can(0x141, bytes.fromhex("a200000010270000"), True)
    got = packets(can, "-2")
    assert [fields["motorlink.rmd.response_in"] for fields in got[:2]] == [["4"], ["3"]]
    assert [fields["motorlink.rmd.response_to"] for fields in got[2:4]] == [["2"], ["1"]]
    assert [float(fields["motorlink.rmd.response_time"][0]) for fields in got[2:4]] == [0.001, 0.003]
    assert got[4]["motorlink.rmd.response_in"] == ["6", "7", "8", "9"]
    assert all(fields["motorlink.rmd.response_to"] == ["5"] for fields in got[5:9])
    assert got[9]["motorlink.rmd.no_reply"] == [""] and not got[0]["motorlink.rmd.no_reply"]


def types(packets, cases, preferences=()):
    """What frames of motor 1 are, on a bus for each case: `>` sent, `<` received, `-` without direction,
    each with its time in ms."""
    can = Capture(*[SOCKETCAN] * len(cases))
    for bus, frames in enumerate(cases):
        now = 0
        for ms, direction, data in frames:
            can.can(0x141, data, {">": True, "<": False, "-": None}[direction], after_ms=ms - now, interface=bus)
            now = ms
    got = iter(packets(can, preferences=preferences))
    return ["".join("?><"[int(next(got)["motorlink.rmd.type"][0])] for _ in frames) for frames in cases]


def test_what_cannot_be_known_is_not_known(packets, tshark):
    """The same cases as those of `motorlink decode`."""
    off, angle, clear = (bytes.fromhex(code + "00" * 7) for code in ("80", "92", "9b"))
    certain = [(0, "-", ASK), (1, "-", STATUS), (10, "-", ASK), (11, "-", STATUS)]
    behind = [(20, "-", off), (21, "-", off), (30, "-", ASK)]
    patient = [(0, "-", ASK), (1, "-", STATUS), (10, "-", ASK), (80, "-", ASK)]
    cases = {
        "?<><>?>": certain + behind,
        "?<>>": patient,
        "???": [(0, "-", angle), (1, "-", angle), (10, "-", angle)],
        "?>?>>": [(0, "-", off), (51, "-", off), (52, "-", off), (200, "-", off), (300, "-", off)],
        "><><": [(0, ">", clear), (1, "<", ASK), (2, ">", clear), (3, "<", clear)],
        "><><?<": [(0, ">", off), (1, "<", off), (2, ">", angle), (3, "<", angle), (10, "<", angle), (11, "<", STATUS)],
        # A machine that only listens receives requests, too.
        "?<><": [(0, "<", ASK), (1, "<", STATUS), (10, "<", ASK), (11, "<", STATUS)],
        "?<>< ": [(0, "<", ASK), (1, ">", STATUS), (10, "<", off), (11, ">", off)],
    }
    # Several requests at once: the angle of 0 degrees looks like its request.
    status_2, reply_2 = bytes.fromhex("9c00000000000000"), bytes.fromhex("9c19000000000010")
    cases["?<>>?<>><>"] = [
        *[(0, "-", ASK), (1, "-", STATUS), (10, "-", angle), (11, "-", status_2), (12, "-", angle), (13, "-", reply_2)],
        *[(14, "-", off), (15, "-", ASK), (16, "-", STATUS), (17, "-", off)],
    ]
    # A machine that sent everything may be both ends, as on a virtual bus.
    cases[">?><><>?"] = [
        *[(0, ">", off), (1, ">", off), (2, ">", ASK), (3, ">", STATUS), (4, ">", ASK), (5, ">", STATUS)],
        *[(6, ">", off), (7, ">", off)],
    ]
    cases["><>>"] = [(0, ">", off), (1, "<", off), (2, ">", off), (3, ">", off)]
    # A motor's capture without a certain reply: what it sends may answer a request.
    cases["?>?"] = [(0, "<", off), (60, "<", off), (61, ">", off)]
    assert types(packets, list(cases.values())) == [expected.strip() for expected in cases]
    assert types(packets, [patient], ["motorlink.rmd.patience_ms:100"]) == ["?<>?"]
    can = Capture(SOCKETCAN)
    can.can(0x141, bytes.fromhex("a200000010270000"))
    can.can(0x141, bytes.fromhex("9400000000000000"))
    can.can(0x141, off)
    assert tshark(can, "-T", "fields", "-e", "_ws.col.Info").splitlines() == [
        "motor 1 ? 0xA2 Speed closed-loop command: request speed 100.00 °/s, or reply "
        "temperature 0 °C, iq 0.000 A, speed 10000 °/s, encoder 0",
        "motor 1 ? 0x94 Read single circle angle command: request, or reply angle 0.00 °",
        "motor 1 ? 0x80 Motor off command",
    ]


def test_the_direction_can_be_turned_or_ignored(packets):
    can, serial = Capture(SOCKETCAN, COOKED), Capture(USER0)
    for sent in (True, False):
        can.can(0x141, bytes.fromhex("9c00000000000000"), sent)
        serial.packet(GET_SPEED if sent else SPEED_1500, sent)
    for sent in (True, False):
        can.cooked_can(0x141, bytes.fromhex("9c00000000000000"), sent, interface=1)
    for preference, expected in (("auto", "1212"), ("drive", "2121"), ("untold", "0000")):
        got = packets(can, preferences=[f"motorlink.rmd.direction:{preference}"])
        assert "".join(fields["motorlink.rmd.type"][0] for fields in got) == expected
    got = packets(serial, preferences=[USER0_IS_ST, "motorlink.st.direction:untold"])
    assert [fields["motorlink.st.type.source"][0] for fields in got] == ["header"] * 2
    assert [fields["motorlink.st.type"] for fields in got] == [["1"], ["2"]]
    assert got[1]["motorlink.st.value"] == ["1500"]


def test_frames_of_others_are_left_to_others(packets):
    foreign = Capture(SOCKETCAN)
    foreign.can(0x141, bytes(8))  # No command has the code 0.
    foreign.can(0x280, bytes(8))  # No RMD motor was seen.
    foreign.can(0x141, bytes.fromhex("9c00000000000000")[:4])
    foreign.can(0x141 | EXTENDED, bytes.fromhex("9c00000000000000"))
    foreign.can(0x141 | REMOTE, b"")
    foreign.can(0x181, bytes.fromhex("9c00000000000000"))
    foreign.can(0x141, bytes.fromhex("9c") + bytes(11), fd=True)
    foreign.can(0x140, bytes.fromhex("9c00000000000000"))
    foreign.can(0x161, bytes.fromhex("9c00000000000000"))
    assert not any(values(fields) for fields in packets(foreign))
    own = Capture(SOCKETCAN)
    own.can(0x141, bytes.fromhex("9c00000000000000"))
    own.can(0x280, bytes(8))
    own.can(0x241, bytes.fromhex("9c00000000000000"))
    own.can(0x141, b"\x9c")
    assert [bool(values(fields)) for fields in packets(own)] == [True, True, False, False]
    assert not any(values(fields) for fields in packets(own, preferences=["motorlink.rmd.claim:off"]))
    by_hand = ["-d", "can.subdissector,motorlink.rmd"]
    got = packets(own, *by_hand, preferences=["motorlink.rmd.claim:off"])
    assert got[0]["motorlink.rmd.code"] == ["0x9c"] and got[1]["motorlink.rmd.iq_1_amps"] == ["0"]
    assert got[2]["motorlink.rmd.dialect"] == ["V3/V4"] and got[3]["motorlink.rmd.wrong_size"] == [""]
    serial = Capture(RTAC_SERIAL, RTAC_SERIAL)
    serial.serial(bytes.fromhex("0103000000010a84"), True)  # Modbus
    serial.serial(SPEED_1500, False, interface=1)
    got = packets(serial)
    assert not values(got[0]) and got[1]["motorlink.st.header"] == ["0xf0"]
    assert not any(values(fields) for fields in packets(serial, preferences=["motorlink.st.claim:off"]))
    got = packets(serial, "-d", "rtacser.data,motorlink.st", preferences=["motorlink.st.claim:off"])
    assert all(values(fields) for fields in got)


def test_random_bytes_raise_no_error_of_lua(packets):
    numbers = random.Random(16)
    can, serial = Capture(SOCKETCAN), Capture(RTAC_SERIAL, USER0)
    codes = bytes.fromhex("303132333490911992949a9b9c9d808188a1a2a3a4a5a6")
    headers = bytes.fromhex("f0ffe0010203060708090a0b0c0d0e12")
    for _ in range(1000):
        identifier = numbers.choice([0x141, 0x160, 0x280, 0x181, 0x241, numbers.getrandbits(11)])
        identifier |= numbers.choice([0, 0, 0, 0, REMOTE, EXTENDED])
        data = numbers.randbytes(numbers.choice([8, 8, 8, numbers.randint(0, 8)]))
        if data and numbers.random() < 0.7:
            data = bytes([numbers.choice(codes)]) + data[1:]
        sent = numbers.choice([True, False, None])
        can.can(identifier, data, sent)
        data = bytearray(numbers.randbytes(numbers.randint(0, 40)))
        if len(data) > 3 and numbers.random() < 0.7:
            data[0], data[1] = numbers.choice(headers), len(data) - 3
            if numbers.random() < 0.8:
                total = sum(data[:-1])
                data[-1] = ((total >> 8) + total) & 0xFF
        if numbers.random() < 0.5:
            serial.serial(bytes(data), bool(sent), after_ms=numbers.choice([1, 1, 1, 2000]))
        else:
            serial.packet(bytes(data), sent, interface=1)
    # Two passes: the second one has read all of the capture.
    packets(can, "-2", preferences=ALL_RMD)
    packets(can, "-2", "-d", "can.subdissector,motorlink.rmd", preferences=["motorlink.rmd.claim:off"])
    found = packets(serial, "-2", preferences=[*ALL_ST, USER0_IS_ST])
    assert sum("motorlink.st.message" in fields for fields in found) > 200
