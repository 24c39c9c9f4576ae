"""`motorlink rmd` as a person and a script use it."""

import pytest

from peers import device, slcan_adapter
from program import eventually

PORTS = ["slcan", "slcan:tcp", "sim"]
MOTION = {"temperature", "iq", "speed", "encoder"}
ANGLES = {"multi_turn_angle", "single_turn_angle"}
GAINS = ["position_kp", "position_ki", "speed_kp", "speed_ki", "torque_kp", "torque_ki"]


def on(run, port):
    """Runs `motorlink rmd` on a port. A busy machine may take longer than the 50 ms that a bus does."""
    return lambda *arguments: run("rmd", "-p", port, "--timeout", "500ms", *arguments)


@pytest.fixture
def rmd(run):
    """Runs `motorlink rmd` on motors inside its process."""
    return on(run, "sim:")


# What reads.


@pytest.mark.parametrize("port", PORTS)
def test_status_tells_everything_about_a_motor(run, drives, port):
    rmd = on(run, drives.port(port))
    shown = rmd("-i", 4, "--json", "status").ended(0)
    status = shown.values
    assert set(status) == MOTION | ANGLES | {"voltage", "errors", "phase_a", "phase_b", "phase_c"}
    assert (shown.json["motor"], status["voltage"], status["errors"]) == (4, 24.0, [])
    shown = rmd("-i", 4, "status").ended(0).out
    assert shown.startswith("motor") and "24.0 V" in shown


def test_scan_asks_all_32_ids(run, sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 7\n[[rmd.motor]]\nid = 32\n")
    rmd = on(run, sim(config, st=()).port("slcan"))
    found = rmd("--json", "scan").ended(0).lines
    assert [motor["motor"] for motor in found] == [7, 32]
    assert set(found[0]["values"]) == {"voltage", "temperature", "errors"}
    assert found[0]["dialect"] == "V1.62"
    assert "motor 7 " in rmd("scan", 7).ended(0).out
    assert "no motor answered" in rmd("scan", 9, 10).ended(3).err


def test_status_again_and_again_is_for_one_motor(rmd):
    told = rmd("--id", "1-4", "status", "--every", "1s").ended(2).err
    assert "--every is for one motor: give one --id" in told
    assert "`motorlink watch -p sim:`" in told and "`samples({1: [...], 2: [...]})`" in told


def test_what_is_read_has_its_keys(rmd):
    assert list(rmd("-i", 4, "--json", "pid").ended(0).values) == GAINS
    assert set(rmd("-i", 4, "--json", "accel").ended(0).values) == {"acceleration"}
    assert set(rmd("-i", 4, "--json", "encoder").ended(0).values) == {"position", "raw", "offset"}
    for command in ("pid", "acceleration", "encoder", "angle"):
        assert rmd("-i", 4, command).ended(0).out
    readings = rmd("--json", "angle", "--every", "10ms", "--count", 4).ended(0).lines
    assert [set(reading["values"]) for reading in readings] == [ANGLES] * 4
    assert readings[0]["t"] < readings[-1]["t"]


def test_raw_sends_eight_bytes(rmd):
    answer = rmd("-i", 4, "--json", "raw", "9a").ended(0).json
    assert (answer["ok"], answer["data"]) == (True, "9a 19 00 f0 00 00 00 00")
    assert rmd("-i", 4, "raw", "9A", "1", "2").ended(0).out == "9a 19 00 f0 00 00 00 00\n"


def test_trace_shows_both_directions_on_stderr(run, sim):
    rmd = on(run, sim(st=()).port("slcan"))
    *opening, sent, received = rmd("-i", 4, "--trace", "raw", "9a").ended(0).err.splitlines()
    # A motor may still answer another program: it is asked twice first.
    assert [line.split()[2] for line in opening if "->" in line] == ["144#9a", "144#9c"]
    assert "-> 144#9a 00 00 00 00 00 00 00" in sent
    assert "<- 144#9a 19 00 f0 00 00 00 00" in received


# What acts.


@pytest.mark.parametrize(
    "command, first",
    [
        ("torque 0.1", "turns with 0.096 A"),
        ("speed -20.5", "turns at -20.50 °/s"),
        ("--raw speed 2050", "turns at 2050"),
        ("--gear-ratio 6 speed 20.5", "turns at 20.500 °/s"),
        ("position -10.25 --max-speed 200", "turns to -10.25 °"),
        ("single-turn-position 359.99 ccw --max-speed 100 --full-turn", "turns to 359.99 ° counterclockwise"),
    ],
)
def test_a_motion_command_is_printed_before_the_state_at_the_reply(rmd, command, first):
    done = rmd("-i", 3, *command.split()).ended(0)
    assert done.out.splitlines()[0] == f"motor 3 {first}; its state at the reply:"
    assert set(rmd("-i", 3, "--json", *command.split()).ended(0).values) == MOTION


def test_values_are_sent_as_they_were_meant(rmd):
    for command, sent in [
        ("position 10 --max-speed 1.999", "a4 00 01 00 e8 03 00 00"),
        ("single-turn-position 10 cw --full-turn --max-speed 360.999", "a6 00 68 01 e8 03 00 00"),
        ("--raw position 1000 --max-speed 2.9", "a4 00 02 00 e8 03 00 00"),
        ("torque -1e-1", "a1 00 00 00 fa ff 00 00"),
        ("torque -.1", "a1 00 00 00 fa ff 00 00"),
    ]:
        assert f"-> 141#{sent}" in rmd("--trace", *command.split()).ended(0).err


@pytest.fixture
def near(run, sim, tmp_path):
    """Runs `motorlink rmd` on motor 1, which stands at 90.02°: one count past 90.00°."""
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\nplant.angle_degrees = 90.034\n")
    bus = sim(config, st=())
    return bus, on(run, bus.port("slcan"))


def test_a_move_that_could_be_nearly_a_full_turn_is_refused(near):
    bus, rmd = near
    refused = rmd("--trace", "single-turn-position", 90, "cw").ended(2).err
    assert "motor 1 is at 90.02°, 0.02° past 90.00° clockwise" in refused
    assert "try `counterclockwise`, or add `--full-turn`" in refused
    assert "-> 141#94" in refused and "-> 141#a" not in refused
    # In digits of 0.01°, as the angle.
    rmd("--raw", "single-turn-position", 8980, "cw", "--max-speed", 3, "--tolerance", 22).ended(2)
    refused = rmd("single-turn-position", 90.02, "ccw", "--tolerance", 359.99).ended(2).err
    assert "add `--full-turn` to allow the move" in refused
    assert "outside 0 to" in rmd("single-turn-position", 90, "cw", "--tolerance=-1").ended(2).err
    assert bus.motor(1)["mode"] == "off"

    rmd("single-turn-position", 90, "ccw", "--max-speed", 100).ended(0)
    eventually(lambda: abs(bus.motor(1)["angle_degrees"] - 90) < 0.022, "motor 1 is at 90°")
    rmd("single-turn-position", 89.8, "cw", "--max-speed", 3, "--tolerance", 0.1).ended(0)


def test_a_full_turn_is_made_on_an_explicit_word(near):
    bus, rmd = near
    sent = rmd("--trace", "single-turn-position", 90, "cw", "--full-turn").ended(0).err
    assert "-> 141#94" not in sent
    eventually(lambda: abs(bus.motor(1)["angle_degrees"] - 450) < 0.1, "motor 1 made a turn")
    # A raw frame is sent without a check.
    rmd("raw", *"a5 00 00 00 1e 23".split()).ended(0)
    eventually(lambda: bus.motor(1)["angle_degrees"] > 800, "motor 1 makes another turn")


def test_torque4_answers_for_each_motor(rmd):
    replies = rmd("--json", "torque4", 0, -0.1, 0.1, 0).ended(0).lines
    assert [reply["motor"] for reply in replies] == [1, 2, 3, 4]
    assert set(replies[0]["values"]) == MOTION
    assert len(rmd("torque4", 0, 0, 0, 0).ended(0).out.splitlines()) == 4


def test_rom_is_written_only_on_an_explicit_word(rmd):
    for command in ("zero", "encoder-offset 5", "raw 19", "raw 32", "raw 91"):
        assert "--write-rom" in rmd(*command.split()).ended(2).err
    assert set(rmd("--write-rom", "--json", "zero").ended(0).values) == {"offset"}
    assert rmd("--write-rom", "--json", "encoder-offset", 5).ended(0).values == {"offset": 5}
    assert "gains for good" in rmd("--write-rom", "pid", 1, 2, 3, 4, 5, 6).ended(0).out


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


# What a person gets wrong.


@pytest.mark.parametrize(
    "command, message",
    [
        ("torque 33", "±32 A"),
        ("--raw position 10 --max-speed 0.9", "outside 1 to 65535 digits"),
        ("torque4 0 0 0 0 --expect 1,5", "motors 1 to 4"),
        ("--speed-limit 0.9 speed 1", "--speed-limit: 0.9 °/s is outside 1 to 65535 °/s"),
        ("--current-limit 32.1 torque 1", "--current-limit: 32.1 A is beyond ±32 A"),
        ("raw 1 2 3 4 5 6 7 8 9", "8 bytes"),
        ("raw zz", "not hexadecimal"),
        ("--current-limit 1 torque -1.01", "-1.008 A is beyond the limit of 0.992 A; nothing was sent"),
        ("--current-limit 1 torque4 0 0 0 1.01", "motor 4: torque current 1.008 A"),
        ("--current-limit 62 --raw torque 63", "1.008 A is beyond the limit"),
        ("--speed-limit 360.9 position 90 --max-speed 361 --wait", "361.00 °/s is beyond the limit of 360 °/s"),
        ("--speed-limit 360 single-turn-position 90 cw", "add --max-speed"),
        ("--speed-limit 360 --id 1-3 speed 361", "beyond the limit"),
    ],
)
def test_what_does_not_fit_is_not_sent(rmd, command, message):
    refused = rmd("--trace", *command.split()).ended(2)
    assert message in refused.err and "->" not in refused.err


# What goes wrong on the line.


def test_a_motor_that_is_not_there_is_told(rmd):
    message = rmd("-i", 9, "status").ended(3).err
    assert "motor 9 does not answer" in message and " scan` lists" in message
    assert "does not answer 0x01" in rmd("raw", "01").ended(3).err


def test_torque4_tells_what_answered_and_waits_only_for_the_expected_motors(run, sim, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 3\n")
    bus = sim(config, st=())
    rmd = on(run, bus.port("slcan"))
    message = rmd("torque4", 0, 0, 0, 0).ended(3)
    assert [line.split()[1] for line in message.out.splitlines()] == ["1", "3"]
    two, four = message.err.splitlines()
    assert "motor 2 does not answer" in two and "motor 4 does not answer" in four
    replies = rmd("--json", "torque4", 0, 0, 0.5, 0, "--expect", "1,3").ended(0).lines
    assert [(reply["motor"], reply["ok"]) for reply in replies] == [(1, True), (3, True)]
    partly = rmd("torque4", 0, 0, 0, 0, "--expect", 1, "--expect", 2).ended(3)
    assert [line.split()[1] for line in partly.out.splitlines()] == ["1"]
    assert "motor 2 does not answer" in partly.err and "motor 4" not in partly.err
    # The frame reaches a motor that is not expected to answer.
    rmd("torque4", 0, 0, 0.5, 0, "--expect", 1).ended(0)
    eventually(lambda: bus.motor(3)["angle_degrees"] > 10, "motor 3 turns")


def test_a_motor_that_speaks_v3_is_named_and_not_driven(run, tmp_path):
    def v3_motor(frame):
        return ["t24189A19000100F00000"] if frame.startswith("t141") else []

    with device(tmp_path / "can", slcan_adapter(v3_motor)) as link:
        rmd = on(run, f"slcan:{link}")
        message = rmd("status").ended(3).err
        assert "V3" in message and "0x241" in message
        found = rmd("--json", "scan", 1).ended(0).json
        assert found["motor"] == 1 and "V3" in found["dialect"]
        assert "it is not driven" in rmd("scan", 1).ended(0).out


def test_error_bits_that_mean_nothing_are_no_errors(run, tmp_path):
    """Bits 1, 2 and 4 to 7 of the error state are invalid (3, Read motor status 1)."""
    bits = {"state": "F6"}

    def motor(frame):
        return [f"t1418{frame[5:7]}1900F0000000{bits['state']}"]

    with device(tmp_path / "can0", slcan_adapter(motor)) as path:
        clear = lambda *words: on(run, f"slcan:{path}")("clear-errors", *words)
        assert clear("--json").ended(0).values["errors"] == []
        assert "no error (bits 0xf6 mean nothing)" in clear().ended(0).out
        bits["state"] = "F7"
        kept = clear("--json").ended(1)
        assert kept.values["errors"] == ["LOW_VOLTAGE"] and "still has errors" in kept.err
