"""`motorlink sim`: its ports, its configuration, and the world that commands on stdin change."""

import os
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from program import eventually
from st_wire import EXECUTE, Line, frame

CONTROL_MODE = 0x03
SPEED_MEAS = 0x1E


def close_to(volts):
    """The voltage of a bus from which only the board takes a current."""
    return pytest.approx(volts, abs=0.01)


def test_each_port_is_announced_when_it_can_be_opened(sim, tmp_path):
    drives = sim(st=("pty", "tcp"), rmd=("slcan-pty", "tcp"))
    st, st_tcp, rmd, rmd_tcp = drives.ports
    assert st["path"].startswith("/dev/pts/")
    assert st == {
        **{"port": f"pty:{tmp_path}/st0", "protocol": "st", "motors": [1, 2], "profile": "spec"},
        "path": os.readlink(tmp_path / "st0"),
    }
    assert rmd == {
        **{"port": f"slcan-pty:{tmp_path}/can0", "protocol": "rmd", "motors": [1, 2, 3, 4]},
        "path": os.readlink(tmp_path / "can0"),
    }
    for port in (st_tcp, rmd_tcp):
        host, _, number = port["path"].rpartition(":")
        socket.create_connection((host, int(number)), timeout=5).close()


def test_without_ports_it_serves_one_of_each_kind_here(start, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drives = start("sim")
    assert "pty:./st0" in drives.line(0) and "slcan-pty:./can0" in drives.line(1)
    assert Path("st0").is_symlink() and Path("can0").is_symlink()


def test_each_port_has_drives_of_its_own_and_has_to_be_named(sim, tmp_path):
    ports = [f"pty:{tmp_path}/{name}" for name in ("a", "b")]
    drives = sim(st=ports, rmd=())
    with Line(f"{tmp_path}/a") as a, Line(f"{tmp_path}/b") as b:
        a.set(CONTROL_MODE, 0, 1)
        a.set(0x05, 77, 2)
        assert (a.get(0x05), b.get(0x05) == 77) == (77, False)
    asked = drives.command("supply", motor=2, volts=28)
    assert not asked["ok"] and all(port in asked["error"]["message"] for port in ports)
    drives.do("supply", port=ports[1], motor=2, volts=28)
    eventually(lambda: drives.motor(2, ports[1])["bus_volts"] > 27.9, "the capacitor is full")
    assert drives.motor(2, ports[0])["bus_volts"] == close_to(24)


def test_two_ports_of_the_same_name_can_both_be_commanded(sim):
    drives = sim(st=("tcp", "tcp"), rmd=())
    for number, port in enumerate(drives.ports):
        drives.do("supply", port=port["port"], motor=1, volts=330 + number)

    def volts():
        return [round(bench["motors"][0]["bus_volts"], 1) for bench in drives.do("state")["state"]]

    eventually(lambda: volts() == [330, 331], "both capacitors are full")


# Ends.


def test_the_end_of_stdin_ends_it_and_removes_its_links(sim, tmp_path):
    drives = sim("--stdin")
    drives.process.stdin.close()
    assert drives.wait() == 0
    assert list(tmp_path.iterdir()) == []


def test_a_signal_ends_it_and_removes_its_links(sim, tmp_path):
    for number in (signal.SIGINT, signal.SIGTERM):
        drives = sim()
        drives.process.send_signal(number)
        assert drives.wait() == 0
        assert list(tmp_path.iterdir()) == []


def test_without_stdin_it_outlives_its_input(sim):
    drives = sim()
    drives.process.stdin.close()
    drives.process.stdin = None
    with Line(drives.st) as line:
        assert line.get(CONTROL_MODE) == 1
    assert drives.process.poll() is None


def test_a_link_that_another_serves_is_left_alone(sim, run):
    first = sim(rmd=())
    assert "served already" in run("sim", "--stdin", "--st", f"pty:{first.st}").ended(3).err
    with Line(first.st) as line:
        assert line.get(CONTROL_MODE) == 1


def test_what_cannot_be_served_is_told(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for arguments, told, code in (
        ("--st slcan-pty:x", "serial line", 2),
        ("--rmd pty:x", "CAN bus", 2),
        ("--st pty:/no/such/folder/st0", "/no/such/folder", 3),
        ("--st pty:x --st pty:x", "", 3),
        ("--profile v9", "spec and mcsdk-5.4", 2),
        ("no-such.toml", "cannot read `no-such.toml`", 2),
    ):
        assert told in run("sim", "--stdin", *arguments.split()).ended(code).err
    assert list(tmp_path.iterdir()) == []


# Configuration.


def test_the_profile_of_the_command_line_goes_before_the_configurations(sim, tmp_path):
    (tmp_path / "bench.toml").write_text('profile = "mcsdk-5.4"')
    drives = sim(tmp_path / "bench.toml", "--profile", "spec", rmd=())
    assert drives.ports[0]["profile"] == "spec"


def test_a_configuration_error_names_its_place(run, tmp_path):
    config = tmp_path / "bench.toml"
    for text, place in (
        ("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nidd = 3", ["rmd.motor 2", "idd"]),
        ("profile = 'spec'\nst = [", ["line 2"]),
    ):
        config.write_text(text)
        told = run("sim", "--stdin", config, "--st", f"pty:{tmp_path}/st0").ended(2).err
        assert all(word in told for word in ["bench.toml", *place]), told
        assert not (tmp_path / "st0").exists()


def test_a_simulated_port_takes_a_configuration_too(run, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 5\n")
    found = run("rmd", "-p", f"sim:{config}", "--json", "scan").ended(0).json
    assert found["motor"] == 5
    config.write_text("[[rmd.motor]]\nid = 50\n")
    assert "1 to 32" in run("rmd", "-p", f"sim:{config}", "scan").ended(3).err


# Commands on stdin.


@pytest.fixture
def st(sim):
    return sim(rmd=())


@pytest.fixture
def rmd(sim):
    return sim(st=())


def test_state_tells_what_is_really_going_on(sim):
    answer = sim().do("state")
    assert answer["t"] > 0
    st, rmd = answer["state"]
    assert [motor["motor"] for motor in st["motors"]] == [1, 2]
    assert set(st["motors"][0]) == {
        *("motor", "status", "faults", "speed_rpm", "speed_reference_rpm", "angle_degrees"),
        *("iq_amps", "id_amps", "bus_volts", "celsius", "load_newton_metres", "locked"),
        *("iq_reference_amps", "id_reference_amps", "phase_amps", "torque_newton_metres"),
        *("chopping", "winding_celsius"),
    }
    assert [motor["motor"] for motor in rmd["motors"]] == [1, 2, 3, 4]
    assert set(rmd["motors"][0]) == {
        *("motor", "mode", "errors", "speed_dps", "speed_reference_dps", "angle_degrees"),
        *("iq_amps", "supply_volts", "celsius", "load_newton_metres", "locked", "rom_writes"),
        *("output_degrees", "id_amps", "phase_amps", "torque_newton_metres", "chopping"),
        "winding_celsius",
    }


def test_the_world_of_both_kinds_of_drives_is_changed(st, rmd):
    st.do("supply", motor=1, volts=300)
    rmd.do("supply", motor=4, volts=12.5)
    eventually(lambda: st.motor(1)["bus_volts"] < 300.1, "the board empties the capacitor")
    assert st.motor(1)["bus_volts"] > 299.9
    eventually(lambda: abs(rmd.motor(4)["supply_volts"] - 12.5) < 0.01, "the capacitor is empty")
    for drives in (st, rmd):
        drives.do("temperature", motor=1, celsius=61)
        assert drives.motor(1)["celsius"] == 61
        drives.do("temperature", motor=1)
        assert drives.motor(1)["celsius"] == 25
        drives.do("temperature", motor=1, celsius=None)
        drives.do("load", motor=2, newton_metres=0.5)
        drives.do("lock-rotor", motor=2, locked=True)
        assert (drives.motor(2)["load_newton_metres"], drives.motor(2)["locked"]) == (0.5, True)
        drives.do("lock-rotor", motor=2, locked=False)
        assert not drives.motor(2)["locked"]
        assert drives.motor(1)["load_newton_metres"] == 0


def test_a_power_cycle_is_for_the_drive_or_for_a_motor_on_the_bus(st, rmd):
    with Line(st.st) as line:
        line.set(0x05, 77, 2)
        st.do("power-cycle")
        assert line.get(0x05) != 77
    assert "one supply" in st.command("power-cycle", motor=1)["error"]["message"]
    rmd.do("power-cycle")
    rmd.do("power-cycle", motor=3)


def test_a_line_that_cannot_be_obeyed_says_why_and_changes_nothing(rmd):
    for line, why in (
        ("garbage", "not a command"),
        ("{", "not a command"),
        ("{}", "command"),
        ('{"command": "explode"}', "unknown variant `explode`"),
        ('{"command": "supply", "motor": 1}', "volts"),
        ('{"command": "supply", "motor": 1, "volts": "high"}', "high"),
        ('{"command": "supply", "motor": 1, "volts": 3, "amps": 1}', "amps"),
        ('{"command": "supply", "motor": 0, "volts": 3}', "motor 0 is not on this bus"),
        ('{"command": "power-cycle", "motor": 33}', "motor 33 is not on this bus"),
        ('{"command": "fault", "motor": 1, "fault": "FIRE"}', "LOW_VOLTAGE, OVER_TEMPERATURE"),
        ('{"command": "state", "port": "pty:nowhere"}', "`pty:nowhere` is not served"),
    ):
        answer = rmd.say(line)
        assert not answer["ok"] and why in answer["error"]["message"], line
    assert rmd.motor(1)["supply_volts"] == close_to(24)
    # Several at once are answered in order.
    rmd.process.stdin.write('{"command":"state"}\ngarbage\n\n')
    assert rmd.say('{"command":"power-cycle"}')["ok"]
    assert not rmd.say("nothing either")["ok"]


def test_answers_that_nobody_reads_do_not_stop_the_drives(motorlink, tmp_path):
    link = tmp_path / "st0"
    simulator = subprocess.Popen(
        [motorlink, "sim", "--st", f"pty:{link}"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        simulator.stdout.readline()
        os.set_blocking(simulator.stdin.fileno(), False)
        written = b'{"command":"state"}\n' * 2000
        simulator.stdin.raw.write(written[:60000])
        with Line(str(link)) as line:
            for _ in range(20):
                assert line.get(CONTROL_MODE) == 1
        simulator.terminate()
        assert simulator.wait(10) == 0, "it ends although its output is not read"
    finally:
        simulator.kill()
        simulator.wait()


def test_paused_drives_answer_and_stand_still(sim):
    drives = sim(rmd=())
    with Line(drives.st) as line:
        line.ask(frame(EXECUTE, [1]))
        eventually(lambda: drives.motor(1)["speed_rpm"] > 100, "a motor that turns")
        drives.do("pause")
        before = drives.do("state")
        speeds = {line.get(SPEED_MEAS) for _ in range(20)}
        drives.do("pause")
        assert drives.do("state") == before and len(speeds) == 1
        drives.do("resume")
        eventually(lambda: drives.motor(1)["status"] == "RUN", "a start that goes on")
        assert drives.do("state")["t"] > before["t"]
