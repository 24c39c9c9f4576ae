"""The dissector that `motorlink spec wireshark` writes, on damaged serial lines."""

import json
import random
import shutil

import pytest
from pcapng import RTAC_SERIAL, Capture
from st_wire import frame
from wireshark import ALL_ST, GET_SPEED, NACK, SPEED_1500

pytestmark = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")


def test_a_frame_in_several_packets_is_whole_in_the_last(packets):
    capture = Capture(RTAC_SERIAL)
    capture.serial(GET_SPEED, True)
    for part in (SPEED_1500[:1], SPEED_1500[1:3], SPEED_1500[3:] + NACK[:2], NACK[2:]):
        capture.serial(part, False)
    request, first, second, third, last = packets(capture, "-2")
    assert request["motorlink.st.response_in"] == ["4"]
    for part in (first, second):
        assert part["motorlink.st.whole_in"] == ["4"] and not part["motorlink.st.incomplete"]
    assert third["motorlink.st.reg.speed_meas"] == ["1500"] and third["motorlink.st.value"] == ["1500"]
    assert third["motorlink.st.response_to"] == ["1"] and third["motorlink.st.whole_in"] == ["5"]
    assert last["motorlink.st.error"] == ["0x0a"] and last["motorlink.st.unasked"] == [""]


def test_damage_is_shown_where_it_is(packets, tshark):
    capture = Capture(RTAC_SERIAL)
    capture.serial(GET_SPEED, True)
    capture.serial(b"\x55\x03" + SPEED_1500, False)
    capture.serial(GET_SPEED[:-1] + b"\x00", True)
    capture.serial(b"\x02\xff\xff" + GET_SPEED, True)
    capture.serial(SPEED_1500[:4] + b"\x06" + SPEED_1500[5:], False)
    capture.serial(GET_SPEED, True)
    capture.serial(b"\x10" + SPEED_1500[:3] + SPEED_1500, False)
    capture.serial(b"\x00\x00\x00", True)
    capture.serial(b"\x02\x04" + GET_SPEED + GET_SPEED, True)
    noise, bad_request, bad_length, bad_reply, _, twice, zeros, swallowed = packets(capture, "-2")[1:]
    assert noise["motorlink.st.stray"] == ["55:03"] and noise["motorlink.st.value"] == ["1500"]
    assert noise["motorlink.st.response_to"] == ["1"]
    assert bad_request["motorlink.st.bad_checksum"] == [""] and bad_request["motorlink.st.checksum.status"] == ["0"]
    assert bad_request["motorlink.st.checksum.calculated"] == ["0x21"]
    assert not bad_request["motorlink.st.response_in"] and not bad_request["motorlink.st.register"]
    assert bad_length["motorlink.st.stray"] == ["02:ff:ff"] and bad_length["motorlink.st.register"] == ["0x1e"]
    assert bad_reply["motorlink.st.bad_checksum"] == [""] and not bad_reply["motorlink.st.value"]
    assert twice["motorlink.st.stray"] == ["10:f0:04:dc"]
    assert twice["motorlink.st.value"] == ["1500"] and twice["motorlink.st.response_to"] == ["6"]
    assert zeros["motorlink.st.unknown_code"] == [""] and zeros["motorlink.st.checksum.status"] == ["1"]
    # A wrong length does not swallow the frames behind it.
    assert swallowed["motorlink.st.stray"] == ["02:04"] and swallowed["motorlink.st.register"] == ["0x1e"] * 2
    info = tshark(capture, "-T", "fields", "-e", "_ws.col.Info").splitlines()
    assert info[1] == "< 2 bytes that are no frame | < ACK 1500 rpm"
    assert info[2] == "> bad checksum 0x00 instead of 0x21"


def test_a_reply_that_may_answer_several_requests_has_no_value(packets, tshark):
    """The same cases as those of `motorlink decode`."""
    speed, reference, status = (frame(0x22, bytes([register])) for register in (0x1E, 0x04, 0x02))
    configure = [frame(0x2E, bytes([0, register])) for register in (0x1E, 0x04)]
    reply, short, done = (frame(0xF0, data) for data in (bytes([7, 0, 0, 0]), b"\0", b""))
    segment = frame(0x2D, b"\0")
    line = Capture(RTAC_SERIAL)
    texts = []

    def exchange(data, text=None, after_ms=1):
        line.serial(data, data[0] != 0xF0, after_ms=after_ms)
        texts.append(text)

    doubtful = "< ACK, 4 bytes, to one of several requests"
    # A retry: two replies may come.
    exchange(speed), exchange(speed), exchange(reply, "< ACK 7 rpm")
    exchange(reference), exchange(reply, doubtful), exchange(reply, "< ACK 7 rpm")
    # Each reply may be that of the request before.
    exchange(speed), exchange(reference), exchange(reply, doubtful)
    exchange(speed), exchange(reply, doubtful)
    exchange(speed, after_ms=1001), exchange(reference), exchange(speed), exchange(reply, doubtful)
    # The size tells it.
    exchange(status), exchange(short, "< ACK IDLE")
    # No reply comes after a second.
    exchange(reference), exchange(speed, after_ms=1001), exchange(reply, "< ACK 7 rpm")
    exchange(configure[0]), exchange(done, "< ACK"), exchange(segment), exchange(reply, "< ACK SPEED_MEAS 7 rpm")
    exchange(frame(0x23, b"\x07")), exchange(configure[1]), exchange(done, "< ACK")
    exchange(segment, after_ms=1001), exchange(reply, "< ACK, 4 bytes")
    info = tshark(line, "-T", "fields", "-e", "_ws.col.Info").splitlines()
    assert [text if text is None else shown for text, shown in zip(texts, info)] == texts
    for fields, text in zip(packets(line, "-2"), texts):
        if text == doubtful:
            assert fields["motorlink.st.doubtful"] == [""] and not fields["motorlink.st.response_to"]
            assert not fields["motorlink.st.value"] and not fields["motorlink.st.unasked"]


def test_a_length_over_128_begins_no_frame(packets):
    serial = Capture(RTAC_SERIAL)
    for length in (128, 129):
        serial.serial(frame(0x01, b"\x08" + bytes(length - 1)), True)
    # The length is wrong: the dissector does not wait for more bytes.
    serial.serial(bytes.fromhex("0181"), True, after_ms=1001)
    longest, longer, begun = packets(serial, preferences=ALL_ST)
    assert longest["motorlink.st.length"] == ["128"] and longest["motorlink.st.checksum.status"] == ["1"]
    assert not longer["motorlink.st.checksum.status"] and longer["motorlink.st.no_frame"] == [""]
    assert begun["motorlink.st.stray"] == ["01:81"] and not begun["motorlink.st.incomplete"]


def test_a_request_that_is_too_short_says_what_a_drive_answers(tshark):
    serial, expected = Capture(RTAC_SERIAL), []
    for code, payload, name, answer in (
        (1, b"", "SET_REG", "WRONG_SET"),
        (2, b"", "GET_REG", "GET_WRITE_ONLY"),
        (3, b"", "EXECUTE_CMD", "WRONG_CMD"),
        (7, bytes(5), "SET_RAMP", "WRONG_SET"),
        (8, b"", "GET_REVUP_DATA", "WRONG_SET"),
        (9, bytes(8), "SET_REVUP_DATA", "WRONG_SET"),
        (10, bytes(3), "SET_CURRENT_REF", "WRONG_SET"),
    ):
        serial.serial(frame(0x20 | code, payload), True)
        expected.append(f"> {name}, too short, motor 1\tthe payload is too short: a drive answers {answer}")
    out = tshark(serial, "-T", "fields", "-e", "_ws.col.Info", "-e", "_ws.expert.message", preferences=ALL_ST)
    assert out.splitlines() == expected


def test_a_packet_of_noise_is_searched_once(packets):
    """If the rest of the packet was searched for each broken frame, this would take minutes."""
    serial = Capture(RTAC_SERIAL)
    serial.serial(bytes.fromhex("010005") * 20_000, True)
    serial.serial(GET_SPEED, True)
    noise, behind = packets(serial, preferences=ALL_ST)
    assert len(noise["motorlink.st.bad_checksum"]) == 20_000 and behind["motorlink.st.register"] == ["0x1e"]


def test_no_byte_of_a_line_is_left_out(tshark):
    """Frames, parts of frames and stray bytes are together the bytes of each packet."""
    numbers = random.Random(7)
    serial = Capture(RTAC_SERIAL)
    sizes = []
    for _ in range(600):
        data = numbers.choice([GET_SPEED, SPEED_1500, NACK, numbers.randbytes(4)])
        data = data[: numbers.randint(1, 8)] + numbers.choice([b"", GET_SPEED, SPEED_1500])
        sizes.append(len(data))
        serial.serial(data, numbers.random() < 0.5)
    for passes in ((), ("-2",)):
        out = tshark(serial, "-T", "jsonraw", "-J", "motorlink.st", *passes, preferences=ALL_ST)
        found = json.loads(out, object_pairs_hook=lambda pairs: pairs)
        for number, (packet, size) in enumerate(zip(found, sizes), 1):
            layers = dict(dict(packet)["_source"])["layers"]
            shown = [value for name, value in layers if name == "motorlink.st_raw"]
            # A frame that ends in this packet has the bytes of the packets before, too.
            places = [(place[1], place[2]) for place in shown]
            assert sum(place[1] for place in places) == size, (number, places)
