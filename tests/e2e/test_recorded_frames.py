"""The frames of a recording: drives that answer as they did, captures for other programs, their meaning."""

import json

import can
import pytest

from program import PATIENT, serving


@pytest.fixture(scope="module")
def recorded(run, motorlink, tmp_path_factory):
    """A recording of an ST drive and four RMD motors, of which the first turns."""
    folder = tmp_path_factory.mktemp("recorded")
    for drives in serving(motorlink, folder):
        drives = drives()
        run("rmd", "-p", f"slcan:{drives.can}", *PATIENT, "speed", "360").ended(0)
        ports = ("-p", drives.st, "-p", f"slcan:{drives.can}")
        run("record", *ports, *PATIENT, "-o", folder / "run.mcap", "--duration", "2s").ended(0)
    return folder / "run.mcap"


@pytest.fixture
def replay(start, tmp_path):
    """`replay(file, ...)`: `motorlink replay`, and the words that name its ports."""

    def replay(path, *words, lines=("st0", "can0")):
        folder = tmp_path / "replayed"
        folder.mkdir()
        ports = {"st0": f"pty:{folder}/st0", "can0": f"slcan-pty:{folder}/can0"}
        serve = [word for line in lines for word in ("--serve", f"{line}={ports[line]}")]
        program = start("replay", path, *serve, *words)
        announced = [json.loads(program.line(number)) for number in range(len(lines))]
        assert [line["line"] for line in announced] == list(lines)
        assert all(line["requests"] > 10 for line in announced)
        return program, folder / "st0", f"slcan:{folder}/can0"

    return replay


def column(run, path, topic, signal):
    """The values of a signal."""
    out = run("convert", path, "-", "--signals", f"{topic}/{signal}").ended(0).out
    rows = [line.split(",") for line in out.splitlines()[1:]]
    return [float(row[1]) for row in rows if row[1]]


def test_the_program_that_was_recorded_gets_the_same_again(run, recorded, replay, tmp_path):
    _, st, can = replay(recorded, "--speed", "max")
    again = tmp_path / "again.mcap"
    run("record", "-p", st, "-p", can, *PATIENT, "-o", again, "--duration", "1500ms").ended(0)
    for topic, signal in [("can0/motor1", "multi_turn_angle_degrees"), ("st0/motor1", "SPEED_MEAS")]:
        before = column(run, recorded, topic, signal)
        after = column(run, again, topic, signal)
        # On a busy machine either recording may have fewer rows.
        count = min(len(before), len(after))
        assert count > 4 and after[:count] == before[:count]
    angles = column(run, recorded, "can0/motor1", "multi_turn_angle_degrees")
    assert angles[-1] - angles[0] > 90, "the motor turned"


def test_other_programs_read_what_was_recorded(run, recorded, replay):
    program, st, can = replay(recorded)
    found = run("rmd", "-p", can, *PATIENT, "--json", "pid").ended(0)
    assert found.json["values"]
    assert run("st", "-p", st, *PATIENT, "--json", "get", "SPEED_KP").ended(0).values["SPEED_KP"] > 0
    refused = run("st", "-p", st, *PATIENT, "fault-ack").ended(1)
    assert "BAD_FRAME_ID" in refused.err
    program.process.terminate()
    assert program.wait() == 0
    program.says("st0: 22 01 01 24 is not in the recording")
    ends = [json.loads(line) for line in program.out[-2:]]
    assert [end["line"] for end in ends] == ["st0", "can0"]
    assert ends[0]["unknown"] == 1 and ends[0]["recorded"] > 0
    assert ends[1]["unknown"] == 0 and ends[1]["recorded"] > 0


def test_strict_fails_if_a_program_asked_for_more(run, recorded, replay):
    program, st, _ = replay(recorded, "--strict", "--json", lines=("st0",))
    run("st", "-p", st, *PATIENT, "fault-ack").ended(1)
    program.process.terminate()
    assert program.wait() == 1
    errors = [json.loads(line) for line in program.err]
    assert errors[-1]["exit"] == 1
    assert "1 request is not in the recording" in errors[-1]["error"]["message"]


def test_wrong_lines_are_said(run, recorded, tmp_path):
    st, can = f"pty:{tmp_path}/a", f"slcan-pty:{tmp_path}/b"
    for words, said in [
        (["--serve", f"st7={st}"], "the recording has no line st7"),
        (["--serve", f"st0={st}", "--serve", f"st0={can}"], "--serve st0= is given twice"),
        (["--serve", st, "--serve", can, "--serve", st], "more often than lines are recorded"),
    ]:
        error = run("replay", recorded, *words).ended(2).err
        assert said in error and "its lines are can0, st0" in error or "twice" in said, error
    (tmp_path / "text.mcap").write_text("no MCAP")
    assert "cannot read" in run("replay", tmp_path / "text.mcap", "--serve", st).ended(2).err


def decoded(run, protocol, path):
    """What frames of a protocol mean, without their place in the file; and their times."""
    lines = [line for line in run("decode", protocol, path, "--json").ended(0).lines if "message" in line]
    return [{**line, "entry": 0, "wall": 0} for line in lines], [line["wall"] for line in lines]


@pytest.mark.parametrize("ending, reader", [("log", can.CanutilsLogReader), ("asc", can.ASCReader)])
def test_a_bus_is_converted_for_python_can(run, recorded, tmp_path, ending, reader):
    path = tmp_path / f"run.{ending}"
    done = run("convert", recorded, path, "--json").ended(0)
    assert "frames of serial lines are left out: only .pcapng has them" in done.err
    messages = list(reader(str(path)))
    assert len(messages) == done.json["frames"] > 100
    assert {message.arbitration_id for message in messages if message.is_rx} == {0x141, 0x142, 0x143, 0x144}
    assert not all(message.is_rx for message in messages)
    times = [message.timestamp for message in messages]
    assert times == sorted(times)


def test_a_recording_means_what_its_captures_mean(run, recorded, tmp_path):
    for ending in ("log", "pcapng"):
        run("convert", recorded, tmp_path / f"run.{ending}").ended(0)
    frames, times = decoded(run, "rmd", recorded)
    assert len(frames) > 100
    # A reply that comes late on a busy machine has an open direction.
    assert {line.get("direction") for line in frames} >= {"request", "reply"}
    assert any(line["message"] == "read_pid" for line in frames)
    # A log has microseconds.
    assert decoded(run, "rmd", tmp_path / "run.log") == (frames, pytest.approx(times, abs=1.5e-6))
    serial = decoded(run, "st", recorded)
    assert {"GET_REG", "ACK"} <= {line["message"] for line in serial[0]}
    assert decoded(run, "st", tmp_path / "run.pcapng") == serial


def test_a_recording_without_this_protocol_is_said(run, piped, sim, tmp_path):
    drives, path = sim(rmd=()), tmp_path / "run.mcap"
    run("record", "-p", drives.st, *PATIENT, "-o", path, "--duration", "200ms").ended(0)
    error = run("decode", "rmd", path).ended(2).err
    assert "has no line with this protocol" in error and "st0" in error
    assert "give its file, not a pipe" in piped("decode st", f"< {path}").ended(2).err
