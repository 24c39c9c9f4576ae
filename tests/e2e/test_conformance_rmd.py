"""`motorlink conformance rmd`: simulated motors pass, wrong ones are told apart, none is moved."""

import json
import os
import subprocess
import xml.etree.ElementTree as ElementTree

import pytest

from peers import device, slcan_adapter
from program import environment, eventually

STATUS_1 = "9A19000F00000000"
STATUS_1_OF_24_V = "9A1900F000000000"
STATUS_2 = "9C19000000000000"


@pytest.fixture
def check(run):
    """Puts a motor through the cases."""

    def check(port, *arguments):
        return run("conformance", "rmd", "-p", f"slcan:{port}", *arguments)

    return check


class Peer:
    """A motor with ID 1 that answers a few commands, and notes what it is sent."""

    def __init__(self, replies, identifier="141"):
        self.replies = replies
        self.identifier = identifier
        self.sent = []

    def __call__(self, frame):
        self.sent.append(frame)
        data = self.replies.get(frame[5:7]) if frame.startswith("t1418") else None
        return [f"t{self.identifier}8{data}"] if data else []


def test_a_simulated_motor_passes_and_is_left_alone(check, sim, tmp_path):
    drives = sim(st=())
    before = drives.motor(1)
    junit, saved = tmp_path / "rmd.xml", tmp_path / "rmd.json"
    done = check(drives.can, "--readings", "strict", "--junit", junit, "--json", saved).ended(0)
    assert "needs" in done.out and "--spin" in done.out, "what was skipped says why"
    report = json.loads(saved.read_text())
    assert report["failed"] == report["reading"] == report["not_run"] == 0
    assert report["passed"] > 50 and len(report["cases"]) > 130
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert (suite.get("name"), int(suite.get("failures"))) == ("rmd", 0)
    assert len(suite.findall("testcase")) == len(report["cases"])
    after = drives.motor(1)
    for unmoved in ("angle_degrees", "mode", "rom_writes"):
        assert after[unmoved] == before[unmoved]
    assert after["mode"] == "off"


def test_ctrl_c_switches_the_motor_off(start, sim):
    drives = sim(st=())
    case = "the_acceleration_limit_applies"
    run = start("conformance", "rmd", "-p", f"slcan:{drives.can}", "--spin", "--only", case)
    eventually(lambda: drives.motor(1)["speed_dps"] > 10, "a motor that turns")
    run.interrupt()
    assert run.wait() == 130
    assert drives.motor(1)["mode"] == "off"


def test_a_failure_says_what_was_sent_expected_and_received(check, tmp_path):
    peer = Peer({"9A": STATUS_1, "9C": STATUS_2})
    junit = tmp_path / "rmd.xml"
    with device(tmp_path / "can", slcan_adapter(peer)) as port:
        done = check(port, "--only", "temperature_and_voltage", "--junit", junit).ended(1)
    assert "FAILED" in done.out and "RMD-9A-04" in done.out
    assert "141 [8] 9A 00 00 00 00 00 00 00" in done.out, "what was sent"
    assert "5 V to 100 V, not 1.5 V" in done.out, "what was expected"
    assert "141 [8] 9A 19 00 0F 00 00 00 00" in done.out, "what came"
    assert "0.1 V a digit" in done.out, "what the document demands"
    assert "1 of 1 cases failed" in done.err
    (failure,) = ElementTree.parse(junit).iter("failure")
    assert "< 141 [8] 9A 19 00 0F" in failure.text and "> 141 [8] 9A" in failure.text


class Lenient(Peer):
    """Answers requests of any length, which the document does not forbid (SPEC-NOTES R11)."""

    def __call__(self, frame):
        return super().__call__(f"t1418{frame[5:]}" if frame.startswith("t141") else frame)


def test_a_difference_from_a_reading_is_told_apart_and_fails_if_strict(check, tmp_path):
    peer = Lenient({"9A": STATUS_1_OF_24_V, "9C": STATUS_2})
    files = tmp_path / "rmd.xml", tmp_path / "rmd.json"
    only = ("--only", "frames_of_other_lengths_are_ignored")
    with device(tmp_path / "can", slcan_adapter(peer)) as port:
        apart = check(port, *only, "--junit", files[0], "--json", files[1]).ended(0)
        strict = check(port, *only, "--readings", "strict").ended(1)
    assert "R11" in apart.out and "FAILED" not in apart.out
    (case,) = ElementTree.parse(files[0]).getroot().iter("testcase")
    assert case.find("failure") is None and case.find("skipped").get("type") == "reading"
    assert "R11" in case.find("skipped").get("message")
    report = json.loads(files[1].read_text())
    assert (report["failed"], report["reading"], report["passed"]) == (0, 1, 0)
    (difference,) = report["cases"][0]["differences"]
    assert difference["row"] == "R11" and difference["expected"] == "silence"
    assert "FAILED" in strict.out and "reading  R11" in strict.out


def test_a_motor_of_another_protocol_is_named_and_left_alone(check, tmp_path):
    peer = Peer({"9A": STATUS_1, "9C": STATUS_2}, identifier="241")
    with device(tmp_path / "can", slcan_adapter(peer)) as port:
        done = check(port, "--spin", "--write-rom").ended(3)
    assert "answers as V3/V4 motors do" in done.err
    assert peer.sent == ["t14189C00000000000000"], "one question, and nothing after its answer"


def test_hooks_cycle_the_power_and_cause_faults(check, motorlink, tmp_path):
    """Commands reach a simulator through a FIFO; the hook waits for the answer."""
    fifo, said, port = tmp_path / "commands", tmp_path / "said", tmp_path / "can"
    os.mkfifo(fifo)
    hook = tmp_path / "hook"
    hook.write_text(
        f"seen=$(wc -l < {said})\n"
        f'echo "$1" > {fifo}\n'
        f"until [ $(wc -l < {said}) -gt $seen ]; do sleep 0.01; done\n"
    )
    fault = '{"command":"fault","motor":1,"fault":"LOW_VOLTAGE","hold":%s}'
    commands = os.open(fifo, os.O_RDWR)
    with open(said, "w") as out:
        arguments = [motorlink, "sim", "--stdin", "--rmd", f"slcan-pty:{port}"]
        drives = subprocess.Popen(arguments, stdin=commands, stdout=out, env=environment())
    try:
        eventually(lambda: said.read_text().count("\n"), "the port to be served")
        hooks = (
            *("--power-cycle", f"sh {hook} '{{\"command\":\"power-cycle\"}}'"),
            *("--fault-on", f"sh {hook} '{fault % 'true'}'"),
            *("--fault-off", f"sh {hook} '{fault % 'false'}'"),
        )
        runs = [check(port, "--write-rom", *hooks, "--only", only, "--json").ended(0) for only in ("power", "its_cause")]
    finally:
        drives.terminate()
        drives.wait(10)
        os.close(commands)
    verdicts = {case["name"]: case["verdict"] for done in runs for case in done.json["cases"]}
    for name in (
        "gains_in_ram_are_lost_at_power_off",
        "gains_in_rom_are_kept_over_a_power_cycle",
        "a_new_zero_acts_from_power_on",
        "an_error_stays_while_its_cause_is_present",
        "an_error_is_cleared_when_its_cause_is_gone",
    ):
        assert verdicts[name] == "passed"


def test_a_hook_that_fails_is_told(run):
    case = "gains_in_ram_are_lost_at_power_off"
    done = run("conformance", "rmd", "-p", "sim:", "--only", case, "--power-cycle", "exit 4").ended(0)
    assert "--power-cycle: `exit 4` failed" in done.out
