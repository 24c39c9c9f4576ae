"""`motorlink.read`: recordings as arrays, compared with what the package `mcap` reads and with the motors."""

from __future__ import annotations

import errno
import importlib
import signal
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import motorlink
from conftest import REPOSITORY, Served
from motorlink.errors import InvalidValueError, RecordingError, RecordingWarning

sys.path.append(str(REPOSITORY / "tests" / "e2e"))
recordings: Any = importlib.import_module("recordings")

START = recordings.START


def decoded(path: Path, topic: str) -> list[Any]:
    """The messages of a topic, as other people's tools read them."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [message for _, _, _, message in reader.iter_decoded_messages(topics=[topic])]


def nanoseconds(stamp: Any) -> int:
    """A time of a message, ns since 1970."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def recorded(command: str, path: Path, *words: str, seconds: float = 1.0) -> None:
    """Records with the command line."""
    words = ("-o", str(path), "--duration", f"{seconds}s", "--timeout", "2s", *words)
    done = subprocess.run([command, "record", *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Two motors for two seconds, with an outage of one and events."""
    path = tmp_path / "short.mcap"
    recordings.short(path)
    return path


def test_all_that_others_read_is_in_the_arrays(command: str, served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with motorlink.rmd.open(served.can, timeout=2.0, on_close="nothing") as bus:
        bus.motor(1).set_position(90, wait=True)
    recorded(command, path, "-p", served.st, "-p", served.can, "--id", "1,2", "--rate", "50", seconds=2)
    run = motorlink.read(path)
    topics = {f"/{name}" for name in run}
    assert topics == {
        f"/{motor}/signals{rate}"
        for motor in ("st0/motor1", "st0/motor2", "can0/motor1", "can0/motor2")
        for rate in ("", "_2_hz")
    }
    for name, table in run.items():
        messages = decoded(path, table.topic)
        # A busy machine may have no confirmed row of the slower signals.
        assert len(messages) == len(table.time_ns) >= (not name.endswith("hz")), name
        assert list(table.time_ns) == [nanoseconds(message.stamp) for message in messages]
        assert list(table.span_s) == [message.span_s for message in messages]
        assert list(table)[0] == "t" and table.units["t"] == "s"
        assert np.array_equal(table["t"], (table.time_ns - run.start_ns) / 1e9)
        for signal_name in list(table)[1:]:
            values = [getattr(message, signal_name.lower()) for message in messages]
            assert np.array_equal(table[signal_name], values, equal_nan=True), signal_name
            assert table[signal_name].dtype == np.float64
    frames = run.frames("can0")
    others = decoded(path, "/can0/frames")
    assert [frame.data for frame in frames] == [bytes(frame.data) for frame in others]
    assert list(frames.id) == [frame.id for frame in others]
    assert list(frames.time_ns) == [nanoseconds(frame.stamp) for frame in others]
    assert {(frame.direction, frame.result) for frame in frames} == {("SENT", "FRAME"), ("RECEIVED", "FRAME")}
    assert frames[0].direction == "SENT" and frames[0].id == 0x141 and frames[-1].t == frames.t[-1]
    assert {frame.result for frame in run.frames("st0")} >= {"FRAME", "NACK"}
    assert run.lines == ["can0", "st0"]
    with pytest.raises(InvalidValueError, match="its lines are 'can0', 'st0'"):
        run.frames()
    with pytest.raises(IndexError):
        frames[10**9]
    logs = decoded(path, "/events")
    assert [event.message for event in run.events] == [log.msg for log in logs]
    # Settings of the recording can be restored.
    settings = run.drives[0].settings
    with motorlink.st.open(served.st, timeout=2.0) as client:
        client.motor(1).set("SPEED_KP", client.motor(1).get("SPEED_KP") + 7)
        assert settings and [one.name for one in client.motor(1).settings.restore(settings)] == ["SPEED_KP"]
    # The file is open: its name may go.
    path.unlink()
    assert len(run.frames("st0")) > 10
    # The truth of the motors.
    truth = served.motor("rmd", 1)
    motor = run["can0/motor1"]
    assert motor["multi_turn_angle_degrees"][-1] == pytest.approx(truth["angle_degrees"], abs=0.2)
    assert motor.units["multi_turn_angle_degrees"] == "°"
    assert set(run["st0/motor1/signals_2_hz"]["BUS_VOLTAGE"]) <= {325.0}
    assert [drive.name for drive in run.drives] == [
        "st0/motor1",
        "st0/motor2",
        "can0/motor1",
        "can0/motor2",
    ]
    drive = run.drives[0]
    assert (drive.label, drive.protocol, drive.profile, drive.motor) == ("st0", "st", "spec", 1)
    assert drive.port == f"serial:{served.st}" and drive.identity and run.drives[2].profile is None
    assert run.about["format"] == "1" and run.lost is None and run.lost_bytes == 0


def test_each_rate_is_a_table_and_times_begin_together(short: Path) -> None:
    run = motorlink.read(str(short))
    assert list(run) == ["st0/motor1/signals", "st0/motor1/signals_2_hz", "can0/motor2/signals"]
    motor, slow = run["st0/motor1"], run["/st0/motor1/signals_2_hz"]
    assert motor is run["st0/motor1/signals"] and "st0/motor1" in run and "st1/motor1" not in run
    assert motor.units == {"t": "s", "SPEED_MEAS": "rpm", "STATUS": ""}
    assert (motor["t"][0], slow["t"][0]) == (0.0, 0.0005) and run.start_ns == START
    assert list(slow["BUS_VOLTAGE"]) == [24.0, 24.5, 25.0, 25.5]
    assert motor.time_ns.view("datetime64[ns]")[0] == np.datetime64(START, "ns")
    with pytest.raises(KeyError, match=r"run\['st0/motor1/signals_2_hz'\] has it"):
        motor["BUS_VOLTAGE"]
    with pytest.raises(KeyError, match="has no signal SPEED; it has t, SPEED_MEAS, STATUS"):
        motor["SPEED"]
    with pytest.raises(KeyError, match="has no signals of st1/motor1; it has st0/motor1/signals,"):
        run["st1/motor1"]
    samples = motor.samples
    assert samples.dtype.names == ("t", "SPEED_MEAS", "STATUS")
    assert np.array_equal(samples["SPEED_MEAS"], motor["SPEED_MEAS"])
    assert [(event.kind, event.t) for event in run.events] == [("commanded", 0.0), ("lost", 0.8), ("back", 1.2)]
    assert run.events[1].name == "st0" and run.events[1].severity == "INFO" and run.events[0].by == "test"
    assert [name for name, _ in run.metadata] == ["motorlink", "drive", "drive"]


class Frame:
    """The part of pandas that is used."""

    def __init__(self, columns: dict[str, Any]):
        self.columns = columns

    def set_index(self, name: str) -> dict[str, Any]:
        """The columns; the index is one of them."""
        assert name == "t"
        return self.columns


def test_pandas_has_a_column_for_each_signal(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = motorlink.read(short)
    plain, pandas = importlib.import_module, types.SimpleNamespace(DataFrame=Frame)
    chosen = {"pandas": pandas}
    monkeypatch.setattr(importlib, "import_module", lambda name: chosen.get(name) or plain(name))
    columns = run.to_pandas()
    assert list(columns) == [
        "t",
        "st0/motor1/SPEED_MEAS",
        "st0/motor1/STATUS",
        "st0/motor1/BUS_VOLTAGE",
        "can0/motor2/speed",
    ]
    assert (np.diff(columns["t"]) >= 0).all()
    volts = columns["st0/motor1/BUS_VOLTAGE"]
    assert list(volts[~np.isnan(volts)]) == [24.0, 24.5, 25.0, 25.5]
    assert list(columns["t"][~np.isnan(volts)]) == list(run["st0/motor1/signals_2_hz"]["t"])
    assert list(run["can0/motor2"].to_pandas()) == ["t", "speed"]
    assert list(motorlink.to_pandas(run["can0/motor2"].samples)) == ["t", "speed"]


def test_without_pandas_the_error_names_the_package(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    run = motorlink.read(short)
    for has_signals in (run, run["can0/motor2"]):
        with pytest.raises(ImportError, match="pip install pandas"):
            has_signals.to_pandas()


def test_a_file_that_was_cut_gives_what_is_before_the_cut(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    recordings.short(path, chunk=1024)
    whole, content = motorlink.read(path), path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.warns(RecordingWarning, match=r"cut\.mcap is not whole: "):
        run = motorlink.read(path)
    assert run.lost is not None
    for name, table in run.items():
        rows = len(table.time_ns)
        assert 0 < rows < len(whole[name].time_ns)
        for column, values in table.items():
            assert np.array_equal(values, whole[name][column][:rows]), (name, column)


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    for content, why in ((b"", "the file is empty"), (b"t,speed\n" * 99, "this is no MCAP file")):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=why) as refused:
            motorlink.read(path)
        assert refused.value.path == path and refused.value.errno is None
    with pytest.raises(RecordingError, match="No such file") as refused:
        motorlink.read(tmp_path / "other.mcap")
    assert refused.value.errno == errno.ENOENT and isinstance(refused.value, OSError)
    with pytest.raises(RecordingError) as refused:
        motorlink.read(tmp_path)
    assert refused.value.errno == errno.EISDIR
    with pytest.raises(TypeError):
        motorlink.read(3)  # type: ignore[arg-type]


def test_messages_that_are_not_of_their_type_are_told(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    out = recordings.Recording(path)
    out.signals("/st0/motor1/signals", SPEED_MEAS="rpm")
    out.row("/st0/motor1/signals", 0, 1)
    out.add("/st0/motor1/signals", 1, 0.001)
    out.finish()
    with pytest.warns(RecordingWarning, match="1 messages are not of the type of their topic") as told:
        run = motorlink.read(path)
    assert list(run["st0/motor1"]["SPEED_MEAS"]) == [1.0]
    # The warning is that of the line which reads the file.
    assert told[0].filename == __file__


def test_a_recording_without_rows_has_empty_columns(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    out = recordings.Recording(path)
    out.signals("/st0/motor1/signals", SPEED_MEAS="rpm")
    out.drive()
    out.finish()
    run = motorlink.read(path)
    assert run["st0/motor1"]["SPEED_MEAS"].shape == run["st0/motor1"]["t"].shape == (0,)
    assert run.start_ns == 0 and run.drives[0].settings is None
    assert "0 rows: SPEED_MEAS" in repr(run["st0/motor1"])


def test_ctrl_c_ends_the_reading(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recordings.short(path)
    program = """
import signal, sys, threading, motorlink
motorlink.read(sys.argv[1])
threading.Timer(0.05, signal.raise_signal, [signal.SIGINT]).start()
try:
    while True:
        motorlink.read(sys.argv[1])
except KeyboardInterrupt:
    print("interrupted")
"""
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "interrupted\n"), done.stderr
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
