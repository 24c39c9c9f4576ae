"""What a command leaves a drive in: its control mode, its ramp, and what the program says about them."""

import pytest

from peers import device
from program import eventually
from st_wire import ACK, GET_REG, frame

PROFILE = ("--profile", "mcsdk-5.4")


@pytest.fixture
def drive(sim):
    return sim(rmd=())


@pytest.fixture
def st(run, drive):
    return lambda *words: run("st", "-p", drive.port("pty"), *words)


def at_rest(st):
    eventually(lambda: st("--json", "get", "STATUS").ended(0).values["STATUS"] == 0, "rest")


def test_a_torque_command_says_that_the_mode_changes(st):
    said = st("--speed-limit", 2000, "current-reference", 100, 0).ended(0).out
    assert "now in TORQUE mode: the load decides the speed; --speed-limit does not apply" in said
    assert "limit" not in st("current-reference", 100, 0).ended(0).out
    for write in (("TORQUE_REF", 100), ("CONTROL_MODE", "TORQUE")):
        assert "now in TORQUE mode" in st("set", *write).ended(0).out
    assert "TORQUE mode" not in st("set", "CONTROL_MODE", "SPEED").ended(0).out


def test_a_torque_ramp_says_that_the_mode_changes(run, sim):
    port = sim("--profile", "mcsdk-5.4", rmd=()).port("pty")
    said = run("st", "-p", port, *PROFILE, "--speed-limit", 2000, "torque-ramp", 100, 50).ended(0).out
    assert "now in TORQUE mode" in said and "--speed-limit does not apply" in said


def test_a_start_names_the_mode_that_a_stop_has_left(st):
    assert "in SPEED mode" in st("start").ended(0).out
    st("current-reference", 300, 0).ended(0)
    st("stop").ended(0)
    at_rest(st)
    started = st("--json", "start").ended(0).json["values"]
    assert started["CONTROL_MODE"]["name"] == "TORQUE" and started["TORQUE_REF"]["value"] == 300
    st("stop").ended(0)
    at_rest(st)
    assert "in TORQUE mode, Iq 300 s16A; the load decides the speed" in st("start").ended(0).out
    st("stop").ended(0)
    assert "a start needs a speed ramp" in st("--speed-limit", 2000, "start").ended(2).err


def test_a_ramp_is_read_back(run, sim, st):
    assert "drive's highest speed is 6000 rpm" in st("ramp", 20000, 1000).ended(0).out
    assert "highest" not in st("ramp", 1500, 1000).ended(0).out
    port = sim("--profile", "mcsdk-5.4", rmd=(), st=("tcp",)).port("tcp")
    firmware = lambda *words: run("st", "-p", port, *PROFILE, *words).ended(0)
    assert firmware("ramp", 1000, 500).out.endswith("; the drive holds 996 rpm\n")
    assert firmware("--json", "ramp", 1000, 500).values == {"RAMP_FINAL_SPEED": 996}
    assert firmware("start", "--ramp", 1000, 500).out.endswith("; the drive holds 996 rpm\n")


@pytest.mark.parametrize("rpm", [196_603, 99_999_999, -2_000_000_000])
def test_a_speed_that_no_drive_can_hold_is_refused(st, rpm):
    for command in (("ramp", rpm, 100), ("start", "--ramp", rpm, 100)):
        refused = st("--trace", *command).ended(2).err
        assert "give -196602 to 196602 rpm" in refused and "SET_RAMP" not in refused


def test_an_unknown_mode_is_not_written(st):
    refused = st("--trace", "set", "CONTROL_MODE", 7).ended(2).err
    assert "TORQUE and SPEED are" in refused and "SET_REG" not in refused


def test_a_mode_that_the_drive_ignores_is_an_error(run, tmp_path):
    sizes = {0x01: 4, 0x02: 1, 0x03: 1}

    def stubborn(received):
        code = received[0] & 0x1F
        size = {0x06: 32, GET_REG: sizes.get(received[2], 0)}.get(code, 0)
        return frame(ACK, bytes(size))

    with device(tmp_path / "stubborn", stubborn) as port:
        refused = run("st", "-p", port, "set", "CONTROL_MODE", "SPEED").ended(1).err
    assert "CONTROL_MODE should be 1 and reads 0" in refused


def test_raw_says_what_it_sent(st):
    assert st("raw", "03", "01").ended(0).out == (
        "ACK; sent EXECUTE_CMD START_MOTOR, motor 1; the motor may turn now\n"
    )
    assert st("raw", "03", "02").ended(0).out == "ACK; sent EXECUTE_CMD STOP_MOTOR, motor 1\n"
    assert "sent" not in st("raw", "02", "1e").ended(0).out


def test_fault_ack_says_what_it_acknowledged(st, drive):
    assert st("fault-ack").ended(0).out == "motor 1: there were no faults\n"
    drive.do("fault", motor=1, fault="SPEED_FDBK")
    eventually(lambda: drive.motor(1)["status"] == "FAULT_OVER", "the fault")
    assert "SPEED_FDBK (speed feedback lost)" in st("start").ended(1).err
    assert st("fault-ack").ended(0).out == "motor 1: SPEED_FDBK acknowledged, no faults left\n"


def test_hints_repeat_port_motor_and_profile(run, sim):
    port = sim("--profile", "mcsdk-5.4", rmd=()).port("pty")
    words = ("-p", port, *PROFILE, "-m", 2)
    hint = f"`motorlink st -p {port} --profile mcsdk-5.4 --motor 2 start`"
    assert hint in run("st", *words, "position", "1rad", "1s", "--wait").ended(1).err
    by_environment = {"MOTORLINK_PORT": port, "MOTORLINK_PROFILE": "mcsdk-5.4"}
    assert "`motorlink st start`" in run("st", "position", "1rad", "1s", "--wait", **by_environment).ended(1).err
    limited = run("st", *words, "--speed-limit", 900, "start").ended(2).err
    assert f"`motorlink st -p {port} --profile mcsdk-5.4 --speed-limit 900 --motor 2 start --ramp" in limited


def test_durations_may_have_a_unit(st):
    assert "in 1000 ms" in st("ramp", 1500, "1s").ended(0).out
    assert "in 20 ms" in st("ramp", 1500, "20ms").ended(0).out
    assert "in 30 ms" in st("ramp", 1500, 30).ended(0).out
    assert "whole number of ms" in st("ramp", 1500, "70s").ended(2).err
    st("start", "--ramp", 1500, "1s").ended(0)
    for ramp in (("1s", 1500), (1500, "soon"), (1500, 70000)):
        assert "nothing was sent" in st("start", "--ramp", *ramp).ended(2).err
    st("stop").ended(0)


def test_status_can_be_repeated(st):
    rows = st("--json", "status", "--every", "10ms", "--count", 3).ended(0).lines
    assert [set(row["values"]) >= {"STATUS", "FLAGS", "SPEED_MEAS"} for row in rows] == [True] * 3
    assert rows[0]["t"] < rows[2]["t"]


def test_info_names_the_profile_of_the_firmware(run, sim, st):
    port = sim("--profile", "mcsdk-5.4", rmd=(), st=("tcp",)).port("tcp")
    assert "add --profile mcsdk-5.4" in run("st", "-p", port, "info").ended(0).err
    assert run("st", "-p", port, *PROFILE, "info").ended(0).err == ""
    assert st("info").ended(0).err == ""
    assert "add --profile spec" in st(*PROFILE, "info").ended(0).err


def test_a_pattern_of_registers_is_explained(st):
    assert "`motorlink st registers 'SPEED_*'`" in st("get", "SPEED_*").ended(2).err


def test_a_scan_of_a_pty_asks_once(st):
    scanned = st("scan").ended(0)
    assert len(scanned.out.splitlines()) == 1 and "has no baud rate" in scanned.err
