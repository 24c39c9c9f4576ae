"""`motorlink conformance host`: programs before drives that misbehave."""

import json
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

HOSTS = Path(__file__).parent / "hosts"
WITHIN = 120


def python(name, *arguments):
    return ["--", sys.executable, str(HOSTS / name), "{path}", *map(str, arguments)]


@pytest.fixture
def check(run, tmp_path):
    """Puts a host through scenarios; gives the exit code and each verdict by name."""
    served = {"st": f"pty:{tmp_path}/st0", "rmd": f"slcan-pty:{tmp_path}/can0"}

    def check(which, *arguments):
        done = run(
            *("conformance", "host", which, "--serve", served[which], "--json", *arguments),
            within=WITHIN,
        )
        assert "panicked" not in done.err
        return done.code, {case["name"]: case for case in done.json["cases"]}

    return check


def failed(cases):
    """What was found in each case that failed, by its name."""
    failures = (case for case in cases.values() if case["verdict"] == "failed")
    return {case["name"]: (case["received"], case["transcript"]) for case in failures}


# Our own command line.


def test_our_client_passes_every_scenario(check, motorlink):
    start = f"{motorlink} st --timeout 400ms start"
    get = ["--", motorlink, "st", "--timeout", "400ms", "get", *["SPEED_MEAS"] * 4]
    code, cases = check("st", "--timeout", "400ms", "--start", start, *get)
    assert failed(cases) == {}
    assert code == 0
    assert {case["verdict"] for case in cases.values()} == {"passed"}


def test_our_client_reads_on_when_the_line_is_back(check, motorlink):
    words = "st get SPEED_MEAS --every 20ms --count 4 --timeout 300ms".split()
    for only in ("late", "cut_off"):
        code, cases = check("st", "--only", only, "--timeout", "300ms", "--", motorlink, *words)
        assert failed(cases) == {}
        assert code == 0


def test_our_bus_passes_every_scenario_for_one_motor(check, motorlink):
    angle = "rmd --timeout 400ms angle --every 5ms --count 4"
    echo = f"{motorlink} {angle} -p $MOTORLINK_PORT?echo=1"
    off = f"{motorlink} rmd --timeout 400ms --id 1 off"
    message = ["--timeout", "400ms", "--field", 2, "--echo", echo, "--off", off]
    code, cases = check("rmd", *message, "--", motorlink, *angle.split())
    assert failed(cases) == {}
    assert code == 0
    assert sum(case["verdict"] == "passed" for case in cases.values()) == 20


# Typical hosts. The timeout of the naive ones is shorter than the drive's timeout, so that on a busy
# machine, too, a late reply comes after that.


def test_a_naive_host_of_the_serial_protocol_is_caught(check):
    code, cases = check("st", "--timeout", "300ms", *python("naive_st.py", 0.2))
    assert code == 1
    assert cases["every_reading_has_its_own_value"]["verdict"] == "passed"
    assert failed(cases).keys() >= {
        "a_late_reply_is_not_matched_to_the_next_request",
        "a_reply_together_with_the_next_one_is_not_matched_to_the_next_request",
        "a_duplicate_reply_is_not_matched_to_the_next_request",
        "a_damaged_checksum_is_an_error",
        "a_damaged_value_is_an_error",
        "an_unknown_header_is_an_error",
        "a_flood_of_acknowledges_is_dropped",
        "a_line_that_echoes_is_not_read_as_a_drive",
    }
    copy = cases["a_duplicate_reply_is_not_matched_to_the_next_request"]
    assert "twice" in copy["received"]
    assert "22 01 1e 41" in copy["sent"]
    assert any("drive f0 04" in line for line in copy["transcript"])
    assert any(line.startswith("stdout: ") for line in copy["transcript"])


def test_a_careful_host_of_the_serial_protocol_passes(check):
    code, cases = check("st", "--timeout", "400ms", *python("careful_st.py", 0.4))
    assert failed(cases) == {}
    assert code == 0
    skipped = {name for name, case in cases.items() if case["verdict"] == "skipped"}
    assert all(name.startswith("a_start") for name in skipped) and len(skipped) == 3


def test_hosts_of_four_motors_are_told_apart(check):
    host = f"{sys.executable} {HOSTS}/naive_cycle.py {{path}} 0.4"
    code, cases = check("rmd", "--only", "[a cycle]", "--timeout", "400ms", "--cycle", host, "--", "true")
    assert code == 1
    mixed = "replies_in_any_order_find_their_motors[a cycle]"
    assert failed(cases).keys() >= {mixed, "frames_of_other_motors_are_dropped[a cycle]"}
    told = re.search(r"for motor (\d); it was sent by motor (\d)", cases[mixed]["received"])
    assert told and told[1] != told[2], cases[mixed]


# How a program may end.


def test_a_host_that_hangs_crashes_talks_for_ever_or_starts_the_motor_has_failed(check, motorlink):
    name = "every_reading_has_its_own_value"
    for limit, command, said in (
        ("300ms", "sleep 60 & sleep 60", "did not end within 300ms"),
        ("300ms", "exec yes 7", "7, which was in no reply"),
        ("20s", "kill -SEGV $$", "signal 11"),
        ("20s", f"{motorlink} st start >/dev/null", "sent START_MOTOR 1 times"),
    ):
        code, cases = check("st", "--only", name, "--limit", limit, "--", "sh", "-c", command)
        assert code == 1 and said in cases[name]["received"], cases


def test_a_host_that_only_complains_has_passed_nothing(check):
    code, cases = check("st", "--limit", "2s", "--start", "false", "--", "false")
    assert code == 1
    assert failed(cases).keys() == set(cases)


def test_a_host_is_not_blamed_when_this_machine_is_too_busy(check, tmp_path):
    """The host freezes the kit and gives up meanwhile: once, or whenever it is tried."""
    message = ["--timeout", "300ms", "--only", "every_reading", *python("freezing_st.py", 0.3)]
    code, cases = check("st", *message, tmp_path / "was-frozen")
    assert (code, failed(cases)) == (0, {})
    code, cases = check("st", *message)
    assert code == 3
    (case,) = cases.values()
    assert case["verdict"] == "not-run" and "too busy" in case["why"]


def test_a_program_that_is_not_there_is_a_usage_error(run, tmp_path):
    words = ["conformance", "host", "st", "--serve", f"pty:{tmp_path}/st0", "--", "./not-there"]
    assert "./not-there" in run(*words).ended(2).err


def test_results_go_to_files_and_the_screen_explains_a_failure(run, tmp_path):
    junit, results = tmp_path / "host.xml", tmp_path / "host.json"
    done = run(
        *("conformance", "host", "st", "--serve", "tcp-listen:127.0.0.1:0"),
        *("--only", "every_reading", "--junit", junit, "--json", results),
        *("--", "sh", "-c", "echo $MOTORLINK_PORT $1 7", "sh", "{port}"),
    ).ended(1)
    assert "FAILED" in done.out and "7, which was in no reply" in done.out
    assert json.loads(results.read_text())["failed"] == 1
    case = ElementTree.parse(junit).find(".//testcase")
    assert case.find("failure") is not None
    assert "stdout: tcp:127.0.0.1:" in case.find("failure").text


def test_the_document_has_every_scenario(run):
    document = (Path(__file__).parents[2] / "docs/HOST-CONFORMANCE.md").read_text()
    for which in ("st", "rmd"):
        assert run("conformance", "scenarios", which).ended(0).out in document
