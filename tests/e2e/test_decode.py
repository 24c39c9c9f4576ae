"""`motorlink decode`: captures of other programs, pipes, damage, exit codes."""

import csv
import io
import struct
import subprocess

import can
import pytest

from program import eventually

READ = "141#9A00000000000000"
STATUS = "141#9A1900F000000009"
ASK, REPLY = "22 01 1e 41", "f0 04 ce 07 00 00 ca"


def log(*frames, direction=""):
    """A log of `candump -L` with a frame per millisecond."""
    lines = [f"(1436509053.{n:03}000) can0 {frame}{direction}" for n, frame in enumerate(frames)]
    return "\n".join(lines) + "\n"


def test_frames_from_the_command_line_are_decoded(run):
    out = run("decode", "rmd", STATUS).ended(0).out
    assert out.startswith(f"<- {STATUS} motor 1 < 0x9A ") and "voltage 24.0 V" in out
    assert run("decode", "rmd", "--id", 1, *"9a 19 00 f0 00 00 00 09".split()).ended(0).out == out
    # Alone it may be a reply of zeros, too.
    either = run("decode", "rmd", READ).ended(0).out
    assert either.startswith(f"-- {READ} motor 1 ? ") and "request, or reply temperature 0" in either
    request = run("decode", "rmd", "--direction", "request", READ).ended(0).out
    assert request.startswith(f"-> {READ} motor 1 > ")
    out = run("decode", "st", *ASK.split(), *REPLY.split()).ended(0).out.splitlines()
    assert [line[:2] for line in out] == ["->", "<-"]
    assert "GET_REG SPEED_MEAS, motor 1" in out[0] and "ACK 1998 rpm" in out[1]


def test_the_format_is_found_by_the_content_of_a_file_or_of_stdin(run, tmp_path):
    path, text = tmp_path / "a", " (1436509053.000000)  can0  141   [8]  9A 19 00 F0 00 00 00 09\n"
    path.write_text(text)
    for done in (run("decode", "rmd", path), run("decode", "rmd", stdin=text), run("decode", "rmd", "-", stdin=text)):
        assert "motor 1 < 0x9A" in done.ended(0).out
        assert "1 frame: 0 requests, 1 reply" in done.err
    wrong = run("decode", "rmd", "--format", "asc", stdin=log(STATUS)).ended(1)
    assert "!! entry 1: not a line of an asc file" in wrong.out


def test_a_pipe_is_followed_line_by_line(start):
    for words, line, said in (
        ("decode rmd", log(STATUS), "motor 1 < 0x9A"),
        ("decode st --json", f"{ASK}\n", '"message":"GET_REG"'),
        ("decode rmd --csv", log(STATUS), "voltage,24.0,V,240"),
    ):
        process = start(*words.split(), stdin=subprocess.PIPE)
        for count in (1, 2, 3):
            process.process.stdin.write(line)
            process.process.stdin.flush()
            eventually(lambda: sum(said in line for line in process.out) == count, f"{count} times {said}")
        process.process.stdin.close()
        assert process.process.wait(20) == 0


def test_damage_is_shown_where_it_is(run):
    text = log(READ, STATUS) + "hello \x1b[2J\nDROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n" \
        + log("20000004#0001000000000000", "7FF#00", "241#9C190000000000FF", "142##1AABB", "142#R")
    done = run("decode", "rmd", stdin=text).ended(1)
    lines = done.out.splitlines()
    assert len(lines) == 9 and "\x1b" not in done.out
    assert [line for line in lines if "!!" in line] == lines[2:5]
    assert "the capture lost 3 frames here" in lines[3] and "problem of the controller" in lines[4]
    assert "V3/V4" in lines[6] and "CAN FD" in lines[7]
    assert "3 entries are damaged or lost, the first one is entry 3" in done.err
    # Other protocols on the bus are no damage.
    run("decode", "rmd", stdin=log("7FF#00", "241#9C190000000000FF")).ended(0)
    broken = run("decode", "st", *"22 01 1e 42 f0".split(), *ASK.split()).ended(1)
    assert "!! 22 01 1E 42" in broken.out.replace("  ", "") and "instead of 0x41" in broken.out
    assert "GET_REG" in broken.out


def test_what_makes_no_sense_is_a_usage_error(run, tmp_path):
    for words, text in (
        ("decode rmd 9a00", "give --id"),
        ("decode rmd nothing-there.log", "cannot read `nothing-there.log`"),
        ("decode rmd 141#xx", "141#xx"),
        ("decode st 022", "not hexadecimal bytes"),
    ):
        assert text in run(*words.split()).ended(2).err
    path = tmp_path / "log.gz"
    path.write_bytes(b"\x1f\x8b\x08\0")
    assert "gunzip" in run("decode", "rmd", path).ended(2).err


def test_json_and_csv_have_the_same_values(run):
    text = log(STATUS, "280#640000009CFFD007", "7FF#00")
    objects = run("decode", "rmd", "--json", stdin=text).ended(0).lines
    rows = list(csv.DictReader(io.StringIO(run("decode", "rmd", "--csv", stdin=text).ended(0).out)))
    pairs = [
        (str(line["entry"]), str(line.get("motor", "")), name, str(value["value"]), str(value["digits"]))
        for line in objects
        for name, value in line.get("values", {}).items()
    ]
    assert pairs == [
        (row["entry"], row["motor"], row["field"], row["value"], row["digits"]) for row in rows if row["field"]
    ]
    assert rows[-1]["message"] == "other" and objects[-1]["other"] == rows[-1]["text"]
    assert all(float(row["time [s]"]) == line for row, line in zip(rows[:1], [objects[0]["wall"]]))


@pytest.mark.parametrize("suffix", [".log", ".asc"])
def test_files_of_python_can_are_read(run, tmp_path, suffix):
    path = tmp_path / f"bus{suffix}"
    messages = [
        can.Message(1436509053.25, 0x141, False, data=bytes.fromhex("9a00000000000000"), is_rx=False, channel=0),
        can.Message(1436509053.26, 0x141, False, data=bytes.fromhex("9a1900f000000009"), is_rx=True, channel=0),
        can.Message(1436509053.27, 0x1ABCDE, True, data=b"\x01", is_rx=True, channel=0),
        can.Message(1436509053.28, 0x141, False, is_remote_frame=True, dlc=8, is_rx=True, channel=0),
        can.Message(1436509053.29, is_error_frame=True, is_rx=True, channel=0),
        can.Message(1436509053.30, 0x300, False, is_fd=True, bitrate_switch=True, data=bytes(12), is_rx=True, channel=0),
    ]
    with can.Logger(path) as logger:
        for message in messages:
            logger(message)
    lines = run("decode", "rmd", "--json", path).ended(1).lines
    assert [line.get("direction") for line in lines[:2]] == ["request", "reply"]
    assert lines[1]["values"]["voltage"] == {"value": 24.0, "unit": "V", "digits": 240}
    assert lines[2]["id"] == 0x1ABCDE and lines[2]["extended"] is True
    assert lines[3]["remote"] is True
    assert "error frame" in lines[4]["damage"]
    assert "CAN FD" in lines[5]["other"] and lines[5]["data"] == " ".join(["00"] * 12)


def test_a_closed_reader_ends_it_quietly(piped, tmp_path):
    path = tmp_path / "long.log"
    path.write_text(log(*[STATUS] * 900) * 50)
    done = piped(f"decode rmd {path}", "| head -n 1").ended(0)
    assert len(done.out.splitlines()) == 1 and not done.err


def block(kind, body, order="<"):
    """A block of a pcapng file."""
    body += bytes(-len(body) % 4)
    length = struct.pack(f"{order}I", len(body) + 12)
    return struct.pack(f"{order}I", kind) + length + body + length


def pcapng(link_type, *packets, order="<"):
    """A file of Wireshark with packets a millisecond apart: bytes, and their direction flag or None."""
    section = struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1)
    interface = struct.pack(f"{order}HHI", link_type, 0, 0) + struct.pack(f"{order}HH4s", 2, 4, b"can0")
    file = block(0x0A0D0D0A, section, order) + block(1, interface, order)
    for n, (data, flags) in enumerate(packets):
        us = 1436509053_000000 + n * 1000
        head = struct.pack(f"{order}IIIII", 0, us >> 32, us & 0xFFFFFFFF, len(data), len(data))
        padded = data + bytes(-len(data) % 4)
        options = b"" if flags is None else struct.pack(f"{order}HHIHH", 2, 4, flags, 0, 0)
        file += block(6, head + padded + options, order)
    return file


@pytest.mark.parametrize("order, link_type, head", [("<", 113, ">HHH8sH"), (">", 276, ">HHIHBB8s")])
def test_a_capture_of_all_interfaces_has_directions(run, tmp_path, order, link_type, head):
    def packet(data, sent, protocol=0x0C):
        kind = 4 if sent else 0
        words = (kind, 280, 0, b"", protocol) if link_type == 113 else (protocol, 0, 3, 280, kind, 0, b"")
        return struct.pack(head, *words) + struct.pack(f"{order}IBBBB", 0x141, 8, 0, 0, 0) + bytes.fromhex(data)

    packets = [packet(READ[4:], True), packet("9a00000000000000", False), packet(READ[4:], True, 0x0800)]
    path = tmp_path / "any.pcapng"
    path.write_bytes(pcapng(link_type, *((data, None) for data in packets), order=order))
    lines = run("decode", "rmd", "--json", path).ended(1).lines
    assert [(line.get("direction"), line.get("known_by"), line.get("id")) for line in lines] == [
        ("request", "log", 0x141), ("reply", "log", 0x141), (None, None, None)
    ]
    assert "neither CAN nor a serial line" in lines[2]["damage"]


def test_packets_of_other_forms_and_lost_packets_are_not_skipped(run, tmp_path):
    path = tmp_path / "bus.pcapng"
    frame = struct.pack(">IBBBB", 0x141, 8, 0, 0, 0) + bytes.fromhex(STATUS[4:])
    old = block(2, struct.pack("<HHIIII", 0, 2, 0, 0, len(frame), len(frame)) + frame)
    simple = block(3, struct.pack("<I", len(frame)) + frame)
    lost = block(5, struct.pack("<III", 0, 0, 0) + struct.pack("<HHQHHQ", 5, 8, 4, 7, 8, 1))
    path.write_bytes(pcapng(227) + old + simple + lost)
    lines = run("decode", "rmd", "--json", path).ended(1).lines
    assert [line.get("message") for line in lines] == [None, "read_status", "read_status", None]
    assert [line["entry"] for line in lines] == [1, 1, 2, 2]
    assert lines[0]["damage"] == "the capture lost 2 frames here"
    assert lines[3]["damage"] == "the capture lost 3 frames somewhere before" and lines[3]["channel"] == "can0"
    # The last bytes of a simple packet are padding if the interface cuts packets.
    cut = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)) + block(1, struct.pack("<HHI", 227, 0, 13))
    path.write_bytes(cut + block(3, struct.pack("<I", len(frame)) + frame[:13]))
    [line] = run("decode", "rmd", "--json", path).ended(1).lines
    assert line["damage"] == "the capture has 13 of the 16 bytes of this packet"
    # A parity error on a serial line.
    path.write_bytes(pcapng(250, (struct.pack(">IIBBH", 0, 0, 8, 0, 0), None)))
    assert "parity error" in run("decode", "st", path).ended(1).out


def test_text_is_read_behind_a_damaged_first_line(run):
    for first, failed in (("\ufeff", 0), ("hello\n", 1)):
        lines = run("decode", "rmd", "--json", stdin=first + log(STATUS)).ended(failed).lines
        assert lines[-1]["message"] == "read_status" and len(lines) == 1 + failed
