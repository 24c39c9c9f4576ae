"""`motorlink st` as a person and a script use it."""

import threading
import time

import pytest

from peers import device, noise
from program import eventually

PORTS = ["pty", "tcp", "sim"]


@pytest.fixture
def st(run, drives):
    """Runs `motorlink st` on the pty of the shared drives."""
    return lambda *arguments, **options: run("st", "-p", drives.port("pty"), *arguments, **options)


@pytest.fixture
def sim_st(run):
    """Runs `motorlink st` on drives inside its process."""
    return lambda *arguments: run("st", "-p", "sim:", *arguments)


# What reads.


@pytest.mark.parametrize("port", PORTS)
def test_info_names_the_sdk_and_the_firmware(run, drives, port):
    info = run("st", "-p", drives.port(port), "--json", "info").ended(0).json
    assert info["board"] == {"name": "ST MC SDK", "version": [5, 4, 4]}
    assert info["firmware"] == {"name": "ST MC SDK", "version": "Ver.5.4.4"}
    assert "5.4.4" in run("st", "info", MOTORLINK_PORT=drives.port(port)).ended(0).out


def test_status_has_a_value_and_its_unit_or_name(sim_st):
    status = sim_st("--json", "status").ended(0).json["values"]
    assert status["BUS_VOLTAGE"] == {"value": 325, "unit": "V"}
    assert set(status["STATUS"]) == {"value", "name"}
    assert "325 V" in sim_st("status").ended(0).out
    rows = sim_st("--raw", "status").ended(0).out.splitlines()
    assert len(rows) == 10
    assert all(row.split()[1].lstrip("-").isdigit() and len(row.split()) == 2 for row in rows), rows
    rows = sim_st("--json", "status", "--every", "10ms", "--count", 3).ended(0).lines
    assert [set(row["values"]) >= {"STATUS", "FLAGS", "SPEED_MEAS"} for row in rows] == [True] * 3
    assert rows[0]["t"] == 0 and rows[0]["t"] < rows[1]["t"] < rows[2]["t"]


def test_get_reads_registers_by_name_and_by_number(sim_st):
    values = sim_st("--json", "get", "MIN_APP_SPEED", "0x3F").ended(0).json["values"]
    assert values == {
        "MIN_APP_SPEED": {"value": 600, "unit": "rpm"},
        "MAX_APP_SPEED": {"value": 6000, "unit": "rpm"},
    }
    assert sim_st("get", "min_app_speed").ended(0).out.split() == ["MIN_APP_SPEED", "600", "rpm"]
    assert sim_st("--json", "--raw", "get", "STATUS").ended(0).values["STATUS"] in range(21)
    names, units, values = sim_st("get", "MIN_APP_SPEED", "--every", "10ms", "--count", 1).ended(0).out.splitlines()
    assert (names.split(), units.split()) == (["t", "MIN_APP_SPEED"], ["s", "rpm"])
    assert values.split()[1] == "600"


def test_segment_samples_registers_that_cannot_be_read_one_by_one(sim_st):
    sampled = sim_st("--json", "segment", "MIN_APP_SPEED", "I_A", "I_B").ended(0).values
    assert list(sampled) == ["MIN_APP_SPEED", "I_A", "I_B"]
    assert sim_st("segment", "--segment", 3, "I_A").ended(0).out.startswith("I_A")


def test_registers_lists_the_table_without_a_port(run):
    registers = {r["name"]: r for r in run("st", "--json", "registers").ended(0).lines}
    assert registers["SPEED_MEAS"]["id"] == 0x1E
    assert registers["SPEED_MEAS"]["access"] == "R"
    message = run("st", "registers").ended(0).out
    assert message.startswith("id    name ") and "0x1e  SPEED_MEAS" in message
    assert "  D   in data segments and on DAC channels only" in message


@pytest.mark.parametrize(
    "words, names",
    [
        ("speed_kp", {"SPEED_KP", "SPEED_KP_DIV"}),
        ("--access D,W *Q_SPEED*", {"IQ_SPEEDMODE"}),
        ("--feature feed-forward FF_V?", {"FF_VQ", "FF_VD"}),
        ("--access - RAMP", {"RAMP_DURATION"}),
    ],
)
def test_registers_are_filtered_by_name_access_and_feature(run, words, names):
    assert {r["name"] for r in run("st", "--json", "registers", *words.split()).ended(0).lines} == names
    assert "no register matches" in run("st", "registers", "zzz").ended(2).err


def test_scan_tells_what_answers_on_a_port_without_a_rate(st):
    (found,) = (line for line in st("--json", "scan", 115200, 9600).ended(0).lines if "finding" in line)
    assert (found["finding"], found["text"]) == ("drive", "ST MC SDK 5.4.4") and "baud" not in found
    scanned = st("scan").ended(0)
    assert scanned.out == "ST MC SDK 5.4.4\n" and "has no baud rate" in scanned.err


def test_raw_sends_any_frame(sim_st):
    answer = sim_st("--json", "raw", "02", "40").ended(0).json
    assert (answer["ok"], answer["data"]) == (True, "58 02 00 00")
    assert sim_st("raw", "0x02,0x40").ended(0).out == "ACK 58 02 00 00\n"
    assert sim_st("raw", "0340").ended(1).err.count("WRONG_CMD") == 1
    assert "`xy` is not hexadecimal" in sim_st("raw", "xy").ended(2).err
    assert "frame code" in sim_st("raw", "20").ended(2).err


def test_trace_shows_both_directions_on_stderr(st):
    # A request that a busy machine answers late is sent again.
    traced = st("--timeout", "5s", "--trace", "get", "MIN_APP_SPEED").ended(0)
    *opening, sent, received, confirmed, _ = traced.err.splitlines()
    # A line to a drive that may have been asked before is brought in sync first, and what was read is confirmed. A
    # drive whose first answer is late is asked less.
    questions = ["GET_BOARD_INFO", "GET_REG STATUS", "GET_REG FLAGS"]
    asked = [line for line in opening if "->" in line]
    assert all(question in line for question, line in zip(questions[: len(asked) or 1], asked, strict=True))
    assert "-> 06 00 06" in confirmed and "GET_BOARD_INFO" in confirmed
    assert "-> 22 01 40 63" in sent and "GET_REG MIN_APP_SPEED" in sent
    assert "<- f0 04 58 02 00 00" in received and "600 rpm" in received
    assert traced.out.split() == ["MIN_APP_SPEED", "600", "rpm"]


# What acts.


def test_what_is_done_is_said(sim_st):
    for command in ("set DAC_OUT1 I_ALPHA", "revup-data 1 500 200 250", "current 100 -5", "pfc enable", "stop"):
        assert sim_st(*command.split()).ended(0).out.startswith("motor 1")
    assert len(sim_st("revup").ended(0).out.splitlines()) == 5


def test_mcsdk_commands_need_its_profile(run, tmp_path):
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')

    def st(*arguments):
        return run("st", "-p", f"sim:{config}", "--profile", "mcsdk-5.4", *arguments)

    assert st("--json", "torque-ramp", 100, 50).ended(0).json["ok"]
    said = st("move", "-90deg", "500ms").ended(0).out
    assert said.startswith("motor 1: move to -1.5707964 rad (-90.0°) in 0.5 s")
    assert st("info").ended(0).out.count("5.4.4") == 2
    refused = st("--trace", "segment", "STATUS").ended(2)
    assert "--profile spec" in refused.err and "->" not in refused.err
    for command in ("torque-ramp 100 50", "position 1.5rad 0.5s"):
        refused = run("st", "-p", "sim:", "--trace", *command.split()).ended(2)
        assert "--profile mcsdk-5.4" in refused.err and "->" not in refused.err


def test_a_motor_starts_turns_and_stops(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.st, "-m", 2, *arguments)

    started = st("--json", "--speed-limit", 1000, "start", "--ramp", 900, "100ms").ended(0).json
    assert started["ok"] and started["values"]["STATUS"]["name"] != "IDLE"
    eventually(lambda: drive.motor(2)["speed_rpm"] > 850, "motor 2 turns")
    assert st("--json", "get", "STATUS").json["values"]["STATUS"]["name"] == "RUN"
    st("start-stop").ended(0)
    eventually(lambda: drive.motor(2)["status"] == "IDLE", "motor 2 is idle")
    assert drive.motor(1)["status"] == "IDLE"


def test_a_fault_keeps_the_motor_from_starting_until_it_is_acknowledged(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.st, *arguments)

    assert "executes while the motor runs" in st("ramp", 900, 100).ended(0).out
    drive.do("fault", motor=1, fault="BREAK_IN", hold=True)
    eventually(lambda: drive.motor(1)["status"] == "FAULT_NOW", "the fault")
    assert "BREAK_IN" in st("status").ended(0).out
    refused = st("start").ended(1)
    assert "BREAK_IN" in refused.err and "fault-ack" in refused.err
    assert "BREAK_IN" in st("fault-ack").ended(1).err
    text = st("ramp", 800, 100).ended(0).out
    assert "ramp to 800 rpm in 100 ms acknowledged" in text and "executes" not in text
    assert "its state is FAULT_NOW: BREAK_IN (" in text and ", present)" in text
    assert "remove the cause, then `fault-ack`, then `start`" in text
    values = st("--json", "ramp", 700, 100).ended(0).json["values"]
    assert values["RAMP_FINAL_SPEED"]["value"] == 700 and values["STATUS"]["name"] == "FAULT_NOW"
    assert "BREAK_IN" in str(values["FLAGS"])
    # The cause is gone, and the fault still keeps the motor from starting.
    drive.do("fault", motor=1, fault="BREAK_IN", hold=False)
    eventually(lambda: drive.motor(1)["status"] == "FAULT_OVER", "the cause is gone")
    assert "its state is FAULT_OVER: BREAK_IN (" in st("ramp", 800, 100).ended(0).out
    assert st("--json", "fault-ack").ended(0).values == {"FLAGS": 0}
    assert st("start").ended(0)


def test_a_start_while_the_motor_stops_has_no_effect_and_is_an_error(run, sim, tmp_path):
    # A flywheel: it takes half a minute to stop.
    config = tmp_path / "flywheel.toml"
    config.write_text("[[st.motor]]\npreset = 'servo'\nplant.load.inertia = 1e-3\n")
    drives = sim(config, rmd=())

    def st(*arguments):
        return run("st", "-p", drives.st, *arguments)

    st("start", "--ramp", 2000, 2000).ended(0)
    eventually(lambda: drives.motor(1)["speed_rpm"] > 1000, "motor 1 turns fast")
    st("stop").ended(0)
    assert "still stopping" in st("start").ended(1).err


# What a person gets wrong.


@pytest.mark.parametrize(
    "command, message",
    [
        ("set SPEED_KP 32768", "-32768 to 32767"),
        ("--speed-limit 1000.9 ramp -1001 100", "-1001 rpm is over the limit of 1000 rpm that was set; nothing was sent"),
        ("--speed-limit 1000 start", " start --ramp RPM MS`"),
        ("--speed-limit 1000 start --ramp 1001 100", "over the limit"),
        ("--speed-limit 1000 --profile mcsdk-5.4 position 1rad 1s --wait", "carries no speed"),
        ("--current-limit 100.9 current-reference 0 -101", "-101 s16A is over the limit of 100 s16A"),
        ("start --ramp 1s 1500", "nothing was sent"),
        ("start --ramp 1500 70000", "nothing was sent"),
    ],
)
def test_what_does_not_fit_is_not_sent(sim_st, command, message):
    refused = sim_st("--trace", *command.split()).ended(2)
    assert message in refused.err and "->" not in refused.err


def test_the_drive_refuses_a_motor_that_it_lacks_and_registers_that_it_does_not_write(sim_st):
    message = sim_st("set", "SPEED_MEAS", 3).ended(1).err
    assert "motor 1 refused writing SPEED_MEAS: SET_READ_ONLY" in message
    assert "BAD_MOTOR_SELECTED" in sim_st("-m", 3, "start").ended(1).err


def test_a_refused_register_does_not_take_the_values_of_the_others(sim_st):
    message = sim_st("get", "MIN_APP_SPEED", "I_A", "SC_RS", "STATUS").ended(1)
    assert [line.split()[0] for line in message.out.splitlines()] == ["MIN_APP_SPEED", "STATUS"]
    assert "I_A has access D" in message.err and "add --profile mcsdk-5.4" in message.err
    loop = sim_st("get", "MIN_APP_SPEED", "SC_RS", "--every", "5ms", "--count", 3).ended(1)
    assert [line.split()[1:] for line in loop.out.splitlines()[2:]] == 3 * [["600", "-"]]
    assert loop.err.count("refused reading SC_RS") == 2, "once in the loop, and as the result"


def test_a_loop_reads_registers_of_access_d_in_a_data_segment(sim_st):
    loop = sim_st("--trace", "get", "MIN_APP_SPEED", "I_A", "--every", "5ms", "--count", 3).ended(0)
    assert [line.split()[1:] for line in loop.out.splitlines()[2:]] == 3 * [["600", "0"]]
    assert "CONFIG_DYN_STRUCT segment 3: " in loop.err and "GET_REG I_A" not in loop.err
    chosen = ("segment", "--segment", 1, "I_A", "I_B", "--every", "5ms", "--count", 3)
    loop = sim_st("--trace", *chosen).ended(0)
    assert len(loop.out.splitlines()) == 5
    assert {line.split("segment ")[1][0] for line in loop.err.splitlines() if "segment " in line} == {"1"}


@pytest.mark.parametrize(
    "profile, command, said",
    [
        ("spec", "get I_A", "use `st segment I_A`"),
        ("spec", "get SC_RS", "profile spec does not read SC_RS; add --profile mcsdk-5.4"),
        ("spec", "set SPEED_MEAS 3", "SPEED_MEAS cannot be written, its access is R"),
        ("spec", "set SC_PP 3", "profile spec has no register SC_PP; add --profile mcsdk-5.4"),
        ("mcsdk-5.4", "get I_A", "`st set DAC_OUT1 I_A` shows it on channel 1"),
        ("mcsdk-5.4", "get RAMP_DURATION", "neither reads nor writes it"),
        ("mcsdk-5.4", "get SC_RS", "only in drives that are built with: motor profiler"),
    ],
)
def test_a_refusal_says_what_the_table_knows_of_the_register(run, tmp_path, profile, command, said):
    config = tmp_path / "bench.toml"
    config.write_text(f'profile = "{profile}"\n')
    words = ("-p", f"sim:{config}", "--profile", profile, *command.split())
    assert said in run("st", *words).ended(1).err


# What goes wrong on the line.


def test_a_device_that_does_not_exist_is_told(run, tmp_path):
    message = run("st", "-p", tmp_path / "ttyACM7", "info").ended(3).err
    assert "is it plugged in?" in message and "motorlink ports" in message
    (tmp_path / "notes").write_text("no device")
    message = run("st", "-p", tmp_path / "notes", "info").ended(3).err
    assert "is not a serial device; `motorlink ports` lists those that are" in message


def test_a_silent_device_is_given_up_in_time(run, tmp_path):
    with device(tmp_path / "silent") as port:
        begun = time.monotonic()
        message = run("st", "-p", port, "--timeout", "100ms", "info").ended(3).err
        assert time.monotonic() - begun < 4
    assert "no reply in time" in message and f"`motorlink st -p {port} scan`" in message


def test_garbage_is_told_and_ends_in_time(run, tmp_path):
    with device(tmp_path / "noisy", noise) as port:
        begun = time.monotonic()
        message = run("st", "-p", port, "--timeout", "200ms", "info").ended(3).err
        assert time.monotonic() - begun < 5
        scanned = run("st", "-p", port, "--json", "scan", 115200).ended(3)
        assert scanned.json["finding"] == "garbage"
    # Noise may begin as a reply does.
    said = (" scan` tries the usual rates", "something else is sending", "the line lost bytes")
    assert any(words in message for words in said), message


def test_ctrl_c_ends_a_loop_on_a_silent_line(start, tmp_path):
    with device(tmp_path / "silent") as port:
        loop = start("st", "-p", port, "--timeout", "200ms", "get", "STATUS", "--every", "50ms")
        loop.says("the line is lost")
        loop.interrupt()
        assert loop.wait() == 0


def test_ctrl_c_ends_an_exchange_that_has_long_to_wait(start, tmp_path):
    asked = threading.Event()

    def listen(received):
        asked.set()
        return b""

    with device(tmp_path / "silent", listen) as port:
        waiting = start("st", "-p", port, "--timeout", "60s", "info")
        assert asked.wait(10)
        waiting.interrupt()
        assert waiting.wait(5) == 130
