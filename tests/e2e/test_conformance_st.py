"""`motorlink conformance st`: drives that are right, one that is not, and a port that dies."""

import json
import os
import shlex
import xml.etree.ElementTree as xml

import pytest
import st_wire
from peers import device
from program import eventually

PROFILES = ["spec", "mcsdk-5.4"]


def kit(run, port, *arguments, within=120):
    return run("conformance", "st", "-p", port, *arguments, within=within)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_simulated_drive_passes_without_moving(sim, run, tmp_path, profile):
    drives = sim("--profile", profile, rmd=())
    before = drives.motor(1)
    files = tmp_path / "report.xml", tmp_path / "report.json"
    words = ("--readings", "strict", "--profile", profile, "--junit", files[0], "--json", files[1])
    done = kit(run, drives.st, *words).ended(0)

    report = json.loads(files[1].read_text())
    assert report["failed"] == report["reading"] == report["not_run"] == 0
    assert report["passed"] > 390
    verdicts = {case["verdict"] for case in report["cases"]}
    assert verdicts == {"passed", "skipped"}
    suite = xml.parse(files[0]).getroot().find("testsuite")
    assert int(suite.get("tests")) == len(report["cases"])
    assert "run with --spin" in done.out

    after = drives.motor(1)
    assert after["speed_rpm"] == 0 and after["angle_degrees"] == before["angle_degrees"]
    assert after["status"] == "IDLE"


@pytest.mark.parametrize("profile", PROFILES)
def test_a_drive_in_the_process_passes(run, tmp_path, profile):
    config = tmp_path / "bench.toml"
    config.write_text(f'profile = "{profile}"\n')
    done = kit(run, f"sim:{config}", "--profile", profile, "--readings", "strict", "--json").ended(0)
    assert done.json["failed"] == 0


def test_with_leave_the_motor_turns_and_is_stopped(sim, run):
    drives = sim(rmd=())
    before = drives.motor(1)
    only = ("--spin", "--only", "ST-4.6-07", "--json")
    report = kit(run, drives.st, *only).ended(0).json
    assert report["passed"] == 1
    after = drives.motor(1)
    assert abs(after["angle_degrees"] - before["angle_degrees"]) > 360
    assert after["status"] == "IDLE"


def test_the_users_commands_cycle_the_power_and_cause_faults(start, run, tmp_path):
    port, commands = tmp_path / "st0", tmp_path / "commands"
    os.mkfifo(commands)
    stdin = os.open(commands, os.O_RDWR)
    try:
        drives = start("sim", "--stdin", "--st", f"pty:{port}", stdin=stdin)
        drives.line(0)

        def say(**command):
            # In a shell of its own the command waits for nothing: the kit waits for the drive.
            return f"printf '%s\\n' {shlex.quote(json.dumps(command))} > {commands}; sleep 0.2"

        fault = {"command": "fault", "motor": 1, "fault": "OVER_TEMP"}
        hooks = (
            *("--power-cycle", say(command="power-cycle")),
            *("--fault-on", say(**fault, hold=True)),
            *("--fault-off", say(**fault, hold=False)),
        )
        for only in ("ST-3.2-05", "ST-4.6-21", "ST-4.6-22"):
            report = kit(run, port, *hooks, "--only", only, "--json").ended(0).json
            assert report["skipped"] == 0 and report["passed"] >= 1, report
        assert all(json.loads(line).get("ok", True) for line in drives.out)
    finally:
        drives.end()
        os.close(stdin)


def one_motor(checksum):
    """A drive with one motor at rest and next to no registers."""

    def reply(header, payload):
        body = bytes([header, len(payload), *payload])
        return body + bytes([checksum(body)])

    def answer(received):
        code, motor, payload = received[0] & 0x1F, received[0] >> 5, received[2:-1]
        if motor > 1:
            return reply(st_wire.NACK, [st_wire.BAD_MOTOR_SELECTED])
        if code == st_wire.GET_REG and payload in (b"\x00", b"\x02"):
            return reply(st_wire.ACK, [0])
        return reply(st_wire.NACK, [st_wire.BAD_FRAME_ID])

    return answer


def test_a_wrong_checksum_is_told_with_what_was_sent_and_what_came(run, tmp_path):
    forgets_the_high_byte = one_motor(lambda body: sum(body) & 0xFF)
    with device(tmp_path / "st", forgets_the_high_byte) as port:
        done = kit(run, port, "--only", "a_reply_is_a_frame_with_its_checksum").ended(1)
    assert "FAILED" in done.out and "ST-3.3-01" in done.out
    assert "GET_BOARD_INFO" in done.out, "what was sent, in words"
    assert "ff 01 01 01" in done.out, "what came, in bytes"
    assert "checksum" in done.out
    assert "1 of 1 cases failed" in done.err


def test_a_motor_that_turns_is_left_alone(sim, run):
    drives = sim(rmd=())
    run("st", "-p", drives.st, "start").ended(0)
    done = kit(run, drives.st).ended(3)
    assert "the motor is not at rest" in done.err
    assert drives.motor(1)["status"] != "IDLE"


def test_ctrl_c_stops_the_motor_and_puts_everything_back(sim, start, run):
    drives = sim(rmd=())
    before = run("st", "-p", drives.st, "get", "RAMP_FINAL_SPEED", "SPEED_KD").out
    words = ("conformance", "st", "-p", drives.st, "--spin", "--only", "ST-4.8-08", "--json")
    kit = start(*words)
    eventually(lambda: drives.motor(1)["status"] == "RUN", "a motor that runs")
    kit.interrupt()
    assert kit.wait() == 130
    assert drives.motor(1)["status"] == "IDLE"
    assert run("st", "-p", drives.st, "get", "RAMP_FINAL_SPEED", "SPEED_KD").out == before


def test_a_silent_port_is_given_up(run, tmp_path):
    with device(tmp_path / "st") as port:
        done = kit(run, port).ended(3)
    assert "nothing answers" in done.err


def test_a_port_that_dies_ends_the_run(run, tmp_path):
    left = iter(range(6))
    right = one_motor(st_wire.checksum)

    def answer(received):
        return right(received) if next(left, None) is not None else None

    with device(tmp_path / "st", answer) as port:
        report = tmp_path / "report.json"
        done = kit(run, port, "--json", report).ended(3)
    assert "cases were not run" in done.err
    assert json.loads(report.read_text())["not_run"] > 300


def test_a_fault_that_cannot_be_ended_is_told(sim, run):
    hooks = ("--fault-on", "true", "--fault-off", "exit 4")
    report = kit(run, sim(rmd=()).st, *hooks, "--only", "ST-4.6-21", "--json").ended(1).json
    message = [case["expected"] for case in report["cases"] if case["verdict"] == "failed"]
    assert message and all("end it by hand" in text and "exit 4" in text for text in message), message
