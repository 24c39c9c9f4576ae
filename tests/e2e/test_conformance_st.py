"""`motorlink conformance st`: drives that are right, a motor that turns, and a port that dies."""

import json
import xml.etree.ElementTree as xml

from peers import device
from program import eventually
from st_wire import ACK, BAD_FRAME_ID, BAD_MOTOR_SELECTED, GET_REG, frame, nack


def kit(run, port, *arguments, within=120):
    return run("conformance", "st", "-p", port, *arguments, within=within)


def test_a_simulated_drive_passes_without_moving(sim, run, tmp_path):
    drives = sim(rmd=())
    before = drives.motor(1)
    files = tmp_path / "report.xml", tmp_path / "report.json"
    words = ("--readings", "strict", "--junit", files[0], "--json", files[1])
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


def test_a_port_that_dies_ends_the_run(run, tmp_path):
    left = iter(range(6))

    def answer(received):
        """One motor at rest with next to no registers, for six requests."""
        code, motor, payload = received[0] & 0x1F, received[0] >> 5, received[2:-1]
        if next(left, None) is None:
            return None
        if motor > 1:
            return nack(BAD_MOTOR_SELECTED)
        return frame(ACK, [0]) if code == GET_REG and payload in (b"\x00", b"\x02") else nack(BAD_FRAME_ID)

    with device(tmp_path / "st", answer) as port:
        files = tmp_path / "report.xml", tmp_path / "report.json"
        done = kit(run, port, "--junit", files[0], "--json", files[1]).ended(3)
    assert "cases were not run" in done.err
    assert json.loads(files[1].read_text())["not_run"] > 300
    assert xml.parse(files[0]).getroot().find("testsuite").find("testcase/error") is not None


def test_a_fault_that_cannot_be_ended_is_told(sim, run):
    hooks = ("--fault-on", "true", "--fault-off", "exit 4")
    report = kit(run, sim(rmd=()).st, *hooks, "--only", "ST-4.6-21", "--json").ended(1).json
    message = [case["expected"] for case in report["cases"] if case["verdict"] == "failed"]
    assert message and all("end it by hand" in text and "exit 4" in text for text in message), message
