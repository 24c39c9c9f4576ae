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
    return lambda *words: run("st", "-p", drive.st, *words)


def test_a_torque_command_says_that_the_mode_changes(st, run, tmp_path):
    said = st("--speed-limit", 2000, "current-reference", 100, 0).ended(0).out
    assert "now in TORQUE mode: the load decides the speed; --speed-limit does not apply" in said
    assert "limit" not in st("current-reference", 100, 0).ended(0).out
    for write in (("TORQUE_REF", 100), ("CONTROL_MODE", "TORQUE")):
        assert "now in TORQUE mode" in st("set", *write).ended(0).out
    assert "TORQUE mode" not in st("set", "CONTROL_MODE", "SPEED").ended(0).out
    config = tmp_path / "mcsdk.toml"
    config.write_text('profile = "mcsdk-5.4"\n')
    said = run("st", "-p", f"sim:{config}", *PROFILE, "--speed-limit", 2000, "torque-ramp", 100, 50).ended(0).out
    assert "now in TORQUE mode" in said and "--speed-limit does not apply" in said


def test_a_start_names_the_mode_that_a_stop_has_left(st, drive):
    def stop():
        st("stop").ended(0)
        eventually(lambda: drive.motor(1)["status"] == "IDLE", "rest")

    assert "in SPEED mode" in st("start").ended(0).out
    st("current-reference", 300, 0).ended(0)
    stop()
    started = st("--json", "start").ended(0).json["values"]
    assert started["CONTROL_MODE"]["name"] == "TORQUE" and started["TORQUE_REF"]["value"] == 300
    stop()
    assert "in TORQUE mode, Iq 300 s16A; the load decides the speed" in st("start").ended(0).out


def test_a_ramp_is_read_back(run, sim, st):
    assert "drive's highest speed is 6000 rpm" in st("ramp", 20000, 1000).ended(0).out
    assert "highest" not in st("ramp", 1500, 1000).ended(0).out
    assert "in 1000 ms" in st("ramp", 1500, "1s").ended(0).out
    port = sim("--profile", "mcsdk-5.4", rmd=(), st=("tcp",)).port("tcp")
    firmware = lambda *words: run("st", "-p", port, *PROFILE, *words).ended(0)
    assert firmware("ramp", 1000, 500).out.endswith("; the drive holds 996 rpm\n")
    assert firmware("--json", "ramp", 1000, 500).values == {"RAMP_FINAL_SPEED": 996}
    assert firmware("start", "--ramp", 1000, 500).out.endswith("; the drive holds 996 rpm\n")


def test_a_speed_that_no_drive_can_hold_is_refused(st):
    for command in (("ramp", -196_603, 100), ("start", "--ramp", 99_999_999, 100)):
        refused = st("--trace", *command).ended(2).err
        assert "give -196602 to 196602 rpm" in refused and "SET_RAMP" not in refused


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
    by_environment = {"MOTORLINK_PORT": port, "MOTORLINK_PROFILE": "mcsdk-5.4"}
    assert "`motorlink st start`" in run("st", "position", "1rad", "1s", "--wait", **by_environment).ended(1).err
    limited = run("st", *words, "--speed-limit", 900, "start").ended(2).err
    assert f"`motorlink st -p {port} --profile mcsdk-5.4 --speed-limit 900 --motor 2 start --ramp" in limited


def test_info_names_the_profile_of_the_firmware(run, sim, st):
    port = sim("--profile", "mcsdk-5.4", rmd=(), st=("tcp",)).port("tcp")
    assert "add --profile mcsdk-5.4" in run("st", "-p", port, "info").ended(0).err
    assert run("st", "-p", port, *PROFILE, "info").ended(0).err == ""
    assert st("info").ended(0).err == ""
    assert "add --profile spec" in st(*PROFILE, "info").ended(0).err
