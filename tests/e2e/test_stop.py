"""Stops on bad lines, and what a failed stop or motion command says about the motor."""

import json
import subprocess

import pytest

from peers import device, slcan_adapter
from program import environment, eventually
from st_wire import ACK, EXECUTE, SET_RAMP, TIMEOUT, Line, frame, nack

GET_BOARD_INFO, SET_CURRENT_REF, STOP_MOTOR = 0x06, 0x0A, 0x02
STOP_AGAIN = "repeat the stop; end other programs that use the port; if the motor still turns"
#: GET_REG for motor 1 with 127 bytes that never come.
CUT_OFF = b"\x22\x7f"


@pytest.fixture
def drive(sim, tmp_path):
    """A simulated drive with MCSDK firmware."""
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')
    return sim(config, rmd=())


def status(drive):
    return drive.motor(1)["status"]


def write_cut_off(drive):
    with Line(drive.st) as line:
        line.send(CUT_OFF)
        line.port.flush()


def test_a_stop_reaches_a_drive_that_waits_for_the_rest_of_a_frame(run, drive):
    words = ("st", "-p", drive.st)
    run(*words, "start").ended(0)
    write_cut_off(drive)
    assert run(*words, "stop").ended(0).out == "motor 1: STOP_MOTOR acknowledged\n"
    eventually(lambda: status(drive) == "IDLE", "the motor stops")


def test_a_raw_stop_that_fails_names_the_command_that_completes_a_frame(run, drive):
    words = ("st", "-p", drive.st, "--profile", "mcsdk-5.4")
    run(*words, "start").ended(0)
    write_cut_off(drive)
    message = run(*words, "--timeout", "200ms", "raw", "03", "02").ended(3).err
    assert message.startswith("error: motor 1 may still be turning: ")
    assert "stop` repeats the stop and completes a cut-off frame" in message and STOP_AGAIN in message
    assert status(drive) != "IDLE"
    run(*words, "stop").ended(0)
    eventually(lambda: status(drive) == "IDLE", "the motor stops")
    assert "turning" not in run(*words, "raw", "02", "7f").ended(1).err


def test_a_stop_after_wait_reaches_a_drive_that_waits_for_the_rest_of_a_frame(start, run, drive):
    words = ("st", "-p", drive.st, "--profile", "mcsdk-5.4", "--timeout", "200ms")
    run(*words, "start").ended(0)
    eventually(lambda: status(drive) == "RUN", "the motor runs")
    move = start(*words, "--trace", "position", "50rad", "20s", "--wait")
    eventually(lambda: any("SET_POSITION" in line or "CURRENT_POSITION" in line for line in move.err), "the move")
    # Not through pyserial: the port is locked.
    with open(drive.st, "wb", buffering=0) as line:
        line.write(CUT_OFF)
    assert move.wait() == 3
    eventually(lambda: status(drive) == "IDLE", "the motor stops")
    assert any("motor 1 was stopped" in line for line in move.err), move.err


def test_a_failed_stop_says_that_the_motor_may_be_turning(run, tmp_path):
    heard = []
    with device(tmp_path / "silent", lambda received: heard.append(received) or b"") as port:
        message = run("st", "-p", port, "--timeout", "50ms", "--json", "stop").ended(3).err
        # The last bytes are a stop: the padding may have completed a write that was cut off.
        stop = frame(1 << 5 | EXECUTE, [STOP_MOTOR])
        eventually(lambda: b"".join(heard).endswith(stop), "a stop as the last bytes")
        assert b"".join(heard).count(stop) == 5
        error = json.loads(message)["error"]
        assert error["message"].startswith("motor 1 may still be turning: ")
        assert STOP_AGAIN in error["try"]
        # A start is not sent.
        assert "turning" not in run("st", "-p", port, "--timeout", "50ms", "start").ended(3).err


def test_a_stop_that_the_drive_does_not_receive_in_time_says_so(run, tmp_path):
    """A line that is too slow for the drive's time limit of a frame, or that loses bytes."""
    heard = []
    info = frame(GET_BOARD_INFO)

    def answer(received):
        heard.append(received)
        return frame(ACK, b"ST MC SDK".ljust(32, b"\0")) if received == info else nack(TIMEOUT)

    stop = frame(1 << 5 | EXECUTE, [STOP_MOTOR])
    with device(tmp_path / "slow", answer) as port:
        message = run("st", "-p", port, "--timeout", "5s", "stop").ended(3).err
        eventually(lambda: b"".join(heard).endswith(stop), "a stop as the last bytes")
    assert message.startswith("error: motor 1 may still be turning: ") and STOP_AGAIN in message
    assert "the drive did not understand what it received (TIMEOUT: " in message
    assert "the line loses bytes, or its baud rate is too low for the drive's time limit of a frame" in message
    assert b"".join(heard).count(stop) >= 5
    assert b"".join(heard).count(b"\xff" * 130 + b"\x00\xff") == 3, "each repetition is padded"


def test_a_stop_on_a_port_in_use_says_that_the_motor_may_be_turning(run, start, drives):
    loop = start("st", "-p", drives.port("pty"), "get", "STATUS", "--every", "50ms")
    loop.more_lines()
    message = run("st", "-p", drives.port("pty"), "-m", 2, "stop").ended(3).err
    assert "motor 2 may still be turning" in message and "in use" in message and STOP_AGAIN in message


def test_a_motion_command_without_an_answer_says_that_the_motor_may_be_turning(run, sim, tmp_path):
    drive = sim(st=("tcp",), rmd=())
    with Line(f"socket://{drive.st_address}") as line:

        def lossy(received):
            reply = line.ask(received)
            return b"" if received[0] & 0x1F in (EXECUTE, SET_RAMP, SET_CURRENT_REF) else reply

        with device(tmp_path / "lossy", lossy) as port:
            words = ("st", "-p", port, "--timeout", "300ms")
            for command in ("start", "start-stop", "ramp 900 100", "current-reference 100 0"):
                message = run(*words, *command.split()).ended(3).err
                assert "motor 1 may be turning now: " in message
                assert f"stop it: `motorlink st -p {port} stop`" in message
            failed = json.loads(run(*words, "--json", "-m", 2, "current-reference", 100, 0).ended(3).err)["error"]
            assert failed["message"].startswith("motor 2 may be turning now: ")
            assert f"`motorlink st -p {port} --motor 2 stop`" in failed["try"]


def into_a_full_disk(motorlink, *words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [motorlink, *words], stdout=full, stderr=subprocess.PIPE, text=True, env=environment()
        )
    assert done.returncode == 3
    return done.stderr


def test_a_full_disk_does_not_hide_what_was_done(motorlink):
    carried_out = "(os error 28); the command was carried out"
    start = into_a_full_disk(motorlink, "st", "-p", "sim:", "start")
    assert start.startswith("error: motor 1 may be turning now: stdout cannot be written: ")
    assert carried_out in start and "stop it: `motorlink st -p sim: stop`" in start
    stop = into_a_full_disk(motorlink, "st", "-p", "sim:", "stop")
    assert carried_out in stop and "turning" not in stop
    speed = into_a_full_disk(motorlink, "rmd", "-p", "sim:", "--id", "2", "speed", "90")
    assert speed.startswith("error: motor 2 may be turning now: stdout cannot be written: ")
    assert carried_out in speed and "stop it: `motorlink rmd -p sim: --id 2 stop`" in speed
    both = into_a_full_disk(motorlink, "rmd", "-p", "sim:", "--id", "1,2", "speed", "90")
    assert "the motors may be turning now: " in both and "`motorlink rmd -p sim: stop --all`" in both


def test_an_rmd_command_without_an_answer_says_that_the_motor_may_be_turning(run, tmp_path):
    def motor(sent):
        # Questions are answered by an echo of their code, motion commands are not answered.
        code = sent[5:7]
        return [f"t1418{code}1900F000000000"] if code.startswith("9") else []

    with device(tmp_path / "can", slcan_adapter(motor)) as link:
        words = ("rmd", "-p", f"slcan:{link}", "--timeout", "500ms")
        for command in ("speed 90", "torque 1", "position 90"):
            message = run(*words, *command.split()).ended(3).err
            assert message.startswith("error: motor 1 may be turning now: "), message
            assert f"`motorlink rmd -p slcan:{link} --id 1 stop`" in message
        message = run(*words, "--id", 1, "off").ended(3).err
        assert message.startswith("error: motor 1 may still be turning: ") and STOP_AGAIN in message


def test_an_rmd_command_that_was_not_sent_does_not_say_that_the_motor_turns(run, tmp_path):
    with device(tmp_path / "can", slcan_adapter(lambda frame: [])) as link:
        message = run("rmd", "-p", f"slcan:{link}", "--timeout", "50ms", "speed", 90).ended(3).err
    assert "turning" not in message
