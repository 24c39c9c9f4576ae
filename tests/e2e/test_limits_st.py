"""Limits of `motorlink st`: --speed-limit and --current-limit."""

import pytest

from program import eventually

PORTS = ["pty", "tcp", "sim"]


@pytest.fixture
def st(run, drives, request):
    """Runs `motorlink st` on a port of the shared drives."""
    port = drives.port(getattr(request, "param", "pty"))
    return lambda *arguments: run("st", "-p", port, *arguments)


on_every_port = pytest.mark.parametrize("st", PORTS, indirect=True)


@on_every_port
@pytest.mark.parametrize(
    "limit, command, message",
    [
        ("--speed-limit 1000", "ramp 1001 100", "1001 rpm is over the limit of 1000 rpm"),
        ("--speed-limit 1000.9", "ramp -1001 100", "-1001 rpm is over the limit of 1000 rpm"),
        ("--speed-limit 1000", "set RAMP_FINAL_SPEED 1001", "over the limit"),
        ("--speed-limit 1000", "set RAMP_FINAL_SPEED 1001 --verify", "over the limit"),
        ("--speed-limit 1000", "revup-data 0 1001 100 100", "over the limit"),
        ("--speed-limit 1000", "start", " start --ramp RPM MS`"),
        ("--speed-limit 1000", "start-stop", " start --ramp RPM MS`"),
        ("--speed-limit 1000", "start --ramp 1001 100", "over the limit"),
        ("--speed-limit 1000", "raw 03 01", " start --ramp RPM MS`"),
        ("--speed-limit 1000", "raw 07 e9 03 00 00 00 00", "over the limit"),
        ("--speed-limit 1000 --profile mcsdk-5.4", "position 1rad 1s", "carries no speed"),
        ("--speed-limit 1000 --profile mcsdk-5.4", "position 1rad 1s --wait", "carries no speed"),
        ("--current-limit 100", "current-reference 0 -101", "-101 s16A is over the limit of 100 s16A"),
        ("--current-limit 100", "revup-data 0 100 101 100", "over the limit"),
        ("--current-limit 100.9", "set TORQUE_REF 101", "over the limit"),
        ("--current-limit 100", "raw 0a 65 00 00 00", "over the limit"),
        ("--current-limit 100 --profile mcsdk-5.4", "torque-ramp 101 100", "over the limit"),
    ],
)
def test_what_exceeds_a_limit_is_not_sent(st, limit, command, message):
    refused = st("--trace", *limit.split(), *command.split()).ended(2)
    assert message in refused.err and "nothing was sent" in refused.err and "->" not in refused.err


@pytest.mark.parametrize("limit", ["--speed-limit=-1", "--speed-limit=nan", "--current-limit=-1", "--current-limit=x"])
def test_a_limit_is_a_number_that_is_not_negative(st, limit):
    assert "give a number without a unit, 0 or more" in st(limit, "status").ended(2).err


@pytest.mark.parametrize(
    "limit, command",
    [
        ("--speed-limit 1000", "ramp -1000 100"),
        ("--speed-limit 1000", "set RAMP_FINAL_SPEED 1000"),
        ("--speed-limit 1000", "stop"),
        ("--current-limit 100", "current-reference 100 -100"),
        ("--current-limit 100", "get TORQUE_REF"),
    ],
)
def test_a_value_equal_to_its_limit_is_sent(run, limit, command):
    run("st", "-p", "sim:", *limit.split(), *command.split()).ended(0)


def test_a_start_under_a_speed_limit_goes_to_its_ramp(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.port("pty"), *arguments)

    assert "0 to 65535 ms" in st("start", "--ramp", 900, 65536).ended(2).err
    st("--speed-limit", 1000, "start", "--ramp", 900, 200).ended(0)

    def speed():
        return st("--json", "--raw", "get", "SPEED_MEAS").ended(0).values["SPEED_MEAS"]

    eventually(lambda: abs(speed() - 900) < 20, "the motor turns at 900 rpm")
    st("stop").ended(0)
