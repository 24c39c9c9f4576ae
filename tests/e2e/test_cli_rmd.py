"""`motorlink rmd` as a person and a script use it."""

import time

import pytest

from peers import device, noise, slcan_adapter
from program import eventually

PORTS = ["slcan", "slcan:tcp", "sim"]
MOTION = {"temperature", "iq", "speed", "encoder"}
ANGLES = {"multi_turn_angle", "single_turn_angle"}
GAINS = ["position_kp", "position_ki", "speed_kp", "speed_ki", "torque_kp", "torque_ki"]
SHIPPED_GAINS = "100 100 100 100 100 100"


def on(run, port):
    """Runs `motorlink rmd` on a port. A busy machine may take longer than the 50 ms that a bus does."""
    return lambda *arguments: run("rmd", "-p", port, "--timeout", "500ms", *arguments)


@pytest.fixture
def rmd(run, drives, request):
    """Runs `motorlink rmd` on a port of the shared drives, a pty where the test does not choose."""
    return on(run, drives.port(getattr(request, "param", "slcan")))


on_every_port = pytest.mark.parametrize("rmd", PORTS, indirect=True)


# What reads.


@on_every_port
def test_scan_finds_the_motors(rmd):
    found = rmd("--json", "scan", 1, 2, 3, 4).ended(0).lines
    assert [motor["motor"] for motor in found] == [1, 2, 3, 4]
    assert set(found[0]["values"]) == {"voltage", "temperature", "errors"}
    assert found[0]["dialect"] == "V1.62"
    assert "motor 1 " in rmd("scan", 1).ended(0).out


def test_scan_asks_all_32_ids(run, sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 7\n[[rmd.motor]]\nid = 32\n")
    port = sim(config, st=()).port("slcan")
    found = on(run, port)("--json", "scan").ended(0).lines
    assert [motor["motor"] for motor in found] == [7, 32]


@on_every_port
def test_status_tells_everything_about_a_motor(rmd):
    shown = rmd("-i", 4, "--json", "status").ended(0)
    status = shown.values
    assert set(status) == MOTION | {
        *("voltage", "errors", "phase_a", "phase_b", "phase_c", "multi_turn_angle", "single_turn_angle")
    }
    assert (shown.json["motor"], status["voltage"], status["errors"]) == (4, 24.0, [])
    shown = rmd("-i", 4, "status").ended(0).out
    assert shown.startswith("motor") and "24.0 V" in shown


@on_every_port
def test_status_again_and_again_has_the_product_of_voltage_and_current(rmd):
    rmd("-i", 4, "speed", 300).ended(0)
    sample = rmd("-i", 4, "--json", "status", "--every", "20ms", "--count", 1).ended(0)
    values = sample.values
    assert values["voltage_times_iq"] == pytest.approx(values["voltage"] * values["iq"], abs=0.06)
    assert sample.json["values"]["voltage_times_iq"]["unit"] == "VA"
    raw = rmd("-i", 4, "--json", "--raw", "status", "--every", "20ms", "--count", 1).ended(0)
    assert "voltage_times_iq" not in raw.values and raw.values["voltage"] == 240


def test_raw_values_are_digits(rmd):
    assert rmd("-i", 4, "--json", "--raw", "status").ended(0).values["voltage"] == 240


@on_every_port
def test_what_is_read_has_its_keys(rmd):
    assert list(rmd("-i", 4, "--json", "pid").ended(0).values) == GAINS
    assert set(rmd("-i", 4, "--json", "acceleration").ended(0).values) == {"acceleration"}
    assert set(rmd("-i", 4, "--json", "encoder").ended(0).values) == {"position", "raw", "offset"}
    assert set(rmd("-i", 4, "--json", "angle").ended(0).values) == ANGLES
    for command in ("pid", "acceleration", "encoder", "angle"):
        assert rmd("-i", 4, command).ended(0).out


def test_angle_reads_again_and_again(rmd):
    readings = rmd("--json", "angle", "--every", "10ms", "--count", 4).ended(0).lines
    assert [set(reading["values"]) for reading in readings] == [ANGLES] * 4
    assert readings[0]["t"] < readings[-1]["t"]


@on_every_port
def test_raw_sends_eight_bytes(rmd):
    answer = rmd("-i", 4, "--json", "raw", "9a").ended(0).json
    assert (answer["ok"], answer["data"]) == (True, "9a 19 00 f0 00 00 00 00")
    assert rmd("-i", 4, "raw", "9A", "1", "2").ended(0).out == "9a 19 00 f0 00 00 00 00\n"


def test_trace_shows_both_directions_on_stderr(rmd):
    *opening, sent, received = rmd("-i", 4, "--trace", "raw", "9a").ended(0).err.splitlines()
    # On a port that does not bring its motors with it, a motor is asked for its status first.
    assert [line.split()[2] for line in opening if "->" in line] in ([], ["144#9a", "144#9c"])
    assert "-> 144#9a 00 00 00 00 00 00 00" in sent
    assert "<- 144#9a 19 00 f0 00 00 00 00" in received


# What acts.


@on_every_port
@pytest.mark.parametrize("command", ["off", "stop", "run", f"pid {SHIPPED_GAINS}", "acceleration 9"])
def test_what_is_done_is_said(rmd, command):
    assert rmd("-i", 2, *command.split()).ended(0).out.startswith("motor 2")
    assert rmd("-i", 2, "--json", *command.split()).ended(0).json["ok"] is True


@on_every_port
@pytest.mark.parametrize(
    "command",
    [
        "torque 0.1",
        "torque -0.1",
        "speed 20",
        "speed -20.5",
        "position 10",
        "position -10.25 --max-speed 200",
        "single-turn-position 45.5 cw --full-turn",
        "single-turn-position 359.99 ccw --max-speed 100 --full-turn",
    ],
)
def test_a_motion_command_answers_with_what_the_motor_does(rmd, command):
    assert set(rmd("-i", 3, "--json", *command.split()).ended(0).values) == MOTION
    assert "°/s" in rmd("-i", 3, *command.split()).ended(0).out
    rmd("-i", 3, "off").ended(0)


@pytest.mark.parametrize(
    "command, first",
    [
        ("torque 0.1", "turns with 0.096 A"),
        ("speed 20.5", "turns at 20.50 °/s"),
        ("--raw speed 2050", "turns at 2050"),
        ("--gear-ratio 6 speed 20.5", "turns at 20.500 °/s"),
        ("position -10.25", "turns to -10.25 °"),
        ("single-turn-position 45.5 cw --full-turn", "turns to 45.50 ° clockwise"),
    ],
)
def test_a_motion_command_is_printed_before_the_state(run, command, first):
    done = run("rmd", "-p", "sim:", "-i", 3, *command.split()).ended(0)
    assert done.out.splitlines()[0] == f"motor 3 {first}; its state at the reply:"


@pytest.mark.parametrize("move", [("position", 10), ("single-turn-position", 10, "cw", "--full-turn")])
def test_a_max_speed_never_rounds_up_and_is_never_0(rmd, move):
    def most(value, *options):
        return rmd("--trace", *options, *move, f"--max-speed={value}")

    for value, sent in (("1.999", "01 00"), ("360.999", "68 01")):
        data = next(line for line in most(value).ended(0).err.splitlines() if "-> 141#a" in line)
        assert data.split("#")[1][6:11] == sent
    assert next(line for line in most("2.9", "--raw").ended(0).err.splitlines() if " 02 00 " in line)
    for value in ("0", "0.999", "-1", "nan"):
        refused = most(value).ended(2).err
        assert "outside 1 to 65535 °/s; nothing was sent" in refused and "->" not in refused
    assert "outside 1 to 65535 digits" in most("0.9", "--raw").ended(2).err
    assert "outside 1 to" in most("65536").ended(2).err


@pytest.mark.parametrize("number, sent", [("-1e-1", "fa ff"), ("-1.6E0", "9c ff"), ("-.1", "fa ff")])
def test_a_negative_number_may_have_an_exponent(rmd, number, sent):
    assert f"00 00 00 {sent}" in rmd("-i", 3, "--trace", "torque", number).ended(0).err
    rmd("-i", 3, "off").ended(0)


@pytest.mark.parametrize("command", ["move 10", "accel"])
def test_short_words_are_taken(rmd, command):
    assert rmd("-i", 2, *command.split()).ended(0).out


@pytest.fixture
def near(run, sim, tmp_path):
    """Runs `motorlink rmd` on motor 1, which stands at 90.02°: one count past 90.00°."""
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\nplant.angle_degrees = 90.034\n")
    bus = sim(config, st=())
    command = on(run, bus.port("slcan"))
    assert command("--json", "angle").ended(0).values["single_turn_angle"] == 90.02
    return bus, command


def test_a_move_that_could_be_nearly_a_full_turn_is_refused(near):
    bus, rmd = near
    refused = rmd("--trace", "single-turn-position", 90, "cw").ended(2).err
    assert "motor 1 is at 90.02°, 0.02° past 90.00° clockwise" in refused
    assert "try `counterclockwise`, or add `--full-turn`" in refused
    assert "-> 141#94" in refused and "-> 141#a" not in refused
    assert bus.motor(1)["mode"] == "off"

    rmd("single-turn-position", 90, "ccw", "--max-speed", 100).ended(0)
    eventually(lambda: abs(bus.motor(1)["angle_degrees"] - 90) < 0.022, "motor 1 is at 90°")
    rmd("--id", 1, "off").ended(0)
    for direction in ("cw", "ccw"):
        refused = rmd("single-turn-position", 90.02, direction, "--tolerance", 359.99).ended(2).err
        assert "`--full-turn`" in refused
    assert abs(bus.motor(1)["angle_degrees"] - 90) < 0.03


def test_a_full_turn_is_made_on_an_explicit_word(near):
    bus, rmd = near
    sent = rmd("--trace", "single-turn-position", 90, "cw", "--full-turn").ended(0).err
    assert "-> 141#94" not in sent
    eventually(lambda: abs(bus.motor(1)["angle_degrees"] - 450) < 0.1, "motor 1 made a turn")


def test_the_tolerance_of_a_full_turn_can_be_given(near):
    bus, rmd = near
    move = ("single-turn-position", 89.8, "cw", "--max-speed", 3)
    rmd(*move).ended(2)
    rmd(*move, "--tolerance", 0.3).ended(2)
    # In digits of 0.01°, as the angle.
    rmd("--raw", "single-turn-position", 8980, "cw", "--max-speed", 3, "--tolerance", 22).ended(2)
    assert bus.motor(1)["mode"] == "off"
    rmd(*move, "--tolerance", 0.2).ended(0)
    assert bus.motor(1)["mode"] == "position"
    for words, message in (("--tolerance=-1", "outside 0 to"), ("--tolerance=nan", "outside 0 to")):
        assert message in rmd(*move, words).ended(2).err
    assert "--full-turn" in rmd("position", 90, "--full-turn").ended(2).err
    assert "counterclockwise (ccw)" in rmd("single-turn-position", 90, "left").ended(2).err
    assert "cannot be used" in rmd(*move, "--full-turn", "--tolerance", 1).ended(2).err


def test_raw_frames_are_sent_as_they_are(near):
    bus, rmd = near
    rmd("raw", *"a5 00 00 00 28 23".split()).ended(0)
    eventually(lambda: bus.motor(1)["angle_degrees"] > 400, "motor 1 makes a turn")


@on_every_port
def test_torque4_answers_for_each_motor(rmd):
    replies = rmd("--json", "torque4", 0, -0.1, 0.1, 0).ended(0).lines
    assert [reply["motor"] for reply in replies] == [1, 2, 3, 4]
    assert set(replies[0]["values"]) == MOTION
    assert len(rmd("torque4", 0, 0, 0, 0).ended(0).out.splitlines()) == 4


@on_every_port
def test_rom_is_written_only_on_an_explicit_word(rmd):
    for command in ("zero", "encoder-offset 5", "raw 19", "raw 32", "raw 91"):
        assert "--write-rom" in rmd(*command.split()).ended(2).err
    assert set(rmd("--write-rom", "--json", "zero").ended(0).values) == {"offset"}
    assert rmd("--write-rom", "--json", "encoder-offset", 5).ended(0).values == {"offset": 5}
    assert rmd("--write-rom", "pid", *SHIPPED_GAINS.split()).ended(0)
    assert rmd("--write-rom", "encoder-offset", 0).ended(0)


def test_a_motor_turns_stops_and_resumes(run, sim):
    bus = sim(st=())

    def rmd(*arguments):
        return on(run, bus.port("slcan"))(*arguments).ended(0)

    rmd("speed", 360)
    eventually(lambda: bus.motor(1)["speed_dps"] > 350, "motor 1 turns")
    rmd("--id", 1, "stop")
    eventually(lambda: abs(bus.motor(1)["speed_dps"]) < 1, "motor 1 stands")
    rmd("run")
    eventually(lambda: bus.motor(1)["speed_dps"] > 350, "motor 1 turns again")
    rmd("single-turn-position", 45, "cw", "--full-turn", "--max-speed", 1000)
    eventually(lambda: abs(bus.motor(1)["angle_degrees"] % 360 - 45) < 0.5, "motor 1 is at 45°")
    rmd("--id", 1, "off")
    assert bus.motor(1)["mode"] == "off"


def test_an_error_that_has_its_cause_stays_and_is_told(run, sim):
    bus = sim(st=())
    rmd = on(run, bus.port("slcan"))
    bus.do("supply", motor=1, volts=5.0)
    eventually(lambda: bus.motor(1)["errors"] == ["LOW_VOLTAGE"], "low voltage")
    refused = rmd("--json", "clear-errors").ended(1)
    assert refused.values["errors"] == ["LOW_VOLTAGE"] and "still has errors" in refused.err
    assert refused.json["ok"] is False
    bus.do("supply", motor=1, volts=24.0)
    eventually(lambda: rmd("clear-errors").code == 0, "the error is cleared")
    assert rmd("--json", "clear-errors").ended(0).values["errors"] == []


# What a person gets wrong.


@pytest.mark.parametrize("motor", [0, 33, -1, 255, 256])
def test_a_motor_id_outside_1_to_32_is_a_usage_error(run, motor):
    assert "1 to 32" in run("rmd", "-p", "sim:", f"--id={motor}", "off").ended(2).err


@pytest.mark.parametrize(
    "command, message",
    [
        ("torque 33", "±32 A"),
        ("torque nan", "nothing was sent"),
        ("single-turn-position 360 cw", "359.99"),
        ("single-turn-position -1 cw", "nothing was sent"),
        ("speed 1e9", "nothing was sent"),
        ("torque4 0 0 0 99", "±32 A"),
        ("torque4 0 0 0 0 --expect 1,5", "motors 1 to 4"),
        ("torque4 0 0 0 0 --expect 0", "1 to 32"),
        ("acceleration -5", "negative, and a motor may treat it as no limit"),
        ("--speed-limit 0.9 speed 1", "--speed-limit: 0.9 °/s is outside 1 to 65535 °/s"),
        ("--speed-limit=-1 speed 1", "give a number without a unit, 0 or more"),
        ("--current-limit 32.1 torque 1", "--current-limit: 32.1 A is beyond ±32 A"),
        ("--current-limit nan torque 1", "give a number without a unit, 0 or more"),
        ("pid 1 2", "a motor has six"),
        ("pid 1 2 3 4 5 256", "256"),
        ("raw 1 2 3 4 5 6 7 8 9", "8 bytes"),
        ("raw zz", "not hexadecimal"),
    ],
)
def test_what_does_not_fit_is_not_sent(rmd, command, message):
    refused = rmd("--trace", *command.split()).ended(2)
    assert message in refused.err and "->" not in refused.err


@on_every_port
@pytest.mark.parametrize(
    "limit, command, message",
    [
        ("--current-limit 1", "torque -1.01", "-1.008 A is beyond the limit of 0.992 A"),
        ("--current-limit 1", "torque4 0 0 0 1.01", "motor 4: torque current 1.008 A"),
        ("--current-limit 1", "raw a1 0 0 0 3f", "1.008 A is beyond the limit"),
        ("--current-limit 1", "raw a0", "0xa0 may move the motor"),
        ("--current-limit 62 --raw", "torque 63", "1.008 A is beyond the limit"),
        ("--speed-limit 360", "speed 360.01", "360.01 °/s is beyond the limit of 360 °/s"),
        ("--speed-limit 360.9", "position 90 --max-speed 361", "361.00 °/s is beyond the limit of 360 °/s"),
        ("--speed-limit 360", "position 90 --max-speed 361 --wait", "beyond the limit"),
        ("--speed-limit 360", "position 90", "add --max-speed"),
        ("--speed-limit 360", "single-turn-position 90 cw", "add --max-speed"),
        ("--speed-limit 360", "single-turn-position 90 cw --max-speed 361 --wait", "beyond the limit"),
        ("--speed-limit 360", "raw a4", "carries no speed"),
        ("--speed-limit 360", "run", "resumes the motion before the stop"),
        ("--current-limit 1", "raw 88", "resumes the motion before the stop"),
        ("--speed-limit 360 --id 1-3", "speed 361", "beyond the limit"),
    ],
)
def test_what_exceeds_a_limit_is_not_sent(rmd, limit, command, message):
    refused = rmd("--trace", *limit.split(), *command.split()).ended(2)
    assert message in refused.err and "nothing was sent" in refused.err and "->" not in refused.err


@pytest.mark.parametrize(
    "limit, command",
    [
        ("--current-limit 1", "torque 1"),
        ("--current-limit 1", "torque -1"),
        ("--current-limit 1", "torque4 1 -1 0 0"),
        ("--current-limit 62 --raw", "torque 62"),
        ("--speed-limit 360", "speed -360"),
        ("--speed-limit 360.9", "position 0 --max-speed 360.9"),
        ("--speed-limit 360 --current-limit 1", "--id 1 off"),
        ("--speed-limit 360 --current-limit 1", "raw 9a"),
    ],
)
def test_a_value_equal_to_its_limit_is_sent(rmd, limit, command):
    rmd(*limit.split(), *command.split()).ended(0)


def test_a_serial_line_is_not_a_can_bus(run, drives):
    message = run("rmd", "-p", drives.can, "scan").ended(2).err
    assert "cannot be used as a CAN bus" in message and "slcan:" in message


def test_a_bare_interface_name_is_met_with_the_right_one(run):
    assert "did you mean `socketcan:can0`?" in run("rmd", "-p", "can0", "scan").ended(2).err


# What goes wrong on the line.


def test_a_motor_that_is_not_there_is_told(rmd):
    message = rmd("-i", 9, "status").ended(3).err
    assert "motor 9 does not answer" in message and " scan` lists" in message
    assert "no motor answered" in rmd("scan", 9, 10).ended(3).err


def test_an_unknown_command_is_a_silent_motor(rmd):
    assert "does not answer 0x01" in rmd("raw", "01").ended(3).err


def test_torque4_tells_what_answered_and_that_a_motor_did_not(run, sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 3\n")
    port = sim(config, st=()).port("slcan")
    partly = on(run, port)("--json", "torque4", 0, 0, 0, 0).ended(3)
    assert [(reply["motor"], reply["ok"]) for reply in partly.lines] == [
        *((1, True), (2, False), (3, True), (4, False))
    ]
    assert partly.lines[1]["error"]["kind"] == "silent"
    assert "motor 2" in partly.err
    message = on(run, port)("torque4", 0, 0, 0, 0).ended(3)
    assert [line.split()[1] for line in message.out.splitlines()] == ["1", "3"]
    two, four = message.err.splitlines()
    assert "motor 2 does not answer" in two and "motor 4 does not answer" in four


def test_torque4_waits_only_for_the_expected_motors(run, sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 3\n")
    bus = sim(config, st=())
    rmd = on(run, bus.port("slcan"))
    replies = rmd("--json", "torque4", 0, 0, 0.5, 0, "--expect", "1,3").ended(0).lines
    assert [(reply["motor"], reply["ok"]) for reply in replies] == [(1, True), (3, True)]
    partly = rmd("torque4", 0, 0, 0, 0, "--expect", 1, "--expect", 2).ended(3)
    assert [line.split()[1] for line in partly.out.splitlines()] == ["1"]
    assert "motor 2 does not answer" in partly.err and "motor 4" not in partly.err
    # The frame reaches a motor that is not expected to answer.
    rmd("torque4", 0, 0, 0.5, 0, "--expect", 1).ended(0)
    eventually(lambda: bus.motor(3)["angle_degrees"] > 10, "motor 3 turns")
    rmd("-i", 3, "off").ended(0)


def test_a_can_interface_that_is_absent_is_told(run):
    message = run("rmd", "-p", "socketcan:nocan7", "scan").ended(3).err
    assert "CAN" in message


def test_a_device_that_does_not_exist_is_told(run, tmp_path):
    assert "is it plugged in?" in run("rmd", "-p", f"slcan:{tmp_path}/tty", "scan").ended(3).err


@pytest.mark.parametrize("answer", [noise, lambda received: received])
def test_an_adapter_that_is_not_slcan_is_told(run, tmp_path, answer):
    with device(tmp_path / "other", answer) as port:
        message = run("rmd", "-p", f"slcan:{port}", "scan").ended(3).err
    assert "does not answer like an slcan adapter" in message


def test_an_st_drive_is_not_an_slcan_adapter(run, drives):
    message = run("rmd", "-p", f"slcan:{drives.st}", "scan").ended(3).err
    assert "does not answer like an slcan adapter" in message


def test_a_silent_device_is_given_up_in_time(run, tmp_path):
    with device(tmp_path / "silent") as port:
        started = time.monotonic()
        run("rmd", "-p", f"slcan:{port}", "--timeout", "20ms", "status").ended(3)
        assert time.monotonic() - started < 4


def test_an_adapter_that_is_unplugged_mid_exchange_is_told(run, tmp_path):
    adapter = slcan_adapter(lambda frame: [])
    with device(tmp_path / "can", lambda r: None if b"t" in r else adapter(r)) as port:
        message = run("rmd", "-p", f"slcan:{port}", "status").ended(3).err
    assert "was closed" in message or "unplugged" in message


def test_a_motor_that_speaks_v3_is_named_and_not_driven(run, tmp_path):
    heard = []

    def v3_motor(frame):
        heard.append(frame)
        return ["t24189A19000100F00000"] if frame.startswith("t141") else []

    with device(tmp_path / "can", slcan_adapter(v3_motor)) as link:
        port = f"slcan:{link}"
        message = on(run, port)("status").ended(3).err
        assert "V3" in message and "0x241" in message

        found = on(run, port)("--json", "scan", 1).ended(0).json
        assert found["motor"] == 1 and "V3" in found["dialect"]
        scanned = on(run, port)("scan", 1).ended(0).out
        assert "it is not driven" in scanned


def test_an_adapter_that_echoes_its_own_frames_is_not_a_motor(run, tmp_path):
    with device(tmp_path / "can", slcan_adapter(lambda frame: [frame])) as link:
        message = run("rmd", "-p", f"slcan:{link}?echo=1", "--timeout", "50ms", "--id", 1, "off").ended(3).err
    assert "does not answer" in message


@pytest.mark.parametrize("kind", ["slcan", "slcan:tcp"])
def test_a_loop_survives_a_bus_that_goes_and_comes_back(start, sim, kind):
    serve = {"slcan": "slcan-pty", "slcan:tcp": "tcp"}[kind]
    bus = sim(st=(), rmd=(serve,))
    loop = start(
        *("rmd", "-p", bus.port(kind), "--timeout", "500ms", "angle", "--every", "50ms")
    )
    loop.more_lines()
    bus.kill()
    loop.says("the line is lost")
    again = serve if kind == "slcan" else f"tcp-listen:{bus.can_address}"
    sim(st=(), rmd=(again,))
    loop.says("the line is back")
    loop.more_lines()
    loop.interrupt()
    assert loop.wait() == 0


def test_error_bits_that_mean_nothing_are_no_errors(run, tmp_path):
    """Bits 1, 2 and 4 to 7 of the error state are invalid (3, Read motor status 1)."""
    bits = {"state": "F6"}

    def motor(frame):
        return [f"t1418{frame[5:7]}1900F0000000{bits['state']}"]

    with device(tmp_path / "can0", slcan_adapter(motor)) as path:
        words = ("rmd", "-p", f"slcan:{path}", "--timeout", "500ms", "clear-errors")
        assert run(*words, "--json").ended(0).values["errors"] == []
        assert "no error (bits 0xf6 mean nothing)" in run(*words).ended(0).out
        bits["state"] = "F7"
        kept = run(*words, "--json").ended(1)
        assert kept.values["errors"] == ["LOW_VOLTAGE"]


def test_samples_of_several_motors_are_refused_with_other_ways(run):
    told = run("rmd", "-p", "sim:", "--id", "1-4", "status", "--every", "1s").ended(2).err
    assert "--every is for one motor: give one --id" in told
    assert "`motorlink watch -p sim:`" in told and "`samples({1: [...], 2: [...]})`" in told
