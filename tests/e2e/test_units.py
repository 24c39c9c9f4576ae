"""`--gear-ratio`, `--encoder-bits` and `--full-scale`: each value is converted once."""

import csv

import pytest

RATIO = 6
#: 14 bits, as the simulated motors have.
COUNTS = 1 << 14
#: Half of the last place of an angle behind the gear, degrees.
PLACE = 0.0005


@pytest.fixture
def rmd(run, sim):
    """Runs `motorlink rmd` on motors of the test's own; `geared=True` with the gear ratio."""
    port = sim(st=()).port("slcan")

    def rmd(*words, geared=False):
        gear = ("--gear-ratio", RATIO) if geared else ()
        return run("rmd", "-p", port, "--timeout", "1s", *gear, *words)

    return rmd


@pytest.fixture
def st(run, sim):
    """Runs `motorlink st` on a drive of the test's own, with the profile that has torque ramps."""
    port = sim("--profile", "mcsdk-5.4", rmd=()).port("pty")
    return lambda *words: run("st", "-p", port, "--profile", "mcsdk-5.4", *words)


FULL_SCALE = ("--full-scale", "16.5")


def near(value, within=PLACE):
    return pytest.approx(value, abs=within)


# The gear.


def test_a_move_with_wait_ends_at_the_angle_of_the_output_shaft(rmd):
    moved = rmd("--json", "position", 30, "--max-speed", 60, "--wait", geared=True).ended(0).json
    assert moved["values"]["speed"] == {"value": 0.0, "unit": "°/s", "shaft": "output"}
    # 0.1° at the motor shaft is the tolerance.
    assert rmd("--json", "angle").ended(0).values["multi_turn_angle"] == near(30 * RATIO, 0.1)
    assert rmd("--json", "angle", geared=True).ended(0).values["multi_turn_angle"] == near(30, 0.1 / RATIO + PLACE)


def test_the_tolerance_of_a_wait_is_that_of_the_output_shaft(rmd):
    wait = ("--max-speed", 60, "--wait", "--wait-tolerance", 1)
    rmd("position", 30, *wait, geared=True).ended(0)
    # As many degrees of the motor shaft fit a frame.
    beyond = (*wait[:-1], 4_000_000)
    assert "3579139.411 °" in rmd("position", 30, *beyond, geared=True).ended(2).err
    rmd("position", 0, *beyond).ended(0)


def test_text_table_csv_and_json_have_the_same_values(rmd, tmp_path):
    rmd("position", 30, "--max-speed", 60, "--wait", geared=True).ended(0)
    bits = ("--encoder-bits", 14)
    motor = rmd("--json", "status").ended(0).values
    shown = rmd("--json", "status", *bits, geared=True).ended(0).values
    expected = {name: near(motor[name] / RATIO) for name in ("multi_turn_angle", "single_turn_angle")}
    assert {name: shown[name] for name in expected} == expected
    assert shown["encoder"] == motor["encoder"]
    assert shown["encoder_angle"] == near(motor["encoder"] * 360 / COUNTS / RATIO)
    assert shown["voltage"] == motor["voltage"]
    text = rmd("status", *bits, geared=True).ended(0).out
    assert f"encoder angle      {shown['encoder_angle']:.3f} °" in text
    assert f"multi turn angle   {shown['multi_turn_angle']:.3f} °" in text
    path = tmp_path / "run.csv"
    table = rmd("status", *bits, "--every", "5ms", "--count", 1, "--csv", path, geared=True).ended(0).out
    (row,) = csv.DictReader(path.open(encoding="utf-8"))
    assert float(row["multi_turn_angle [° output shaft]"]) == shown["multi_turn_angle"]
    assert float(row["encoder_angle [° output shaft]"]) == shown["encoder_angle"]
    assert "speed [°/s output shaft]" in row and "voltage [V]" in row
    assert table.split()[-3:-1] == 2 * [f"{shown['multi_turn_angle']:.3f}"]


def test_a_speed_is_multiplied_and_its_reading_divided(rmd):
    rmd("speed", 20, geared=True).ended(0)
    for _ in range(200):
        fast = rmd("--json", "status").ended(0).values["speed"]
        if fast > 115:
            break
    assert fast == near(20 * RATIO, 5)
    assert rmd("--json", "status", geared=True).ended(0).values["speed"] == near(20, 1)
    rmd("--id", 1, "off").ended(0)


def test_an_acceleration_limit_is_written_and_read_behind_the_gear(rmd):
    written = rmd("--json", "acceleration", 100, geared=True).ended(0).json
    assert written["values"]["acceleration"] == {"value": 100.0, "unit": "°/s²", "shaft": "output"}
    assert rmd("--json", "acceleration").ended(0).values == {"acceleration": 600}
    refused = rmd("acceleration", 0.01, geared=True).ended(2).err
    assert "give 0, or 0.2 °/s² at least" in refused


@pytest.mark.parametrize(
    "command", ["speed 60.1", "position 10 --max-speed 60.2", "position 10", "raw a2 00 00 00 39 8d 00 00"]
)
def test_a_speed_limit_is_that_of_the_output_shaft(rmd, command):
    limit = ("--speed-limit", 60)
    refused = rmd(*limit, *command.split(), geared=True).ended(2).err
    assert "360 °/s" in refused and "those of the motor shaft, 6 times those of the output" in refused
    assert rmd("--json", "status").ended(0).values["speed"] == 0
    rmd(*limit, "speed", 60, geared=True).ended(0)
    rmd("--id", 1, "off").ended(0)


def test_a_move_that_does_not_arrive_names_the_shaft_of_its_distance(rmd):
    words = ("position", 60, "--max-speed", 1, "--wait", "--wait-timeout", "100ms")
    refused = rmd(*words, geared=True).ended(1).err
    assert "from its target" in refused and "those of the motor shaft, 6 times" in refused


def test_a_move_within_a_turn_is_refused_behind_a_gear(rmd):
    refused = rmd("single-turn-position", 10, "cw", "--full-turn", geared=True).ended(2).err
    assert "one turn of the motor shaft" in refused and "use `position`" in refused
    rmd("--gear-ratio", 1, "single-turn-position", 10, "cw", "--full-turn").ended(0)
    rmd("--id", 1, "off").ended(0)


def test_a_ratio_of_1_names_the_shaft_and_changes_no_value(rmd):
    plain = rmd("--json", "angle").ended(0)
    shown = rmd("--json", "--gear-ratio", 1, "angle").ended(0)
    assert shown.values == plain.values
    assert {value["shaft"] for value in shown.json["values"].values()} == {"output"}
    assert all("shaft" not in value for value in plain.json["values"].values())


@pytest.mark.parametrize("ratio", ["0", "-6", "nan", "inf", "-inf", "1e300", "6:1", ""])
def test_a_ratio_that_is_none_is_refused(run, ratio):
    refused = run("rmd", "-p", "sim:", f"--gear-ratio={ratio}", "angle").ended(2).err
    assert "--gear-ratio" in refused and ("0.001 to 10000" in refused or "for a gear of 6:1" in refused)


@pytest.mark.parametrize("option", ["--gear-ratio=6", "--encoder-bits=14"])
def test_raw_values_are_not_converted(run, option):
    refused = run("rmd", "-p", "sim:", "--raw", option, "status").ended(2).err
    assert "leave one out" in refused


# The encoder.


def test_encoder_counts_have_an_angle_behind_them(rmd):
    rmd("position", 90, "--max-speed", 720, "--wait").ended(0)
    values = rmd("--json", "--encoder-bits", 14, "encoder").ended(0).values
    assert list(values) == ["position", "position_angle", "raw", "raw_angle", "offset", "offset_angle"]
    assert values["position_angle"] == near(values["position"] * 360 / COUNTS, 0.005)
    assert values["position_angle"] == near(90, 0.2)
    assert list(rmd("--json", "encoder").ended(0).values) == ["position", "raw", "offset"]


def test_counts_beyond_the_given_width_are_an_error(rmd):
    rmd("position", 180, "--max-speed", 720, "--wait").ended(0)
    refused = rmd("--encoder-bits", 12, "encoder").ended(1).err
    assert "an encoder of 12 bits ends at 4095" in refused
    offset = rmd("--encoder-bits", 14, "--write-rom", "encoder-offset", COUNTS).ended(1).err
    assert "nothing was sent" in offset
    assert rmd("--json", "encoder").ended(0).values["offset"] == 0


@pytest.mark.parametrize("bits", ["11", "19", "0", "-14", "14.5", "x"])
def test_a_width_that_no_encoder_has_is_refused(run, bits):
    refused = run("rmd", "-p", "sim:", f"--encoder-bits={bits}", "encoder").ended(2).err
    assert "12 to 18 bits" in refused


# The full scale.


def test_currents_are_taken_and_shown_in_amperes(st):
    done = st(*FULL_SCALE, "current-reference", 1.5, -0.25).ended(0).out
    assert "Iq 1.4996 A (2978 s16A), Id -0.2498 A (-496 s16A)" in done
    assert st("--json", "get", "TORQUE_REF", "FLUX_REF").ended(0).values == {"TORQUE_REF": 2978, "FLUX_REF": -496}
    shown = st(*FULL_SCALE, "--json", "get", "TORQUE_REF", "SPEED_MEAS").ended(0).json["values"]
    assert shown["TORQUE_REF"] == {"value": 2978, "unit": "s16A", "amps": 1.4996}
    assert shown["SPEED_MEAS"] == {"value": 0, "unit": "rpm"}
    assert "1.4996 A (2978 s16A)" in st(*FULL_SCALE, "status").ended(0).out
    words = ("get", "TORQUE_REF", "--every", "5ms", "--count", 1, "--csv", "-")
    header, row = csv.reader(st(*FULL_SCALE, *words).ended(0).out.splitlines())
    assert (header[1], row[1]) == ("TORQUE_REF [A]", "1.4996")


def test_each_command_takes_amperes(st):
    st(*FULL_SCALE, "torque-ramp", 0.5, 100).ended(0)
    st(*FULL_SCALE, "set", "TORQUE_REF", 1).ended(0)
    assert st("--json", "get", "TORQUE_REF").ended(0).values == {"TORQUE_REF": 1985}
    st(*FULL_SCALE, "revup-data", 1, 500, 1.65, 300).ended(0)
    phases = st(*FULL_SCALE, "--json", "revup-data").ended(0).lines
    assert phases[1]["values"]["torque"] == {"value": 3276, "unit": "s16A", "amps": 1.6496}
    st(*FULL_SCALE, "set", "SPEED_KP", 1200).ended(0)


@pytest.mark.parametrize("amps, code", [("1", 0), ("1.01", 2), ("-1.01", 2)])
def test_a_current_limit_is_in_amperes(st, amps, code):
    limited = (*FULL_SCALE, "--current-limit", 1)
    st(*limited, "current-reference", amps, 0).ended(code)
    st(*limited, "current-reference", 0, amps).ended(code)
    st(*limited, "torque-ramp", amps, 50).ended(code)
    st(*limited, "set", "TORQUE_REF", amps).ended(code)
    st(*limited, "revup-data", 0, 500, amps, 300).ended(code)


@pytest.mark.parametrize(
    "words", ["current-reference 16.6 0", "current-reference nan 0", "set TORQUE_REF inf", "set TORQUE_REF x", "torque-ramp -17 50"]
)
def test_a_current_beyond_the_full_scale_is_refused(st, words):
    st("current-reference", 5, 5).ended(0)
    st(*FULL_SCALE, *words.split()).ended(2)
    assert st("--json", "get", "TORQUE_REF").ended(0).values == {"TORQUE_REF": 5}


def test_without_a_full_scale_a_current_is_a_whole_number_of_digits(st):
    refused = st("current-reference", 1.5, 0).ended(2).err
    assert "s16A" in refused and "--full-scale" in refused
    assert "does not fit" in st("current-reference", 40000, 0).ended(2).err


@pytest.mark.parametrize("amps", ["0", "-8.25", "nan", "inf", "1e300", "x"])
def test_a_full_scale_that_is_none_is_refused(run, amps):
    refused = run("st", "-p", "sim:", f"--full-scale={amps}", "info").ended(2).err
    assert "--full-scale" in refused and ("digit 32767" in refused or "such as 16.5" in refused)


def test_raw_currents_are_not_converted(st):
    assert "leave one out" in st("--raw", *FULL_SCALE, "get", "TORQUE_REF").ended(2).err


# The number of a motor.


def test_motor_0_is_refused_with_the_number_to_write(run):
    refused = run("st", "-p", "sim:", "--motor", 0, "start").ended(2).err
    assert "the first motor is 1" in refused and "write 1" in refused
    assert "1 to 32" in run("rmd", "-p", "sim:", "--id", 0, "off").ended(2).err
