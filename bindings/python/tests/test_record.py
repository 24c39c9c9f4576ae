"""`motorlink.record`: recordings of ports and of open clients, and how they end."""

from __future__ import annotations

import asyncio
import errno
import gc
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motorlink
from conftest import PATIENT, Served, eventually
from motorlink import aio, recording, rmd, sim, st
from motorlink.errors import InvalidValueError, PortError, RecordingError, ReplyTimeoutError
from motorlink.recording import Recorder, _record


def is_at_rest(served: Served) -> bool:
    return abs(served.rpm()) < 30


def turn(client: st.Client, rpm: float = 1500) -> None:
    """Starts motor 1."""
    client.motor(1).set_ramp(rpm, 0.1)
    client.motor(1).start()


def recorded(recorder: Recorder, rows: int = 20) -> None:
    """Waits until there are so many more rows."""
    before = recorder.status().rows
    eventually(lambda: recorder.status().rows >= before + rows, "more rows", within=30)


def complete(recorder: Recorder, path: Path) -> recording.Recording:
    """Reads the file once it is complete: while a motor moves, nothing waits for that."""
    eventually(lambda: recorder.status().is_over, "the end of the file")
    run = motorlink.read(path)
    assert run.lost is None
    return run


def program(text: str, *arguments: object, **options: Any) -> subprocess.Popen[str]:
    """Starts a program in Python."""
    head = "import os, signal, sys, threading, time\nimport motorlink\n"
    words = [sys.executable, "-c", head + textwrap.dedent(text), *map(str, arguments)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, **options)


def says(process: subprocess.Popen[str], line: str) -> None:
    """Waits for a line of a program."""
    assert process.stdout
    assert process.stdout.readline() == f"{line}\n"


def test_ports_are_recorded(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    names = ["SPEED_MEAS", "voltage_volts"]
    with motorlink.record(
        [served.st, served.can], path, names, rate=20, timeout=PATIENT, motors=[1], ids=[1, 3], settings=False
    ) as recorder:
        assert recorder.motors == ("st0/motor1", "can0/motor1", "can0/motor3")
        recorded(recorder)
        # On a busy machine a line is in sync later.
        eventually(lambda: not recorder.status().gaps, "values of each motor", within=30)
        status = recorder.status()
        assert status.files == (path,) and not status.is_over and status.lost == 0
        assert status.values == status.rows > 0 and status.frames > 0
    ended = recorder.status()
    assert ended.is_over and ended.bytes == path.stat().st_size and ended.rows >= status.rows
    run = motorlink.read(path)
    assert run.lost is None and sum(len(table.time_ns) for table in run.values()) == ended.rows
    assert run.about["command"] == f"python {sys.argv[0]}"
    assert {name: list(table) for name, table in run.items()} == {
        "st0/motor1/signals": ["t", "SPEED_MEAS"],
        "can0/motor1/signals": ["t", "voltage_volts"],
        "can0/motor3/signals": ["t", "voltage_volts"],
    }
    assert set(run["can0/motor3"]["voltage_volts"]) == {24.0}
    # On a busy machine instants are rarer.
    assert np.median(np.diff(run["st0/motor1"]["t"])) > 0.04
    assert [drive.settings for drive in run.drives] == [None] * 3


def test_a_program_drives_motors_and_records_them(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with st.open(served.st, timeout=PATIENT) as client, rmd.open(served.can, timeout=PATIENT) as bus:
        with motorlink.record([client, bus], path, rate=100, motors=[1], ids=[2]) as recorder:
            assert set(recorder.motors) == {"st0/motor1", "can0/motor2"}
            turn(client)
            bus.motor(2).set_speed(180)
            eventually(lambda: client.motor(1).get("SPEED_MEAS") > 1400, "a motor that turns")
            eventually(lambda: bus.motor(2).motion_status().speed_dps > 170, "a motor that turns")
            recorded(recorder, 40)
            for digits in range(100):
                client.motor(1).set("SPEED_KP", digits)
                assert client.motor(1).get("SPEED_KP") == digits
            client.confirm()
        # The end of the recording does not stop the motors. That of their clients does.
        assert served.rpm() > 1400 and (client.moving, bus.moving) == ([1], [2])
        assert client.motor(1).get("SPEED_MEAS") > 1400
    eventually(lambda: is_at_rest(served), "a motor that stops")
    run = complete(recorder, path)
    motor, other = run["st0/motor1"], run["can0/motor2"]
    assert motor["SPEED_MEAS"][0] == 0 and motor["SPEED_MEAS"].max() == pytest.approx(1500, abs=100)
    assert other["speed_dps"].max() == pytest.approx(180, abs=20)
    assert (np.diff(motor.time_ns) > 0).all()
    frames = run.frames("st0")
    kinds = [frame.data[0] & 0x1F for frame in frames if frame.direction == "SENT"]
    # SET_REG of the program, and its commands, among the requests of the recording.
    assert kinds.count(1) >= 100 and kinds.count(3) >= 1 and len(kinds) > 220
    assert {frame.result for frame in frames} <= {"FRAME", "NACK"}
    assert 0xA2 in {frame.data[0] for frame in run.frames("can0") if frame.direction == "SENT"}


def test_a_client_can_be_sampled_and_recorded_twice(served: Served, tmp_path: Path) -> None:
    with st.open(served.st, timeout=PATIENT) as client:
        before = set(client._segments._sampled)
        with motorlink.record(client, tmp_path / "a.mcap", rate=20, motors=[1]) as one:
            with motorlink.record(client, tmp_path / "b.mcap", ["SPEED_KP"], rate=20, motors=[1]) as other:
                values = client.sample(["SPEED_MEAS", "BUS_VOLTAGE"], rate=20, seconds=0.5, on_error="skip")
                recorded(one)
                recorded(other)
            recorded(one)
        assert set(values["BUS_VOLTAGE"]) == {325.0}
        assert client._segments._sampled == before
    assert len(motorlink.read(tmp_path / "a.mcap").frames()) > len(motorlink.read(tmp_path / "b.mcap").frames())


def test_the_close_of_the_client_stops_motors_at_once_and_ends_its_recording(
    served: Served, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    client = st.open(served.st, timeout=PATIENT)
    with motorlink.record(client, path, rate=100, motors=[1]) as recorder:
        turn(client)
        eventually(lambda: served.rpm() > 1400, "a motor that turns")
        client.close()
        eventually(lambda: is_at_rest(served), "a motor that stops")
        with st.open(served.st, timeout=PATIENT) as other:
            # The recording has left the port.
            other.motor(1).status()
        assert not recorder.status().is_over
    run = motorlink.read(path)
    assert "lost" in {event.kind for event in run.events} and run.lost is None
    assert len(run["st0/motor1"]["t"]) > 0


def test_a_recording_keeps_no_client_from_being_collected(served: Served, tmp_path: Path) -> None:
    client = st.open(served.st, timeout=PATIENT)
    with motorlink.record(client, tmp_path / "run.mcap", rate=100, motors=[1]) as recorder:
        turn(client)
        eventually(lambda: served.rpm() > 1400, "a motor that turns")
        recorded(recorder, 1)
        del client
        gc.collect()
        eventually(lambda: is_at_rest(served), "a motor that stops")


def test_what_cannot_be_recorded_is_refused(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"

    def refused(kind: type[Exception], match: str, source: Any = served.st, **options: Any) -> Any:
        with pytest.raises(kind, match=match) as told:
            motorlink.record(source, options.pop("path", path), **{"timeout": PATIENT, **options})
        assert not path.exists() and "st0" in os.listdir(Path(served.st).parent)
        return told.value

    with st.open(served.st, timeout=PATIENT) as client:
        refused(PortError, "st0")
        refused(InvalidValueError, "SPED", client, signals=["SPED"], motors=[1])
        assert client._segments._sampled == set()
    refused(InvalidValueError, "'SPEED_MEAS' is one name", signals="SPEED_MEAS")
    refused(InvalidValueError, "no port to record", [])
    refused(InvalidValueError, "profile", profile="odd")
    refused(InvalidValueError, "a time between samples", rate=0)
    refused(InvalidValueError, "not both", rotate_size=10**6, rotate_seconds=5)
    refused(InvalidValueError, "9", motors=[9])
    refused(PortError, "nothing", f"{tmp_path}/nothing")
    with st.open(sim.Bench()) as virtual:
        refused(InvalidValueError, "has a time of its own", virtual)
    refused(TypeError, "cannot be recorded", sim.Bench())
    refused(TypeError, "cannot be recorded", 3)
    client.close()
    refused(motorlink.ClosedError, "was closed", client)

    error = refused(RecordingError, "No such file", path=tmp_path / "no" / "run.mcap")
    assert error.errno == errno.ENOENT and error.path == tmp_path / "no" / "run.mcap"


def test_a_client_of_asyncio_is_refused(tmp_path: Path) -> None:
    async def main() -> None:
        async with aio.st.open("sim:") as client:
            with pytest.raises(TypeError, match="give the name of a port, or a blocking client"):
                motorlink.record(client, tmp_path / "run.mcap")  # type: ignore[arg-type]

    asyncio.run(main())


def test_a_silent_line_is_a_timeout(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    try:
        with pytest.raises(ReplyTimeoutError, match="no motor answers at") as told:
            motorlink.record(os.ttyname(theirs), tmp_path / "run.mcap", timeout=0.1)
        assert isinstance(told.value.__cause__, ReplyTimeoutError) and os.listdir(tmp_path) == []
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_file_is_overwritten_with_force_only(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("mine")
    with pytest.raises(RecordingError, match="exists already; give another name, or force=True") as told:
        motorlink.record(served.st, path, timeout=PATIENT)
    assert told.value.errno == errno.EEXIST and path.read_text() == "mine"
    with motorlink.record(served.st, path, timeout=PATIENT, motors=[1], force=True) as recorder:
        recorded(recorder, 1)
    assert motorlink.read(path).lost is None


def test_files_are_rotated_and_limited(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with motorlink.record(
        served.st, path, rate=200, timeout=PATIENT, motors=[1], rotate_size=20_000, max_size=60_000, fsync=0.5
    ) as recorder:
        eventually(lambda: recorder.status().is_over, "a recording that has its size", within=60)
        files = recorder.status().files
    assert [file.name for file in files] == [f"run_{n:03}.mcap" for n in range(len(files))] and len(files) > 1
    runs = [motorlink.read(file) for file in files]
    assert [run.about["part"] for run in runs] == [str(n) for n in range(len(files))]
    assert all(run.lost is None and run.drives[0].settings for run in runs)
    # A second end does nothing.
    recorder.close()
    recorder.close()
    assert "ended" in repr(recorder)


def test_after_an_exception_the_file_is_completed(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with pytest.raises(ZeroDivisionError):
        with motorlink.record(served.st, path, rate=50, timeout=PATIENT, motors=[1]) as recorder:
            # Some of them are rows of the slower signals.
            recorded(recorder, 30)
            raise ZeroDivisionError
    assert len(complete(recorder, path)["st0/motor1"]["t"]) >= 20


def test_the_end_does_not_wait_for_a_slow_disk_while_a_motor_moves(
    served: Served, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
    # The recording has no time to end.
    monkeypatch.setattr("motorlink.recording._record._WITH_MOTORS", 1e-6)
    with st.open(served.st, timeout=PATIENT) as client:
        turn(client)
        with pytest.warns(motorlink.RecordingWarning, match="the disk has not taken .*run.mcap yet"):
            with motorlink.record(client, path, motors=[1]) as recorder:
                recorded(recorder)
        client.motor(1).stop()
    complete(recorder, path)
    # Without a motor that moves it is an error, after some time.
    monkeypatch.setattr("motorlink.recording._record._PATIENCE", 1e-6)
    late = tmp_path / "late.mcap"
    with pytest.raises(RecordingError, match="the disk has not taken .*late.mcap yet"):
        with motorlink.record(served.st, late, timeout=PATIENT, motors=[1]) as recorder:
            recorded(recorder)
    complete(recorder, late)
    # The next recording forgets those that are complete.
    monkeypatch.undo()
    with motorlink.record(served.st, tmp_path / "next.mcap", timeout=PATIENT, motors=[1]):
        assert recorder._core not in _record._ending.values()


def test_a_recording_that_is_forgotten_is_ended(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    recorder = motorlink.record(served.st, path, rate=50, timeout=PATIENT, motors=[1])
    recorded(recorder)
    del recorder
    gc.collect()

    def is_whole() -> bool:
        return path.read_bytes().endswith(b"\x89MCAP0\r\n") and len(path.read_bytes()) > 1000

    eventually(is_whole, "the end of the file")
    assert motorlink.read(path).lost is None


def test_a_disk_that_is_full_ends_the_recording_and_no_motor(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    full = program(
        """
        import errno, resource
        with motorlink.st.open(sys.argv[1], timeout=5.0) as client:
            client.motor(1).set_ramp(1500, 0.1)
            client.motor(1).start()
            try:
                with motorlink.record(client, sys.argv[2], rate=100, motors=[1]) as recorder:
                    resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
                    while not recorder.status().is_over:
                        time.sleep(0.01)
            except motorlink.RecordingError as error:
                assert error.errno == errno.EFBIG and str(error.path) == sys.argv[2], repr(error)
                assert "stays readable" in str(error)
                print(client.motor(1).status(), client.moving, flush=True)
            sys.stdin.readline()
        """,
        served.st,
        path,
        stdin=subprocess.PIPE,
    )
    says(full, "RUN [1]")
    eventually(lambda: served.rpm() > 1400, "a motor that turns")
    full.communicate("\n", timeout=60)
    assert full.returncode == 0
    eventually(lambda: is_at_rest(served), "a motor that stops")
    assert len(motorlink.read(path)["st0/motor1"]["t"]) > 0


def test_a_busy_program_costs_no_row(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    running = program(
        """
        with motorlink.st.open(sys.argv[1], timeout=5.0) as client:
            with motorlink.record(client, sys.argv[2], ["SPEED_MEAS"], rate=100, motors=[1]) as recorder:
                # The interpreter does not change threads during a sum.
                numbers = range(3 * 10**7)
                while (sum(numbers), recorder.status().rows)[1] < 50:
                    pass
        """,
        served.st,
        path,
    )
    running.communicate(timeout=120)
    assert running.returncode == 0
    t = motorlink.read(path)["st0/motor1"]["t"]
    # A recording that waits for Python would have a row a second.
    assert len(t) >= 50 and np.median(np.diff(t)) < 0.1


@pytest.mark.parametrize("ends", ["interrupt", "exit"])
def test_the_end_of_the_program_leaves_a_file_and_no_motor(
    ends: str, served: Served, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    running = program(
        """
        client = motorlink.st.open(sys.argv[1], timeout=5.0)
        recorder = motorlink.record(client, sys.argv[2], rate=100, motors=[1])
        client.motor(1).set_ramp(1500, 0.1)
        client.motor(1).start()
        while recorder.status().rows < 30:
            time.sleep(0.01)
        print("recording", flush=True)
        if sys.argv[3] == "interrupt":
            signal.pause()
        # The interpreter ends while a thread uses both.
        threading.Thread(target=lambda: [recorder.status() for _ in iter(int, 1)], daemon=True).start()
        """,
        served.st,
        path,
        ends,
        stderr=subprocess.DEVNULL,
    )
    says(running, "recording")
    if ends == "interrupt":
        running.send_signal(signal.SIGINT)
    running.communicate(timeout=60)
    assert running.returncode == (-signal.SIGINT if ends == "interrupt" else 0)
    eventually(lambda: is_at_rest(served), "a motor that stops")
    run = motorlink.read(path)
    assert run.lost is None and len(run["st0/motor1"]["t"]) > 5


def test_a_forked_process_has_no_recording(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    running = program(
        """
        import gc
        recorder = motorlink.record(sys.argv[1], sys.argv[2], rate=50, timeout=5.0, motors=[1])
        while recorder.status().rows < 20:
            time.sleep(0.01)
        child = os.fork()
        if child == 0:
            try:
                recorder.status()
            except motorlink.RecordingError as error:
                print(error, flush=True)
            recorder.close()
            del recorder
            gc.collect()
            sys.exit(7)
        _, status = os.waitpid(child, 0)
        assert os.waitstatus_to_exitcode(status) == 7 if hasattr(os, "waitstatus_to_exitcode") else status
        before = recorder.status().rows
        while recorder.status().rows < before + 20:
            time.sleep(0.01)
        recorder.close()
        """,
        served.st,
        path,
    )
    says(running, "another process records, which this one was forked from")
    running.communicate(timeout=60)
    assert running.returncode == 0
    assert motorlink.read(path).lost is None


def test_a_frozen_program_loses_what_it_could_not_read_only(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    running = program(
        """
        with motorlink.record(sys.argv[1], sys.argv[2], rate=50, timeout=5.0, motors=[1]) as recorder:
            while recorder.status().rows < 20:
                time.sleep(0.01)
            print("recording", flush=True)
            sys.stdin.readline()
            rows = recorder.status().rows
            while recorder.status().rows < rows + 20:
                time.sleep(0.01)
        """,
        served.st,
        path,
        stdin=subprocess.PIPE,
    )
    says(running, "recording")
    running.send_signal(signal.SIGSTOP)
    frozen = time.monotonic()
    with pytest.warns(motorlink.RecordingWarning, match="is not whole"):
        assert len(motorlink.read(path)["st0/motor1"]["t"]) > 0
    eventually(lambda: time.monotonic() - frozen > 1, "a second")
    running.send_signal(signal.SIGCONT)
    running.communicate("\n", timeout=60)
    assert running.returncode == 0
    run = motorlink.read(path)
    gaps = np.diff(run["st0/motor1"]["t"])
    # A row may be in the middle: its request was sent before, and its reply was read afterwards.
    assert run.lost is None and gaps.max() > 0.45 and (gaps > 0).all()


def test_a_signal_handler_uses_the_client_while_it_is_recorded(served: Served, tmp_path: Path) -> None:
    stops: list[str] = []
    with st.open(served.st, timeout=PATIENT) as client:

        def stop(number: int, frame: object) -> None:
            client.motor(1).stop()
            stops.append("stopped")

        before = signal.signal(signal.SIGALRM, stop)
        try:
            with motorlink.record(client, tmp_path / "run.mcap", rate=100, motors=[1]) as recorder:
                turn(client)
                eventually(lambda: served.rpm() > 1400, "a motor that turns")
                signal.raise_signal(signal.SIGALRM)
                assert stops == ["stopped"] and client.moving == []
                eventually(lambda: is_at_rest(served), "a motor that stops")
                recorded(recorder, 5)
        finally:
            signal.signal(signal.SIGALRM, before)
