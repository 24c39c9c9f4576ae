"""`info`, `recover`, `convert` and `plot`: recordings that are whole, broken, and written by others."""

import csv
import io
import json
import math
import struct
from xml.etree import ElementTree

import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import CompressionType
from recordings import START, TOML, Recording, short
from test_printed_text import HOSTILE, is_clean, is_shown


@pytest.fixture
def path(tmp_path):
    """A small recording of two motors."""
    short(tmp_path / "run.mcap")
    return tmp_path / "run.mcap"


@pytest.fixture
def cut(path):
    """The same without its last third."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    return path


def messages(path):
    """All messages as the package `mcap` reads them: topic, time, content."""
    with open(path, "rb") as file:
        read = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in read]


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def texts(picture):
    return [(text.text or "").strip() for text in ElementTree.fromstring(picture).iter() if text.tag.endswith("text")]


def test_info_says_what_is_in_a_recording(run, path):
    text = run("info", path).ended(0).out
    for part in [
        "from 2026-09-21T14:13:20.000Z to 2026-09-21T14:13:21.991Z",
        "st0/motor1 at serial:./st0, st\n             board\n",
        "motorlink record",
        "SPEED_MEAS [rpm]  STATUS\n",
        "1 commanded, 1 lost, 1 back",
        "lost       nothing",
    ]:
        assert part in text
    info = run("info", path, "--json").ended(0).json
    topics = {topic["topic"]: topic for topic in info["topics"]}
    assert topics["/can0/motor2/signals"]["messages"] == 200
    assert topics["/can0/motor2/signals"]["rate"] == {"value": 100.0, "unit": "Hz"}
    assert topics["/st0/motor1/signals"]["signals"] == [{"name": "SPEED_MEAS", "unit": "rpm"}, {"name": "STATUS"}]
    assert info["drives"][0]["identity"] == "board" and info["messages"] == len(messages(path))
    events = run("info", path, "--events", "--json").ended(0).lines
    assert [event["event"] for event in events] == ["commanded", "lost", "back"]
    assert events[1]["time"] == "2026-09-21T14:13:20.800Z"


def test_info_says_what_the_recorder_lost(run, tmp_path):
    path = tmp_path / "run.mcap"
    recording = Recording(path)
    recording.signals("/st0/motor1/signals", SPEED_MEAS="rpm")
    recording.row("/st0/motor1/signals", 0, 1)
    for name, kind, message in [
        ("recorder", "lost_records", "12 messages are lost here: this program or the disk was too slow"),
        ("st0", "lost_records", "3 messages are lost here: this program or the disk was too slow"),
        ("st0", "unconfirmed", "2 rows are left out here: nothing confirms their values"),
        ("st0", "lost_records", "many"),
    ]:
        recording.event(0.1, kind, name, message)
    recording.finish()
    text = run("info", path).ended(0).out
    assert "lost       15 messages in recorder, st0: the recorder or its disk was too slow" in text
    assert "           2 rows of st0: nothing confirmed their values" in text
    info = run("info", path, "--json").ended(0).json
    assert (info["lost_messages"], info["unconfirmed_rows"]) == (15, 2) and "lost" not in info


def test_info_prints_the_settings_of_a_motor(run, path):
    assert run("info", path, "--settings", "st0/motor1").ended(0).out == TOML
    assert run("info", path, "--settings", "st0/motor1", "--json").ended(0).json["settings"] == TOML
    message = run("info", path, "--settings", "st0/motor3").ended(2).err
    assert "no settings of `st0/motor3`" in message and "`can0/motor2`" in message


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def test_a_repaired_file_is_read_by_others_and_has_all_that_was_whole(run, tmp_path, compression):
    path, new = tmp_path / "run.mcap", tmp_path / "run.recovered.mcap"
    short(path, compression=compression)
    whole, content = messages(path), path.read_bytes()
    assert run("recover", path).ended(0).out.startswith(f"whole      {len(whole)} messages in 1.991 s")
    assert not new.exists(), "a whole file needs no copy"
    for end in (1000, len(content) // 2):
        path.write_bytes(content[:end])
        done = run("recover", path, "--force", "--json").ended(4)
        told, error = done.json, json.loads(done.err)
        assert error["error"]["kind"] == "lost" and error["exit"] == 4
        got = messages(new)
        assert got == whole[: len(got)] and told["messages"] == len(got)
        assert told["lost"]["bytes"] < 5000 and told["file"] == str(new)
        with pytest.raises(McapError):
            messages(path)
        with open(new, "rb") as file:
            reader = make_reader(file)
            assert reader.get_header().profile == "ros2"
            recovered = [it.metadata for it in reader.iter_metadata() if it.name == "recovered"]
            assert recovered[0]["messages"] == str(len(got))
            assert [it.name for it in reader.iter_attachments()] == ["st0_motor1.toml", "can0_motor2.toml"]
    assert run("recover", new).ended(0).out.startswith("whole")


def test_what_is_damaged_is_left_out_counted_and_said(run, path):
    whole, original = messages(path), path.read_bytes()
    content = bytearray(original)
    with open(path, "rb") as file:
        middle = make_reader(file).get_summary().chunk_indexes[1]
    content[middle.chunk_start_offset + middle.chunk_length // 2] ^= 1
    path.write_bytes(content)
    done = run("recover", path, "--json").ended(4)
    lost = done.json["lost"]
    assert done.json["messages"] + lost["messages"] == len(whole) and lost["messages"] > 0
    new = path.with_name("run.recovered.mcap")
    got = messages(new)
    assert len(got) == done.json["messages"] and set(got) < set(whole)
    # A damaged fact, and a damaged index, which costs no message.
    path.write_bytes(original.replace(b"serial:./st0", b"serial:./st1"))
    assert "changed that have no checksum of their own" in run("info", path).ended(0).out
    content = bytearray(original)
    for offset in middle.message_index_offsets.values():
        content[offset + 20] ^= 1
    path.write_bytes(content)
    assert "an index is missing or wrong; no message was lost" in run("recover", path, "--force").ended(4).err
    assert messages(new) == whole


def test_nothing_is_overwritten_unasked(run, cut):
    new = cut.with_name("run.recovered.mcap")
    new.write_text("mine")
    message = run("recover", cut).ended(2).err
    assert "run.recovered.mcap` exists; nothing was written" in message and "--force" in message
    assert new.read_text() == "mine"
    run("recover", cut, "-o", new, "--force").ended(4)
    assert messages(new)
    run("convert", cut, new).ended(2)
    message = run("recover", cut, "-o", cut, "--force").ended(2).err
    assert "is the same file as" in message and "which is read" in message


def test_reading_commands_read_a_broken_file_and_say_so(run, cut, tmp_path):
    said = "run.mcap is not whole: the file ends inside a record; "
    for command in [
        ("convert", cut, tmp_path / "run.csv"),
        ("plot", cut, "-o", tmp_path / "run.svg"),
        ("info", cut, "--events"),
    ]:
        assert said in run(*command).ended(0).err
    assert "lost       the file ends inside a record" in run("info", cut).ended(0).out
    assert 50 < len(rows((tmp_path / "run.csv").read_text())) < 350
    cut.write_bytes(cut.read_bytes()[:100])
    for command in [("convert", cut, tmp_path / "run.log"), ("decode", "st", cut), ("replay", cut, "--serve", "pty:x")]:
        refused = run(*command).ended(2).err
        assert said in refused and "has no frames; only `motorlink record` writes frames" in refused


@pytest.mark.parametrize("content, what", [(b"", "the file is empty"), (b"t [s],speed\n1,2\n", "this is no MCAP file")])
def test_another_file_is_refused(run, tmp_path, content, what):
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    assert f"cannot read `{path}`: {what}" in run("info", path).ended(2).err
    # A recorder that was killed at once leaves an empty file.
    code, told = (2, f"cannot read `{path}`: {what}") if content else (4, "is empty: its writer ended before")
    assert told in run("recover", path).ended(code).err


def test_a_table_has_a_column_for_each_signal_and_rows_in_the_order_of_time(run, path, tmp_path):
    done = run("convert", path, tmp_path / "run.csv", "--json").ended(0)
    table = rows((tmp_path / "run.csv").read_text())
    names = ["st0/motor1/SPEED_MEAS [rpm]", "st0/motor1/STATUS", "st0/motor1/BUS_VOLTAGE [V]", "can0/motor2/speed [°/s]"]
    assert list(table[0]) == ["t [s]", *names, "event"]
    samples = [row for row in table if not row["event"]]
    assert done.json["rows"] == len(samples) == 161 + 4 + 200
    times = [float(row["t [s]"]) for row in table]
    assert times == sorted(times) and times[0] == 0
    assert [(row["t [s]"], row["event"]) for row in table if row["event"]] == [
        ("0.000000", "commanded st0/motor1"), ("0.800000", "lost st0"), ("1.200000", "back st0")]
    speeds = [(float(row["t [s]"]), float(row[names[0]])) for row in samples if row[names[0]]]
    assert speeds[30] == (0.3, 1530.0) and len(speeds) == 161
    assert max(float(row[names[3]]) for row in samples if row[names[3]]) == 9000
    assert run("convert", path, "-").ended(0).out == (tmp_path / "run.csv").read_text()


def test_one_motor_has_the_columns_of_csv_files(run, path):
    out = run("convert", path, "-", "--signals", "st0/motor1/speed*,STATUS", "--unix").ended(0).out
    table = rows(out)
    assert list(table[0]) == ["unix [s]", "SPEED_MEAS [rpm]", "STATUS", "event"]
    assert table[1]["unix [s]"] == f"{START // 10**9}.000000000" and table[1]["SPEED_MEAS [rpm]"] == "1500"
    message = run("convert", path, "-", "--signals", "SPEEDS").ended(2).err
    assert "has no signal `SPEEDS`" in message and "motorlink info" in message


def test_missing_values_are_empty(run, tmp_path):
    recording = Recording(tmp_path / "run.mcap")
    recording.signals("/st0/motor1/signals", SPEED_MEAS="rpm", STATUS="")
    recording.row("/st0/motor1/signals", 0, math.nan, 6)
    recording.row("/st0/motor1/signals", 0.01, 0.1 + 0.2, math.nan)
    recording.finish()
    out = run("convert", tmp_path / "run.mcap", "-").ended(0).out
    assert out.splitlines()[1:] == ["0.000000,,6,", "0.010000,0.30000000000000004,,"]


def test_a_name_without_a_format_is_refused(run, path, tmp_path):
    assert "a name that ends in .csv" in run("convert", path, tmp_path / "run.xls").ended(2).err
    assert "plot writes SVG and PNG, not PDF" in run("plot", path, "-o", tmp_path / "run.pdf").ended(2).err
    assert not list(tmp_path.glob("run.[xp]*"))


def test_a_picture_has_signals_by_unit_events_and_gaps(run, path, tmp_path):
    done = run("plot", path, "-o", tmp_path / "run.svg").ended(0)
    assert done.out == f"{tmp_path / 'run.svg'} has 4 signals\n"
    picture = (tmp_path / "run.svg").read_text()
    shown = texts(picture)
    for text in ["Speed (rpm)", "Voltage (V)", "Speed (°/s)", "States", "lost st0", "back st0", "RUN", "IDLE"]:
        assert text in shown, shown
    only = run("plot", path, "-o", "-", "--signals", "SPEED_MEAS").ended(0).out
    assert "Speed (rpm)" in texts(only) and "Voltage (V)" not in texts(only)
    # The line of the motor that was lost has two parts; its colour is that of speeds.
    lines = [line for line in ElementTree.fromstring(only).iter() if line.tag.endswith("polyline")]
    speeds = [line for line in lines if line.get("stroke") == "#0072B2"]
    assert len([line for line in speeds if len(line.get("points").split()) > 10]) == 2


def test_a_picture_is_a_png_if_its_name_says_so(run, path, tmp_path):
    run("plot", path, "-o", tmp_path / "run.png").ended(0)
    svg = ElementTree.fromstring(run("plot", path, "-o", "-").ended(0).out)
    png = (tmp_path / "run.png").read_bytes()
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", png[16:24]) == (2 * int(svg.get("width")), 2 * int(svg.get("height")))


def test_a_part_of_the_time_is_drawn(run, path):
    picture = run("plot", path, "-o", "-", "--signals", "can0/*", "--from", "0.7", "--to", "0.85").ended(0).out
    assert "run.mcap, 2026-09-21T14:13:20.700Z" in " ".join(texts(picture))
    refused = run("plot", path, "-o", "-", "--from", "7").ended(2).err
    assert "no sample is after 7 s: the last one is at 1.991 s" in refused
    refused = run("plot", path, "-o", "-", "--from", "1", "--to", "0.5").ended(2).err
    assert "--to 0.5 is before --from 1" in refused


def test_texts_of_a_recording_are_shown_without_control_characters(run, tmp_path):
    path = tmp_path / "run.mcap"
    recording = Recording(path)
    recording.drive("st0", 1, identity=HOSTILE)
    recording.writer.add_metadata("motorlink", {"version": HOSTILE, "command": HOSTILE})
    for topic in (f"/st0/{HOSTILE}", "/" + 100_000 * "a"):
        recording.topic(topic, "other/msg/Type", "int32 x\n")
    recording.signals("/st0/motor1/signals", **{"SPEED_MEAS": "\x1b[2Jrpm", "\u202eREF": "rpm"})
    recording.row("/st0/motor1/signals", 0, 1, 2)
    recording.row("/st0/motor1/signals", 0.1, 1, 2)
    recording.event(0.05, HOSTILE, "st0/motor1", HOSTILE, HOSTILE)
    recording.finish()
    for command in [("info", path), ("info", path, "--events"), ("info", path, "--json"), ("convert", path, "-")]:
        done = run(*command).ended(0)
        assert is_clean(done.out) and is_clean(done.err), done.out
    picture = run("plot", path, "-o", "-", "--title", HOSTILE).ended(0).out
    assert all(is_shown(text) for text in texts(picture))


def test_names_of_lines_and_settings_are_shown_without_control_characters(run, tmp_path):
    path, log = tmp_path / "run.mcap", tmp_path / "run.log"
    recording = Recording(path)
    line = {"label": HOSTILE, "port": HOSTILE, "protocol": "rmd"}
    recording.topic("/can0/frames", "motorlink/msg/Frame", "uint8 direction\n", line)
    status = [(1, 0x9C), *[(1, 0)] * 7]
    recording.add("/can0/frames", 0, (1, 0), (4, 0x141), (1, 0), (4, len(status)), *status)
    text = f"[settings]\n# {HOSTILE}\n".encode()
    recording.writer.add_attachment(START, START, "st0_motor1.toml", "application/toml", text)
    recording.finish()
    for command in [("decode", "rmd", path), ("convert", path, log)]:
        done = run(*command).ended(0)
        assert is_clean(done.out) and is_clean(done.err), done.out
    assert is_clean(log.read_text())
    assert is_shown(run("info", path, "--settings", "st0/motor1").ended(0).out)


def test_values_of_any_size_are_drawn(run, tmp_path):
    path = tmp_path / "run.mcap"
    recording = Recording(path)
    recording.signals("/st0/motor1/signals", SPEED_MEAS="rpm")
    for number, value in enumerate([math.inf, -math.inf, 1.7e308, -1.7e308, 5e-324, 3.4e38, -3.4e38]):
        recording.row("/st0/motor1/signals", number / 10, value)
    recording.finish()
    assert "Speed (rpm)" in texts(run("plot", path, "-o", "-").ended(0).out)


def test_a_full_disk_is_said(run, path):
    message = run("convert", path, "/dev/full").ended(3).err
    assert "cannot write `/dev/full`: No space left" in message
