"""`motorlink guard`: motors stop when the program that started them has ended for any reason."""

import json
import signal
import socket
import struct
import sys
from pathlib import Path

import pytest

from program import children, environment, eventually
from st_wire import ACK, EXECUTE, GET_REG, Line, frame, header

STATUS, SPEED_KP = 0x02, 0x05
START, STOP = 1, 2

# A program that starts motors and then does nothing; what it is given on stdin ends it.
CLIENT = """
import sys
from st_wire import ACK, EXECUTE, Line, frame, header
line = Line(sys.argv[1])
for word in sys.argv[2:]:
    motor, command = map(int, word.split(":"))
    assert line.ask(frame(header(EXECUTE, motor), [command]))[0] == ACK
print("done", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def guard(start, tmp_path):
    """A guard on a drive: `guard(port)` gives it with `.port`, where programs find the drive."""

    def guard(port, *arguments, serve=None):
        process = start("guard", "-p", port, "--serve", serve or f"pty:{tmp_path}/drive", *arguments)
        announced = json.loads(process.line(0))
        assert announced["protocol"] == "st"
        process.port = announced["port"].removeprefix("pty:").replace("tcp-listen:", "socket://")
        return process

    return guard


@pytest.fixture
def client():
    """A program of its own that sends commands: `client(port, "1:1")` starts motor 1."""
    found = environment({"PYTHONPATH": str(Path(__file__).parent)})
    with children() as start:
        yield lambda port, *commands: start(
            [sys.executable, "-c", CLIENT, port, *commands], "done", env=found
        )


def runs(drives, number):
    eventually(lambda: drives.motor(number)["status"] == "RUN", f"motor {number} runs")


def rests(drives, number):
    eventually(lambda: drives.motor(number)["status"] == "IDLE", f"motor {number} rests")


def test_every_byte_passes_both_ways(sim, guard):
    drives = sim(rmd=())
    with Line(guard(drives.st).port) as line:
        assert line.get(SPEED_KP, motor=1) > 0
        assert line.ask(frame(header(GET_REG, 1), [0xFF]))[0] != ACK
        # Bytes outside a frame pass, too: the drive answers them as without a guard.
        line.send([0x06, 0x00, 0xFF])
        assert line.reply() == frame(0xFF, [0x0A])
        line.send([0x06])
        assert line.reply() == frame(0xFF, [0x09])


def test_a_killed_program_leaves_no_motor_spinning(sim, guard, client):
    drives = sim(rmd=())
    process = guard(drives.st, "--json")
    program = client(process.port, "1:1", "2:1")
    runs(drives, 1), runs(drives, 2)
    program.kill()
    rests(drives, 1), rests(drives, 2)
    process.until(lambda: any('"stopped"' in text for text in process.out), "the event")
    event = next(json.loads(text) for text in process.out if '"stopped"' in text)
    assert event["reason"] == "client-gone"
    assert [(motor["motor"], motor["stopped"]) for motor in event["motors"]] == [(1, True), (2, True)]
    process.says_halted("motor 1")
    # The next program gets the line.
    with Line(process.port) as line:
        assert line.get(STATUS, motor=1) == 0


def test_a_motor_that_coasts_is_not_said_to_rest(sim, guard, client, tmp_path):
    # A flywheel: it takes seconds to stop.
    config = tmp_path / "flywheel.toml"
    config.write_text("[[st.motor]]\npreset = 'servo'\nplant.load.inertia = 3e-4\n")
    drives = sim(config, rmd=())
    process = guard(drives.st)
    program = client(process.port, "1:1")
    eventually(lambda: drives.motor(1)["speed_rpm"] > 500, "motor 1 turns fast")
    program.kill()
    process.says("the program ended or closed the port: motor 1 is stopping (")
    assert any(": its rotor may still coast" in text for text in process.err), process.err
    rests(drives, 1)


def test_a_program_that_dies_in_the_middle_of_a_request(sim, guard, run):
    # Shipped firmware waits for the rest of a frame for ever.
    drives = sim("--profile", "mcsdk-5.4", rmd=())
    process = guard(drives.st)
    with Line(process.port) as line:
        assert line.ask(frame(header(EXECUTE, 1), [START]))[0] == ACK
        runs(drives, 1)
        line.send([0x07, 0x06, 0x00])
    rests(drives, 1)
    process.says_halted("motor 1")
    run("st", "-p", process.port, "--profile", "mcsdk-5.4", "info").ended(0)


def test_a_reset_connection_stops_the_motor(sim, guard):
    drives = sim(rmd=())
    process = guard(drives.st, serve="tcp-listen:127.0.0.1:0")
    host, _, port = process.port.removeprefix("socket://").rpartition(":")
    program = socket.create_connection((host, int(port)), timeout=5)
    program.sendall(frame(header(EXECUTE, 1), [START]))
    assert program.recv(16) == frame(ACK)
    runs(drives, 1)
    program.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    program.close()
    rests(drives, 1)


def test_a_second_program_is_turned_away(sim, guard, run, start):
    drives = sim(rmd=())
    process = guard(drives.st, "--serve", "tcp-listen:127.0.0.1:0")
    tcp = json.loads(process.line(1))["path"]
    watching = start("st", "-p", process.port, "get", "SPEED_KP", "--every", "20ms")
    watching.more_lines(1)
    assert "in use by another program" in run("st", "-p", process.port, "info").ended(3).err
    assert "hung up" in run("st", "-p", f"tcp:{tcp}", "info").ended(3).err
    process.says("was refused")
    watching.more_lines()
    # The drive's own port is locked as well.
    assert "in use by another program" in run("st", "-p", drives.st, "info").ended(3).err
    watching.interrupt()
    watching.wait()
    # The guard takes the next one when it has seen the end of this one.
    eventually(lambda: run("st", "-p", f"tcp:{tcp}", "info").code == 0, "the next program")


def test_a_program_that_talks_is_not_silent_and_one_without_motors_may_be(sim, guard):
    drives = sim(rmd=())
    process = guard(drives.st, "--silence", "1s")
    with Line(process.port) as line:
        assert line.ask(frame(header(EXECUTE, 1), [START]))[0] == ACK
        began = drives.do("state")["t"]
        while drives.do("state")["t"] < began + 2:
            line.get(STATUS, motor=1)
        assert drives.motor(1)["status"] == "RUN"
        assert line.ask(frame(header(EXECUTE, 1), [STOP]))[0] == ACK
        rests(drives, 1)
        began = drives.do("state")["t"]
        eventually(lambda: drives.do("state")["t"] > began + 1.5, "silence")
    process.says("closed the port")
    assert not any("silent" in text for text in process.err), process.err


def test_a_drive_that_is_unplugged_is_stopped_when_it_is_back(sim, guard, client):
    drives = sim(rmd=())
    process = guard(drives.st)
    program = client(process.port, "1:1")
    drives.kill()
    process.says("the port of the drive failed")
    program.kill()
    process.says("motor 1 MAY STILL TURN")
    drives = sim(rmd=())
    process.says("the port of the drive works again")
    process.says_halted("motor 1")
    with Line(process.port) as line:
        assert line.get(STATUS, motor=1) == 0


def test_a_drive_that_hangs_is_stopped_when_it_goes_on(sim, guard, client):
    drives = sim(rmd=())
    process = guard(drives.st)
    program = client(process.port, "1:1")
    runs(drives, 1)
    drives.process.send_signal(signal.SIGSTOP)
    program.kill()
    process.says("motor 1 MAY STILL TURN")
    drives.process.send_signal(signal.SIGCONT)
    rests(drives, 1)
    process.says_halted("motor 1")


def test_a_guard_whose_drive_is_silent_says_so_when_it_ends(sim, guard, client):
    drives = sim(rmd=())
    process = guard(drives.st)
    client(process.port, "1:1")
    drives.process.send_signal(signal.SIGSTOP)
    try:
        process.interrupt()
        assert process.wait(30) == 3
        assert any("may still turn" in text for text in process.err), process.err
    finally:
        drives.process.send_signal(signal.SIGCONT)
