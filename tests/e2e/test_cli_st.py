"""`motorlink st` as a person and a script use it."""

import threading
import time

import pytest

from peers import device, noise
from program import eventually
from st_wire import ACK, frame, nack

PORTS = ["pty", "tcp", "sim"]


@pytest.fixture
def st(run, drives, request):
    """Runs `motorlink st` on a port of the shared drives, a pty where the test does not choose."""
    port = drives.port(getattr(request, "param", "pty"))
    return lambda *arguments, **options: run("st", "-p", port, *arguments, **options)


on_every_port = pytest.mark.parametrize("st", PORTS, indirect=True)


# What reads.


@on_every_port
def test_info_names_the_sdk_and_the_firmware(st):
    info = st("--json", "info").ended(0).json
    assert info["board"] == {"name": "ST MC SDK", "version": [5, 4, 4]}
    assert info["firmware"] == {"name": "ST MC SDK", "version": "Ver.5.4.4"}
    assert "5.4.4" in st("info").ended(0).out


@on_every_port
def test_status_has_a_value_and_its_unit_or_name(st):
    status = st("--json", "status").ended(0).json["values"]
    assert status["BUS_VOLTAGE"] == {"value": 325, "unit": "V"}
    assert set(status["STATUS"]) == {"value", "name"}
    assert "325 V" in st("status").ended(0).out


def test_a_raw_status_has_digits_only(st):
    rows = st("--raw", "status").ended(0).out.splitlines()
    assert len(rows) == 10
    assert all(row.split()[1].lstrip("-").isdigit() and len(row.split()) == 2 for row in rows), rows


@on_every_port
def test_get_reads_registers_by_name_and_by_number(st):
    values = st("--json", "get", "MIN_APP_SPEED", "0x3F").ended(0).json["values"]
    assert values == {
        "MIN_APP_SPEED": {"value": 600, "unit": "rpm"},
        "MAX_APP_SPEED": {"value": 6000, "unit": "rpm"},
    }
    assert st("get", "min_app_speed").ended(0).out.split() == ["MIN_APP_SPEED", "600", "rpm"]
    assert st("--json", "--raw", "get", "STATUS").ended(0).values["STATUS"] in range(21)


def test_get_reads_again_and_again(st):
    readings = st("--json", "get", "MIN_APP_SPEED", "--every", "10ms", "--count", 5).ended(0).lines
    assert len(readings) == 5
    times = [reading["t"] for reading in readings]
    assert times == sorted(times) and times[-1] >= 0.035
    names, units, values = st("get", "MIN_APP_SPEED", "--every", "10ms", "--count", 1).ended(0).out.splitlines()
    assert (names.split(), units.split()) == (["t", "MIN_APP_SPEED"], ["s", "rpm"])
    assert values.split()[1] == "600"


@on_every_port
def test_segment_samples_registers_that_cannot_be_read_one_by_one(st):
    sampled = st("--json", "segment", "MIN_APP_SPEED", "I_A", "I_B").ended(0).values
    assert list(sampled) == ["MIN_APP_SPEED", "I_A", "I_B"]
    assert st("segment", "--segment", 3, "I_A").ended(0).out.startswith("I_A")


@on_every_port
def test_revup_shows_five_phases(st):
    phases = st("--json", "revup-data").ended(0).lines
    assert [phase["phase"] for phase in phases] == [0, 1, 2, 3, 4]
    assert phases[0]["values"]["speed"] == {"value": 0, "unit": "rpm"}
    assert set(phases[0]["values"]) == {"speed", "torque", "duration"}
    assert len(st("revup").ended(0).out.splitlines()) == 5


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
        ("I_?", {"I_A", "I_B", "I_D", "I_Q"}),
        ("--access w", {"IQ_SPEEDMODE"}),
        ("--access D,W *ALPHA", {"I_ALPHA", "V_ALPHA", "OBS_I_ALPHA", "OBS_BEMF_ALPHA", "OBS_CR_I_ALPHA", "OBS_CR_BEMF_ALPHA"}),
        ("--feature feed-forward FF_V?", {"FF_VQ", "FF_VD"}),
        ("--access - RAMP", {"RAMP_DURATION"}),
    ],
)
def test_registers_are_filtered_by_name_access_and_feature(run, words, names):
    assert {r["name"] for r in run("st", "--json", "registers", *words.split()).ended(0).lines} == names


def test_a_filter_that_no_register_passes_is_told(run):
    assert "no register matches" in run("st", "registers", "zzz").ended(2).err
    assert "possible values" in run("st", "registers", "--feature", "zzz").ended(2).err


@pytest.mark.parametrize("st", ["pty", "tcp"], indirect=True)
def test_scan_tells_what_answers_on_a_port_without_a_rate(st):
    (found,) = (line for line in st("--json", "scan", 115200, 9600).ended(0).lines if "finding" in line)
    assert (found["finding"], found["text"]) == ("drive", "ST MC SDK 5.4.4") and "baud" not in found
    assert st("scan", 115200).ended(0).out == "ST MC SDK 5.4.4\n"


@on_every_port
def test_raw_sends_any_frame(st):
    answer = st("--json", "raw", "02", "40").ended(0).json
    assert (answer["ok"], answer["data"]) == (True, "58 02 00 00")
    assert st("raw", "0x02,0x40").ended(0).out == "ACK 58 02 00 00\n"
    assert st("raw", "0340").ended(1).err.count("WRONG_CMD") == 1


def test_trace_shows_both_directions_on_stderr(st):
    # A request that a busy machine answers late is sent again.
    traced = st("--timeout", "5s", "--trace", "get", "MIN_APP_SPEED").ended(0)
    *opening, sent, received, confirmed, _ = traced.err.splitlines()
    # A line to a drive that may have been asked before is brought in sync first, and what was read is confirmed.
    questions = ["GET_BOARD_INFO", "GET_REG STATUS", "GET_REG FLAGS", "GET_BOARD_INFO"]
    asked = [line for line in [*opening, confirmed] if "->" in line]
    assert all(question in line for question, line in zip(questions, asked, strict=True))
    assert "-> 22 01 40 63" in sent and "GET_REG MIN_APP_SPEED" in sent
    assert "<- f0 04 58 02 00 00" in received and "600 rpm" in received
    assert traced.out.split() == ["MIN_APP_SPEED", "600", "rpm"]


# What acts.


@on_every_port
@pytest.mark.parametrize(
    "command",
    [
        "set SPEED_KP 3",
        "set SPEED_KP -3",
        "set DAC_OUT1 I_ALPHA",
        "set CONTROL_MODE SPEED",
        "ramp 700 200",
        "ramp -700 200",
        "revup-data 1 500 200 250",
        "current-reference 100 -5",
        "current 100 -5",
        "stop-ramp",
        "stop",
        "iqdref-clear",
        "encoder-align",
        "pfc enable",
        "pfc disable",
        "pfc fault-ack",
    ],
)
def test_what_is_done_is_said(st, command):
    assert st(*command.split()).ended(0).out.startswith("motor 1")
    assert st("--json", *command.split()).ended(0).json["ok"] is True


def test_mcsdk_commands_work_with_its_profile(run, sim, tmp_path):
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')
    port = sim(config, rmd=()).port("pty")

    def st(*arguments):
        return run("st", "-p", port, "--profile", "mcsdk-5.4", *arguments)

    assert st("--json", "torque-ramp", 100, 50).ended(0).json["ok"]
    assert st("--json", "position", "1.5rad", "0.5s").ended(0).json["ok"]
    assert st("move", "-90deg", "500ms").ended(0).out.startswith("motor 1: move to -1.5707964 rad (-90.0°) in 0.5 s")
    assert "write 90deg or 90rad" in st("--trace", "position", 90, "1s").ended(2).err
    assert "write 2ms or 2s" in st("position", "90deg", 2).ended(2).err
    assert st("info").ended(0).out.count("5.4.4") == 2


def test_a_motor_starts_turns_and_stops(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.st, "-m", 2, *arguments)

    st("ramp", 900, 100).ended(0)
    started = st("--json", "start").ended(0).json
    assert started["ok"] and started["values"]["STATUS"]["name"] != "IDLE"
    eventually(lambda: drive.motor(2)["speed_rpm"] > 850, "motor 2 turns")
    assert st("--json", "get", "STATUS").json["values"]["STATUS"]["name"] == "RUN"
    st("start-stop").ended(0)
    eventually(lambda: drive.motor(2)["status"] == "IDLE", "motor 2 is idle")
    assert drive.motor(1)["status"] == "IDLE"


def test_a_ramp_to_a_drive_with_a_fault_names_the_fault(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.st, *arguments)

    assert "executes while the motor runs" in st("ramp", 900, 100).ended(0).out
    drive.do("fault", motor=1, fault="BREAK_IN", hold=True)
    eventually(lambda: drive.motor(1)["status"] == "FAULT_NOW", "the fault")
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


def test_a_fault_keeps_the_motor_from_starting_until_it_is_acknowledged(run, sim):
    drive = sim(rmd=())

    def st(*arguments):
        return run("st", "-p", drive.st, *arguments)

    drive.do("fault", motor=1, fault="BREAK_IN", hold=True)
    eventually(lambda: drive.motor(1)["status"].startswith("FAULT"), "the fault")
    assert "BREAK_IN" in st("status").ended(0).out
    refused = st("start").ended(1)
    assert "BREAK_IN" in refused.err and "fault-ack" in refused.err
    assert "BREAK_IN" in st("fault-ack").ended(1).err

    drive.do("fault", motor=1, fault="BREAK_IN", hold=False)
    eventually(lambda: drive.motor(1)["status"] == "FAULT_OVER", "the cause is gone")
    assert st("--json", "fault-ack").ended(0).values == {"FLAGS": 0}
    assert st("start").ended(0)


# What a person gets wrong.


def test_an_unknown_register_is_met_with_the_nearest(st):
    assert "did you mean `SPEED_MEAS`?" in st("get", "SPEED_MES").ended(2).err
    assert "did you mean `SPEED_KP`?" in st("set", "SPED_KP", 1).ended(2).err


def test_a_value_out_of_range_is_not_sent(st):
    message = st("--trace", "set", "SPEED_KP", 32768).ended(2)
    assert "-32768 to 32767" in message.err and "->" not in message.err
    st("set", "SPEED_KP", "fast").ended(2)
    st("ramp", 1000, 65536).ended(2)
    st("current-reference", 40000, 0).ended(2)


def test_the_drive_refuses_to_write_a_read_only_register(st):
    message = st("set", "SPEED_MEAS", 3).ended(1).err
    assert "motor 1 refused writing SPEED_MEAS: SET_READ_ONLY" in message


def test_the_drive_refuses_to_read_a_register_of_access_d(st):
    message = st("get", "I_A").ended(1).err
    assert "GET_WRITE_ONLY" in message and "use `st segment I_A`" in message


def test_a_refused_register_does_not_take_the_values_of_the_others(st):
    message = st("get", "MIN_APP_SPEED", "I_A", "SC_RS", "STATUS").ended(1)
    assert [line.split()[0] for line in message.out.splitlines()] == ["MIN_APP_SPEED", "STATUS"]
    assert "I_A has access D" in message.err and "add --profile mcsdk-5.4" in message.err
    loop = st("get", "MIN_APP_SPEED", "SC_RS", "--every", "5ms", "--count", 3).ended(1)
    assert [line.split()[1:] for line in loop.out.splitlines()[2:]] == 3 * [["600", "-"]]
    assert loop.err.count("refused reading SC_RS") == 2, "once in the loop, and as the result"


def test_a_loop_reads_registers_of_access_d_in_a_data_segment(st):
    loop = st("--trace", "get", "MIN_APP_SPEED", "I_A", "--every", "5ms", "--count", 3).ended(0)
    assert [line.split()[1:] for line in loop.out.splitlines()[2:]] == 3 * [["600", "0"]]
    assert "CONFIG_DYN_STRUCT segment 3: " in loop.err and "GET_REG I_A" not in loop.err


def test_the_segment_of_a_loop_can_be_chosen(st):
    loop = st("--trace", "segment", "--segment", 1, "I_A", "I_B", "--every", "5ms", "--count", 3).ended(0)
    assert len(loop.out.splitlines()) == 5
    assert {line.split("segment ")[1][0] for line in loop.err.splitlines() if "segment " in line} == {"1"}


@pytest.mark.parametrize(
    "profile, command, said",
    [
        ("spec", "get IQ_SPEEDMODE", "IQ_SPEEDMODE is write-only in the document; add --profile mcsdk-5.4"),
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


def test_an_unknown_code_of_a_refusal_has_no_empty_brackets(run, tmp_path):
    def drive(received):
        # GET_BOARD_INFO, then STATUS and FLAGS of a line that was just opened, are answered.
        size = {0x06: 32, 0x02: {2: 1, 1: 4}.get(received[2])}[received[0] & 0x1F]
        return frame(ACK, bytes(size)) if size else nack(0x63)

    with device(tmp_path / "drive", drive) as port:
        message = run("st", "-p", port, "get", "SPEED_MEAS").ended(1).err
    assert "0x63 (no document names this number)" in message and "()" not in message


def test_a_motor_that_the_drive_lacks_is_refused_and_one_beyond_7_not_even_sent(st):
    assert "BAD_MOTOR_SELECTED" in st("-m", 3, "start").ended(1).err
    assert "1 to 7" in st("-m", 8, "start").ended(2).err


def test_hexadecimal_that_is_none_is_told(st):
    assert "`xy` is not hexadecimal" in st("raw", "xy").ended(2).err
    assert "frame code" in st("raw", "20").ended(2).err


def test_without_a_port_the_ways_to_name_one_are_told(run):
    message = run("st", "info").ended(2).err
    assert "-p PORT" in message and "MOTORLINK_PORT" in message and "sim:" in message


def test_the_port_may_come_from_the_environment(run, drives):
    assert run("st", "info", MOTORLINK_PORT=drives.st).ended(0)


@pytest.mark.parametrize("port", ["can0", "tcp:host", "tcp:host:70000", "/dev/x?speed=1"])
def test_a_port_that_is_none_is_a_usage_error(run, port):
    run("st", "-p", port, "info").ended(2)


def test_a_can_port_is_not_a_serial_line(run, drives):
    message = run("st", "-p", drives.port("slcan"), "info").ended(2).err
    assert "cannot be used as a serial line" in message


# What goes wrong on the line.


def test_a_device_that_does_not_exist_is_told(run, tmp_path):
    message = run("st", "-p", tmp_path / "ttyACM7", "info").ended(3).err
    assert "is it plugged in?" in message and "motorlink ports" in message


def test_a_file_is_not_a_serial_device(run, tmp_path):
    (tmp_path / "notes").write_text("no device")
    for path in (tmp_path / "notes", tmp_path):
        assert "is not a serial device" in run("st", "-p", path, "info").ended(3).err


def test_nobody_listening_is_told(run):
    assert "refuses the connection" in run("st", "-p", "tcp:127.0.0.1:1", "info").ended(3).err


def test_a_silent_device_is_given_up_in_time(run, tmp_path):
    with device(tmp_path / "silent") as port:
        begun = time.monotonic()
        message = run("st", "-p", port, "--timeout", "100ms", "info").ended(3).err
        assert time.monotonic() - begun < 4
    assert "no reply in time" in message and f"`motorlink st -p {port} scan`" in message


def test_scan_tells_silence_from_garbage(run, tmp_path):
    with device(tmp_path / "silent") as port:
        scanned = run("st", "-p", port, "--json", "scan", 115200).ended(3)
        assert scanned.json["finding"] == "silence"
    with device(tmp_path / "noisy", noise) as port:
        scanned = run("st", "-p", port, "--json", "scan", 115200).ended(3)
        assert scanned.json["finding"] == "garbage"


@pytest.mark.parametrize("answer", [noise, lambda received: b"\0" * 40])
def test_garbage_is_told_and_ends_in_time(run, tmp_path, answer):
    with device(tmp_path / "noisy", answer) as port:
        begun = time.monotonic()
        message = run("st", "-p", port, "--timeout", "200ms", "info").ended(3).err
        assert time.monotonic() - begun < 5
    # Noise may begin as a reply does.
    said = (" scan` tries the usual rates", "something else is sending", "the line lost bytes")
    assert any(words in message for words in said), message


def test_a_line_that_echoes_is_told(run, tmp_path):
    with device(tmp_path / "echo", lambda received: received) as port:
        message = run("st", "-p", port, "start").ended(3).err
    assert "is received again" in message and "echoes" in message


def test_a_device_that_is_unplugged_mid_exchange_is_told(run, tmp_path):
    with device(tmp_path / "unplugged", lambda received: None) as port:
        message = run("st", "-p", port, "info").ended(3).err
    assert "was closed" in message or "unplugged" in message


def test_a_loop_survives_a_drive_that_goes_and_comes_back(start, sim):
    drive = sim(rmd=())
    loop = start("st", "-p", drive.st, "get", "SPEED_MEAS", "--every", "50ms")
    loop.more_lines()
    drive.kill()
    loop.says("the line is lost")
    sim(rmd=())
    loop.says("the line is back")
    loop.more_lines()
    loop.interrupt()
    assert loop.wait() == 0


def test_a_loop_survives_a_server_that_goes_and_comes_back(start, sim):
    drive = sim(st=("tcp",), rmd=())
    address = drive.st_address
    loop = start("st", "-p", f"tcp:{address}", "get", "SPEED_MEAS", "--every", "50ms")
    loop.more_lines()
    drive.kill()
    loop.says("the line is lost")
    sim(st=(f"tcp-listen:{address}",), rmd=())
    loop.says("the line is back")
    loop.more_lines()
    loop.interrupt()
    assert loop.wait() == 0


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


@pytest.mark.parametrize("command", ["torque-ramp 100 50", "position 1.5rad 0.5s"])
def test_what_the_profile_lacks_is_not_sent(run, command):
    refused = run("st", "-p", "sim:", "--trace", *command.split()).ended(2)
    assert "--profile mcsdk-5.4" in refused.err and "->" not in refused.err


def test_a_segment_is_not_sent_to_firmware_that_has_none(run):
    segment = ("--profile", "mcsdk-5.4", "--trace", "segment", "STATUS")
    refused = run("st", "-p", "sim:", *segment).ended(2)
    assert "--profile spec" in refused.err and "->" not in refused.err


def test_a_start_while_the_motor_stops_has_no_effect_and_is_an_error(run, sim, tmp_path):
    # A flywheel: it takes half a minute to stop.
    config = tmp_path / "flywheel.toml"
    config.write_text("[[st.motor]]\npreset = 'servo'\nplant.load.inertia = 1e-3\n")
    drives = sim(config, rmd=())

    def st(*arguments):
        return run("st", "-p", drives.port("pty"), *arguments)

    st("ramp", 2000, 2000).ended(0)
    st("start").ended(0)

    def is_fast():
        return st("get", "SPEED_MEAS", "--json").ended(0).values["SPEED_MEAS"] > 1000

    eventually(is_fast, "motor 1 turns fast")
    st("stop").ended(0)
    assert "still stopping" in st("start").ended(1).err


def test_a_loop_without_a_time_or_a_sample_is_refused(run):
    words = ("st", "-p", "sim:", "get", "STATUS", "--every")
    assert "it must be 1ms to 86400s" in run(*words, "0").ended(2).err
    assert "0 is not in 1.." in run(*words, "10ms", "--count", "0").ended(2).err
