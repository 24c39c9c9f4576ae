"""`motorlink record`: its files in the readers of other people, and its ends: killed, full disk, no folder."""

import json
import math
import os
import pty
import resource
import signal
import subprocess
import time
import tty
from pathlib import Path

import numpy
import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from peers import Plug
from program import PATIENT, environment, eventually
from sharing import Client
from test_printed_text import HOSTILE, is_clean

SCENARIO = Path(__file__).parents[2] / "scenarios/position-moves.toml"
QUICK = ("--rate", "50", *PATIENT)


class File:
    """A whole recording, as the packages `mcap` and `mcap-ros2-support` read it."""

    def __init__(self, path):
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            self.header = reader.get_header()
            self.messages = [
                (channel.topic, message.log_time, decoded)
                for _, channel, message, decoded in reader.iter_decoded_messages()
            ]
            self.metadata = [(it.name, it.metadata) for it in reader.iter_metadata()]
            self.attachments = {it.name: it.data.decode() for it in reader.iter_attachments()}

    def of(self, topic):
        """The messages of a topic."""
        return [message for it, _, message in self.messages if it == topic]

    def events(self):
        """The kinds of all events."""
        return [log.function for log in self.of("/events")]


def kept(path, topic):
    """The times of the messages of a topic in a file that may end anywhere, by the stream reader of `mcap`."""
    times, channels = [], set()
    with open(path, "rb") as file:
        try:
            for record in StreamReader(file, skip_magic=False).records:
                if isinstance(record, Channel) and record.topic == topic:
                    channels.add(record.id)
                if isinstance(record, Message) and record.channel_id in channels:
                    times.append(record.log_time)
        except (McapError, EOFError, ValueError):
            pass  # the end of what was written
    return times


@pytest.fixture
def record(start):
    """Starts a recording, and waits until it has begun: `record("run.mcap", ...)`."""

    def record(path, *words, until=0, **options):
        running = start("record", "-o", path, "--json", *QUICK, *words, **options)
        running.until(lambda: len(running.out) > until, "the recording begins")
        return running

    return record


def recorded(running):
    """Ends a recording with Ctrl-C. Gives its last line."""
    running.interrupt()
    assert running.wait() == 0, running.err
    return json.loads(running.out[-1])


def test_the_readers_of_others_show_what_the_drives_do(run, sim, record, tmp_path):
    drives, path = sim(), tmp_path / "run.mcap"
    bus = ("rmd", "-p", f"slcan:{drives.can}", "--id", "1", *PATIENT)
    run(*bus, "position", "90", "--wait").ended(0)
    recording = record(path, "-p", drives.st, "-p", f"slcan:{drives.can}", "--id", "1,2", until=3)
    told = recorded(recording)
    assert told["event"] == "recorded" and told["lost"] == 0 and told["bytes"] == path.stat().st_size
    file = File(path)
    assert file.header.profile == "ros2"
    truth = drives.motor(1, f"slcan-pty:{drives.can}")
    joints = [it for it in file.of("/joint_states") if it.name == ["can0_motor1"]]
    assert len(joints) >= 20
    for joint in joints:
        # A digit of the angle is 0.01°, and the motor settles after its arrival.
        assert joint.position[0] == pytest.approx(math.radians(truth["angle_degrees"]), abs=2e-3)
        assert joint.velocity[0] == pytest.approx(math.radians(truth["speed_dps"]), abs=0.05)
    assert len(file.of("/st0/motor1/signals")) >= 20
    assert {it.bus_voltage for it in file.of("/st0/motor1/signals_2_hz")} == {325.0}
    status = [status for array in file.of("/diagnostics") for status in array.status]
    assert {it.name for it in status} >= {"st0/motor1", "can0/motor1", "can0/motor2"}
    # A busy machine reads too slowly, which is a warning.
    assert status[-1].level in (0, 1) and status[-1].message.startswith("at rest")
    frames = file.of("/can0/frames")
    assert {frame.direction for frame in frames} == {0, 1} and {frame.result for frame in frames} == {0}
    assert 0x141 in {frame.id for frame in frames}
    # NACKs: settings that the drive does not have.
    assert {frame.result for frame in file.of("/st0/frames")} == {0, 1}
    drive = [values for name, values in file.metadata if name == "drive"]
    assert ("can0", "2") in [(it["label"], it["motor"]) for it in drive]
    assert "motor = 1" in file.attachments["st0_motor1.toml"]


    check_with_rosbags(path, file.of("/joint_states"))


def check_with_rosbags(path, ours):
    """It reads the same joint states by its own types, and every message by the types of the file."""
    typesys = pytest.importorskip("rosbags.typesys")
    with open(path, "rb") as file:
        messages = list(make_reader(file).iter_messages())
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    joints = [types.deserialize_cdr(it.data, schema.name) for schema, channel, it in messages if channel.topic == "/joint_states"]
    assert len(joints) == len(ours) > 10
    for joint, expected in zip(joints, ours):
        assert joint.name == expected.name
        assert numpy.array_equal(joint.position, expected.position)
        assert joint.header.stamp.nanosec == expected.header.stamp.nanosec
    types = typesys.get_typestore(typesys.Stores.EMPTY)
    for schema in {schema.name: schema for schema, _, _ in messages}.values():
        types.register(typesys.get_types_from_msg(schema.data.decode(), schema.name))
    for schema, _, message in messages:
        types.deserialize_cdr(message.data, schema.name)


def test_a_kill_loses_the_last_second_at_most(drives, record, tmp_path):
    path, cable = tmp_path / "run.mcap", Plug(drives.st_address)
    running = record(path, "-p", cable.port, "-p", f"slcan:{drives.can}", until=1)
    # A moment after a flush that no rhythm of the recorder decides.
    time.sleep(0.77)
    # On a busy machine the line itself may be silent: that is not a loss.
    seen = cable.delivered
    running.kill()
    cable.unplug()
    label = "port_{}".format(cable.port.rsplit(":", 1)[1])
    lost = seen - max(kept(path, f"/{label}/frames"))
    assert lost < 1.0e9, f"{lost / 1e9:.3f} s are lost"


def test_an_existing_file_is_kept(run, drives, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_text("old")
    outcome = run("record", "-p", drives.st, "-o", path, *QUICK).ended(2)
    assert "exists already" in outcome.err and "--force" in outcome.err
    assert path.read_text() == "old"


def test_the_name_of_the_file_is_shown_without_control_characters(run, drives, tmp_path):
    path = tmp_path / f"{HOSTILE.removesuffix('error: fake')}.mcap"
    done = run("record", "-p", drives.st, "-o", path, "--duration", "300ms", *QUICK).ended(0)
    assert is_clean(done.out) and is_clean(done.err), done.err
    done = run("record", "-p", drives.st, "-o", path, *QUICK).ended(2)
    assert is_clean(done.err), done.err


def test_a_place_that_cannot_be_written_is_refused_before_the_port_is_opened(run, tmp_path):
    folder = tmp_path / "none"
    outcome = run("record", "-p", f"{tmp_path}/nothing", "-o", folder / "run.mcap").ended(3)
    assert f"cannot write `{folder}/run.mcap`" in outcome.err and "mkdir -p" in outcome.err
    outcome = run("record", "-p", "sim:", "-o", "-").ended(2)
    assert "stdout" in outcome.err


def test_nothing_is_left_where_no_motor_answers(run, sim, tmp_path):
    drives, path = sim(), tmp_path / "run.mcap"
    outcome = run("record", "-p", drives.st, "-o", path, "SPED_MEAS", *QUICK).ended(2)
    assert "did you mean `SPEED_MEAS`" in outcome.err
    assert "`motorlink st registers` lists the registers" in outcome.err
    assert not path.exists()
    outcome = run("record", "-p", drives.can, "-o", path, "--timeout", "100ms").ended(3)
    assert f"no motor answers at serial:{drives.can}: reading STATUS for motor 1 failed" in outcome.err
    assert not path.exists()


@pytest.mark.parametrize("ending", [[signal.SIGINT], [signal.SIGTERM], [signal.SIGINT, signal.SIGINT]])
def test_a_signal_ends_the_start_at_once_and_leaves_what_was_there(start, tmp_path, ending):
    drive, port = pty.openpty()
    tty.setraw(port)
    path = tmp_path / "run.mcap"
    # One of them finds an older file.
    old = ending == [signal.SIGINT]
    if old:
        path.write_text("old")
    words = ("--motor", "1", "--timeout", "10s", "-o", path, *["--force"] * old)
    running = start("record", "-p", os.ttyname(port), *words)
    # The first question about the settings, which this drive never answers.
    assert os.read(drive, 64)
    assert path.exists()
    for number in ending:
        running.process.send_signal(number)
    assert running.wait(5) == 130, running.err
    assert path.read_text() == "old" if old else not path.exists()
    os.close(drive), os.close(port)


def limited(size):
    """A file may have this size; more is an error, as on a full disk."""

    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_a_full_disk_ends_the_recording_and_not_the_motors(motorlink, run, sim, tmp_path):
    drives, path = sim(), tmp_path / "run.mcap"
    turning = ("rmd", "-p", f"slcan:{drives.can}", "--id", "1", *PATIENT)
    run(*turning, "speed", "360").ended(0)
    words = ["record", "-p", f"slcan:{drives.can}", "--id", "1", "-o", path, "--duration", "30s", *QUICK]
    done = subprocess.run(
        [motorlink, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment(),
        preexec_fn=limited(60_000),
    )
    assert done.returncode == 3, done.stderr
    assert f"cannot write {path} any more: File too large" in done.stderr, done.stderr
    assert "messages" in done.stderr and "stays readable" in done.stderr
    # It has a footer, so that readers of others open it without a repair.
    assert File(path).of("/can0/motor1/signals")
    assert drives.motor(1, f"slcan-pty:{drives.can}")["speed_dps"] == pytest.approx(360, abs=20)
    run(*turning, "stop").ended(0)


def test_a_closed_output_does_not_stop_the_recording(piped, drives, tmp_path):
    path = tmp_path / "run.mcap"
    words = ("-p", drives.st, "-o", path, "--json", "--duration", "3s", *QUICK)
    piped(f"record {' '.join(map(str, words))}", "| head -n 1").ended(0)
    times = [time for topic, time, _ in File(path).messages if topic == "/st0/motor1/signals"]
    assert max(times) - min(times) > 2e9


def test_a_recording_goes_on_when_its_port_is_back(drives, record, tmp_path):
    path = tmp_path / "run.mcap"
    cable = Plug(drives.st_address)
    running = record(path, "-p", cable.port, "--motor", "1", until=1)
    cable.unplug()
    running.more_lines(2)
    cable.plug_in()
    values = json.loads(running.out[-1])["values"]
    eventually(
        lambda: json.loads(running.out[-1])["values"] > values + 50, "values come again", 30
    )
    recorded(running)
    cable.unplug()
    file = File(path)
    events = file.events()
    assert "lost" in events and "back" in events[events.index("lost") :]
    (label,) = {values["label"] for name, values in file.metadata if name == "drive"}
    back = next(log.stamp for log in file.of("/events") if log.function == "back")
    rows = file.of(f"/{label}/motor1/signals")
    assert any((row.stamp.sec, row.stamp.nanosec) > (back.sec, back.nanosec) for row in rows)
    levels = [status.level for array in file.of("/diagnostics") for status in array.status]
    assert 3 in levels and levels[-1] in (0, 1)


def test_files_are_rotated_and_end_by_size(run, drives, tmp_path):
    path = tmp_path / "run.mcap"
    words = ("--rotate", "15kB", "--max-size", "40kB", "--fsync", "1s", "--json", *QUICK)
    told = run("record", "-p", drives.st, "-o", path, *words).ended(0).lines[-1]
    assert told["files"] == sorted(map(str, tmp_path.glob("run_*.mcap"))) and len(told["files"]) > 1
    assert sum(os.path.getsize(file) for file in told["files"]) == told["bytes"] >= 40_000
    parts = [dict(File(file).metadata)["motorlink"]["part"] for file in told["files"]]
    assert parts == [str(number) for number in range(len(parts))]
    assert all(File(file).of("/st0/motor1/signals") for file in told["files"][:-1])


def test_what_is_recorded_is_chosen_and_what_does_not_come_is_named(run, drives, tmp_path):
    path = tmp_path / "run.mcap"
    # Motor 2 of the simulated drive has no flux weakening, and the bus no motor 9.
    words = ("SPEED_MEAS", "TORQUE_MEAS", "FLUXWK_BUS", "speed_dps", "--id", "1,9", "--full-scale", "16.5")
    words = ("-p", drives.st, "-p", f"slcan:{drives.can}", *words, "--duration", "3s", "--no-settings")
    words += ("--rate", "20", "--timeout", "1s", "-o", path)
    told = run("record", *words, "--json").ended(0).lines[-1]
    assert (told["refused"], told["silent"]) == (["st0/motor2/FLUXWK_BUS"], ["can0/motor9"])
    file = File(path)
    assert not file.attachments
    assert {topic for topic, _, _ in file.messages if "signals" in topic} == {
        "/st0/motor1/signals",
        "/st0/motor2/signals",
        "/can0/motor1/signals",
    }
    rows = file.of("/st0/motor2/signals")
    assert 0 < len(rows) <= 65 and math.isnan(rows[-1].fluxwk_bus) and rows[-1].speed_meas == 0
    torques = [row.torque_meas for row in file.of("/st0/motor1/signals")]
    efforts = [joint.effort[0] for joint in file.of("/joint_states") if joint.name == ["st0_motor1"]]
    assert efforts == pytest.approx([torque * 16.5 / 32767 for torque in torques])
    text = run("record", "--force", *words).ended(0).out
    assert ", refused: st0/motor2/FLUXWK_BUS, " in text and ", SILENT: can0/motor9, " in text
    assert "is not a full scale" in run("record", "-p", drives.st, "-o", path, "--full-scale", "0").ended(2).err


def test_a_share_is_recorded_with_what_other_programs_do(run, shares, record, tmp_path):
    serving, path = shares(), tmp_path / "run.mcap"
    place, drives = serving.path, serving.drives
    ports = ("-p", f"share:{place}/st0", "--motor", "1", "-p", f"share:{place}/rmd0", "--id", "2")
    running = record(path, *ports, until=1)
    tuner = Client(place, "tuner")
    tuner.command("rmd0", 2, 0xA2, 0, 0, 0, 160, 140, 0, 0)
    eventually(lambda: drives.motor(2, f"slcan-pty:{drives.can}")["speed_dps"] > 300, "it turns", 30)
    running.more_lines(2)
    tuner.command("rmd0", 2, 0x81, 0, 0, 0, 0, 0, 0, 0)
    tuner.ask("latch"), tuner.ask("release")
    running.more_lines(2)
    told = recorded(running)
    assert told["lost"] == 0 and told["unconfirmed"] == 0 and told["achieved_hz"] > 0
    # The share reads the drives: this program has sent and seen no frame.
    assert told["frames"] == 0
    file = File(path)
    assert not [topic for topic, _, _ in file.messages if topic.endswith("/frames")]
    rows = file.of("/rmd0/motor2/signals")
    assert max(row.speed_dps for row in rows) > 100
    stamps = [row.stamp.sec * 10**9 + row.stamp.nanosec for row in rows]
    assert stamps == sorted(set(stamps))
    assert all(0 < row.span_s < 5 and not math.isnan(row.multi_turn_angle_degrees) for row in rows)
    assert {row.bus_voltage for row in file.of("/st0/motor1/signals_2_hz")} == {325.0}
    events = [(log.function, log.name, log.file) for log in file.of("/events")]
    for event in [
        ("joined", "st0", "tuner"),
        ("commanded", "rmd0/motor2", "tuner"),
        ("stopping", "rmd0/motor2", "tuner"),
        ("stopped", "rmd0/motor2", "tuner"),
        ("latched", "rmd0", "tuner"),
        ("released", "st0", "tuner"),
    ]:
        assert event in events, events
    assert events.count(("joined", "st0", "tuner")) == 1
    turned = next(log for log in file.of("/events") if log.function == "commanded")
    assert turned.msg == "tuner sends 0xA2 Speed closed-loop command: speed 360.00 °/s", turned.msg
    status = [status for array in file.of("/diagnostics") for status in array.status]
    assert {it.name for it in status} == {"st0/motor1", "rmd0/motor2"}
    info = run("info", path).ended(0).out
    assert "frames     those of rmd0 are not recorded: a share holds the port" in info


def test_a_share_that_ends_or_is_stopped_is_followed_when_it_is_back(shares, record, run, tmp_path):
    running, path = shares(), tmp_path / "run.mcap"
    recording = record(path, "-p", f"share:{running.path}/rmd0", "--id", "1", until=1)

    def values():
        return json.loads(recording.out[-1]).get("values", 0)

    def continues(before):
        eventually(lambda: values() > before + 50, "values come again", 30)

    running.process.send_signal(signal.SIGSTOP)
    silent = eventually_stands(recording, values)
    running.process.send_signal(signal.SIGCONT)
    continues(silent)
    running.interrupt()
    assert running.wait() == 0
    recording.more_lines(2)
    ended = values()
    shares()
    continues(ended)
    told = recorded(recording)
    assert told["lost"] == 0
    (gap,) = told["gaps"]
    assert gap["motor"] == "rmd0/motor1" and gap["seconds"] > 3
    assert run("info", path, "--json").ended(0).json["gaps"] == told["gaps"]
    assert f"\nno values  rmd0/motor1 for {gap['seconds']:.3f} s\n" in run("info", path).ended(0).out
    file = File(path)
    events = [log for log in file.of("/events") if log.function in ("lost", "back")]
    assert [log.function for log in events] == ["lost", "back"] * 2
    assert events[0].msg == "the share does not answer"
    assert "the share closed the connection" in events[2].msg
    levels = [status.level for array in file.of("/diagnostics") for status in array.status]
    assert 3 in levels and levels[-1] in (0, 1)


def eventually_stands(recording, values):
    """Waits until the number of values stays the same for six lines, of a second each; gives it.

    The recorder notices after up to 3 s that the share does not answer.
    """

    def stands():
        lines = [json.loads(line).get("values", 0) for line in recording.out[-6:]]
        return len(lines) == 6 and len(set(lines)) == 1 and lines[0] > 0

    eventually(stands, "the share is silent", 30)
    return values()


def test_a_scenario_is_recorded_and_has_the_same_bytes_each_time(run, tmp_path):
    first, second, table = (tmp_path / name for name in ("first.mcap", "second.mcap", "run.csv"))
    run("sim", "run", SCENARIO, "--mcap", first, "--csv", table).ended(0)
    run("sim", "run", SCENARIO, "--mcap", second).ended(0)
    assert first.read_bytes() == second.read_bytes()
    file = File(first)
    lines = table.read_text().splitlines()
    rows, names = file.of("/rmd/motor1/signals"), lines[0].split(",")
    assert len(rows) == len(lines) - 1 == len(file.of("/joint_states"))
    column = names.index("rmd1.speed_dps")
    # The table has the digits of a float of 32 bits.
    speeds = [numpy.float32(line.split(",")[column]) for line in lines[1:]]
    assert [numpy.float32(row.speed_dps) for row in rows] == speeds
    assert "commanded" in file.events()


def test_motors_of_a_port_that_is_not_there_and_a_name_of_another_format_are_refused(run, drives, tmp_path):
    path = tmp_path / "run.mcap"
    for port, option in ((drives.st, "--id"), (f"slcan:{drives.can}", "--motor")):
        assert "no port is a" in run("record", "-p", port, "-o", path, option, "5").ended(2).err
    for ending in ("csv", "pcapng"):
        path = tmp_path / f"run.{ending}"
        assert "MCAP" in run("record", "-p", "sim:", "-o", path, "--duration", "1s").ended(2).err
    assert list(tmp_path.iterdir()) == []
