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


def test_each_port_has_drives_of_its_own(sim, tmp_path):
    ports = [f"pty:{tmp_path}/{name}" for name in ("a", "b")]
    drives = sim(st=ports, rmd=())
    with Line(f"{tmp_path}/a") as a, Line(f"{tmp_path}/b") as b:
        a.set(CONTROL_MODE, 0, 1)
        a.set(0x05, 77, 2)
        assert (a.get(0x05), b.get(0x05) == 77) == (77, False)
    drives.do("supply", port=ports[1], motor=2, volts=28)
    eventually(lambda: drives.motor(2, ports[1])["bus_volts"] > 27.9, "the capacitor is full")
    assert drives.motor(2, ports[0])["bus_volts"] == close_to(24)


def test_a_serial_line_over_tcp_has_one_client_at_a_time(sim):
    address = sim(st=("tcp",), rmd=()).st_address
    url = f"socket://{address}"
    with Line(url) as first:
        assert first.get(CONTROL_MODE) == 1
        host, _, port = address.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=5) as second:
            assert second.recv(1) == b"", "the second is closed at once"
        assert first.get(CONTROL_MODE) == 1
    with Line(url) as third:
        assert third.get(CONTROL_MODE) == 1


def test_what_a_client_left_unread_is_not_shown_to_the_next(sim):
    port = sim(rmd=()).st
    with Line(port) as first:
        first.send(frame(0x02, [CONTROL_MODE]) * 3)
        eventually(lambda: first.port.in_waiting == 3 * 4, "three replies")
    with Line(port) as second:
        assert second.ask(frame(0x06))[1] == 32


# Ends.


def test_the_end_of_stdin_ends_it_and_removes_its_links(sim, tmp_path):
    drives = sim("--stdin")
    drives.process.stdin.close()
    assert drives.wait() == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_removes_its_links(sim, tmp_path, number):
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


def test_a_stale_link_is_replaced(sim, tmp_path):
    sim(rmd=()).kill()
    assert (tmp_path / "st0").is_symlink()
    with Line(sim(rmd=()).st) as line:
        assert line.get(CONTROL_MODE) == 1


def test_a_link_that_another_serves_is_left_alone(sim, run):
    first = sim(rmd=())
    assert "served already" in run("sim", "--stdin", "--st", f"pty:{first.st}").ended(3).err
    with Line(first.st) as line:
        assert line.get(CONTROL_MODE) == 1


@pytest.mark.parametrize("kind", ["file", "folder", "link to a file"])
def test_what_is_no_link_to_a_pty_is_not_overwritten(run, tmp_path, kind):
    path = tmp_path / "st0"
    (tmp_path / "precious").write_text("kept")
    if kind == "file":
        path.write_text("kept")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to(tmp_path / "precious")
    told = run("sim", "--stdin", "--st", f"pty:{path}").ended(3).err
    assert "is not a link to a pty" in told
    assert path.is_dir() or path.read_text() == "kept"


@pytest.mark.parametrize(
    "arguments, told, code",
    [
        ("--st slcan-pty:x", "serial line", 2),
        ("--rmd pty:x", "CAN bus", 2),
        ("--st /dev/ttyUSB0", "pty:PATH", 2),
        ("--st tcp-listen:127.0.0.1:port", "65535", 2),
        ("--st pty:/no/such/folder/st0", "/no/such/folder", 3),
        ("--profile v9", "spec and mcsdk-5.4", 2),
        ("no-such.toml", "cannot read `no-such.toml`", 2),
    ],
)
def test_what_cannot_be_served_is_told(run, tmp_path, monkeypatch, arguments, told, code):
    monkeypatch.chdir(tmp_path)
    assert told in run("sim", "--stdin", *arguments.split()).ended(code).err
    assert list(tmp_path.iterdir()) == []


def test_a_path_is_served_once(run, tmp_path):
    port = f"pty:{tmp_path}/st0"
    assert run("sim", "--stdin", "--st", port, "--st", port).code in (2, 3)


def test_a_tcp_port_that_is_taken_is_told(run, sim):
    address = sim(st=("tcp",), rmd=()).st_address
    told = run("sim", "--stdin", "--st", f"tcp-listen:{address}").ended(3).err
    assert "is taken by another program" in told


# Configuration.


def test_the_configuration_says_what_the_drives_are(sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("""
        profile = "mcsdk-5.4"
        [[st.motor]]
        preset = "servo"
        plant.supply.voltage = 28.0
        registers.speed_kp = 1234
        [[rmd.motor]]
        id = 32
        preset = "rmd-x8"
        plant.supply.voltage = 36.0
        plant.machine.pole_pairs = 7
    """)
    drives = sim(config)
    st, rmd = drives.ports
    assert (st["motors"], st["profile"], rmd["motors"]) == ([1], "mcsdk-5.4", [32])
    assert drives.motor(1, st["port"])["bus_volts"] == close_to(28)
    assert drives.motor(32, rmd["port"])["supply_volts"] == close_to(36)
    with Line(drives.st) as line:
        assert line.get(0x05) == 1234


def test_the_profile_of_the_command_line_goes_before_the_configurations(sim, tmp_path):
    (tmp_path / "bench.toml").write_text('profile = "mcsdk-5.4"')
    drives = sim(tmp_path / "bench.toml", "--profile", "spec", rmd=())
    assert drives.ports[0]["profile"] == "spec"


@pytest.mark.parametrize(
    "text, place",
    [
        ("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nidd = 3", ["rmd.motor 2", "idd"]),
        ("[[st.motor]]\nplant.machine.poles = 3", ["st.motor 1", "poles"]),
        ('[[st.motor]]\npreset = "big"', ["st.motor 1", "servo"]),
        ('[[st.motor]]\nplant.supply.voltage = "high"', ["st.motor 1", "high"]),
        ("[[rmd.motor]]\nid = 33", ["rmd.motor 1", "id is 1 to 32", "33"]),
        ("[[rmd.motor]]\nid = 3\n[[rmd.motor]]\nid = 3", ["same ID"]),
        ("[[st.motor]]\n" * 8, ["1 to 7 motors"]),
        ("[st]\nmotor = []", ["1 to 7 motors"]),
        ("profile = 'v9'", ["line 1", "v9"]),
        ("profile = 'spec'\nst = [", ["line 2"]),
        ("colour = 'red'", ["line 1", "colour"]),
    ],
)
def test_a_configuration_error_names_its_place(run, tmp_path, text, place):
    config = tmp_path / "bench.toml"
    config.write_text(text)
    told = run("sim", "--stdin", config, "--st", f"pty:{tmp_path}/st0").ended(2).err
    assert "bench.toml" in told, told
    assert all(word in told for word in place), told
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


def test_time_passes_while_nobody_talks(rmd):
    started = rmd.do("state")["t"]
    eventually(lambda: rmd.do("state")["t"] > started + 0.1, "time passes")


def test_supply_sets_the_voltage(st, rmd):
    st.do("supply", motor=1, volts=300)
    eventually(lambda: st.motor(1)["bus_volts"] < 300.1, "the board empties the capacitor")
    assert st.motor(1)["bus_volts"] > 299.9
    rmd.do("supply", motor=4, volts=12.5)
    eventually(lambda: abs(rmd.motor(4)["supply_volts"] - 12.5) < 0.01, "the capacitor is empty")


def test_temperature_is_shown_until_it_is_taken_back(st, rmd):
    for drives in (st, rmd):
        drives.do("temperature", motor=1, celsius=61)
        assert drives.motor(1)["celsius"] == 61
        drives.do("temperature", motor=1)
        assert drives.motor(1)["celsius"] == 25
        drives.do("temperature", motor=1, celsius=None)


def test_load_and_lock_rotor_hold_the_motor(st, rmd):
    for drives in (st, rmd):
        drives.do("load", motor=2, newton_metres=0.5)
        drives.do("lock-rotor", motor=2, locked=True)
        assert (drives.motor(2)["load_newton_metres"], drives.motor(2)["locked"]) == (0.5, True)
        drives.do("lock-rotor", motor=2, locked=False)
        assert not drives.motor(2)["locked"]
        assert drives.motor(1)["load_newton_metres"] == 0


def test_a_fault_happens_once_or_is_held(st, rmd):
    st.do("fault", motor=1, fault="BREAK_IN")
    eventually(lambda: st.motor(1)["status"] == "FAULT_OVER", "the fault is over")
    st.do("fault", motor=2, fault="over_temp", hold=True)
    eventually(lambda: st.motor(2)["status"] == "FAULT_NOW", "the fault stays")
    assert "OVER_TEMP" in st.motor(2)["faults"]["present"]
    st.do("fault", motor=2, fault="OVER_TEMP", hold=False)
    eventually(lambda: st.motor(2)["status"] == "FAULT_OVER", "the cause is gone")

    rmd.do("fault", motor=1, fault="LOW_VOLTAGE")
    rmd.do("fault", motor=2, fault="over_temperature")
    eventually(lambda: rmd.motor(1)["errors"] == ["LOW_VOLTAGE"], "the low voltage flag")
    eventually(lambda: rmd.motor(2)["errors"] == ["OVER_TEMPERATURE"], "the temperature flag")


def test_a_power_cycle_is_for_the_drive_or_for_a_motor_on_the_bus(st, rmd):
    with Line(st.st) as line:
        line.set(0x05, 77, 2)
        st.do("power-cycle")
        assert line.get(0x05) != 77
    assert "one supply" in st.command("power-cycle", motor=1)["error"]["message"]
    rmd.do("power-cycle")
    rmd.do("power-cycle", motor=3)


@pytest.mark.parametrize(
    "line, why",
    [
        ("garbage", "not a command"),
        ("{", "not a command"),
        ("[]", "not a command"),
        ("{}", "command"),
        ('{"command": "explode"}', "unknown variant `explode`"),
        ('{"command": "supply", "motor": 1}', "volts"),
        ('{"command": "supply", "motor": 1, "volts": "high"}', "high"),
        ('{"command": "supply", "motor": 1, "volts": 3, "amps": 1}', "amps"),
        ('{"command": "supply", "motor": 300, "volts": 3}', "300"),
        ('{"command": "supply", "volts": 3}', "motor"),
        ('{"command": "supply", "motor": 9, "volts": 3}', "motor 9 is not on this bus"),
        ('{"command": "supply", "motor": 0, "volts": 3}', "motor 0 is not on this bus"),
        ('{"command": "power-cycle", "motor": 33}', "motor 33 is not on this bus"),
        ('{"command": "fault", "motor": 1, "fault": "FIRE"}', "LOW_VOLTAGE, OVER_TEMPERATURE"),
        ('{"command": "state", "port": "pty:nowhere"}', "`pty:nowhere` is not served"),
    ],
)
def test_a_line_that_cannot_be_obeyed_says_why_and_changes_nothing(rmd, line, why):
    answer = rmd.say(line)
    assert not answer["ok"] and why in answer["error"]["message"]
    assert rmd.motor(1)["supply_volts"] == close_to(24)


def test_among_several_ports_the_one_meant_has_to_be_named(sim):
    drives = sim()
    asked = drives.command("supply", motor=1, volts=20)
    assert not asked["ok"] and all(port["port"] in asked["error"]["message"] for port in drives.ports)
    drives.do("supply", port=drives.ports[1]["port"], motor=1, volts=20)


def test_two_ports_of_the_same_name_can_both_be_commanded(sim):
    drives = sim(st=("tcp", "tcp"), rmd=())
    for number, port in enumerate(drives.ports):
        drives.do("supply", port=port["port"], motor=1, volts=330 + number)

    def volts():
        return [round(bench["motors"][0]["bus_volts"], 1) for bench in drives.do("state")["state"]]

    eventually(lambda: volts() == [330, 331], "both capacitors are full")


def test_several_commands_at_once_are_answered_in_order(rmd):
    lines = ['{"command":"state"}', "garbage", "", '{"command":"power-cycle"}']
    rmd.process.stdin.write("\n".join(lines[:-1]) + "\n")
    assert rmd.say(lines[-1])["ok"]
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
