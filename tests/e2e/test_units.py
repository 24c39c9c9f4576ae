"""`--gear-ratio`, `--encoder-bits` and `--full-scale`: each value is converted once.

The conversions are tested in crates/proto/src/rmd/gear.rs and encoder.rs, and crates/proto/src/st/full_scale.rs.
"""

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
def geared(run):
    """Runs `motorlink rmd` with the gear ratio on motors inside its process."""
    return lambda *words: run("rmd", "-p", "sim:", "--gear-ratio", RATIO, "--trace", *words)


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
    # The tolerance is that of the output shaft. As many degrees of the motor shaft fit a frame.
    beyond = ("--max-speed", 60, "--wait", "--wait-tolerance", 4_000_000)
    assert "3579139.411 °" in rmd("position", 30, *beyond, geared=True).ended(2).err
    rmd("position", 0, *beyond).ended(0)
    words = ("position", 60, "--max-speed", 1, "--wait", "--wait-timeout", "100ms")
    refused = rmd(*words, geared=True).ended(1).err
    assert "from its target" in refused and "those of the motor shaft, 6 times" in refused


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
    assert table.split()[-2:] == 2 * [f"{shown['multi_turn_angle']:.3f}"]


def test_a_speed_and_an_acceleration_are_multiplied(geared):
    assert "-> 141#a2 00 00 00 e0 2e 00 00" in geared("speed", 20).ended(0).err
    written = geared("--json", "acceleration", 100).ended(0)
    assert written.json["values"]["acceleration"] == {"value": 100.0, "unit": "°/s²", "shaft": "output"}
    assert "-> 141#34 00 00 00 58 02 00 00" in written.err
    assert "give 0, or 0.2 °/s² at least" in geared("acceleration", 0.01).ended(2).err


def test_a_speed_limit_is_that_of_the_output_shaft(geared):
    for command in ("speed 60.1", "position 10 --max-speed 60.2", "raw a2 00 00 00 39 8d 00 00"):
        refused = geared("--speed-limit", 60, *command.split()).ended(2).err
        assert "360 °/s" in refused and "those of the motor shaft, 6 times those of the output" in refused
        assert "->" not in refused
    geared("--speed-limit", 60, "speed", 60).ended(0)


def test_a_move_within_a_turn_is_refused_behind_a_gear(run, geared):
    refused = geared("single-turn-position", 10, "cw", "--full-turn").ended(2).err
    assert "one turn of the motor shaft" in refused and "use `position`" in refused
    # A ratio of 1 names the shaft and changes no value.
    one = ("rmd", "-p", "sim:", "--json", "--gear-ratio", 1)
    shown = run(*one, "single-turn-position", 10, "cw", "--full-turn").ended(0).json["values"]
    assert shown["speed"]["shaft"] == "output"
    assert "shaft" not in run("rmd", "-p", "sim:", "--json", "angle").ended(0).out


@pytest.mark.parametrize("words", ["rmd --gear-ratio=6 status", "rmd --encoder-bits=14 status", "st --full-scale=9 info"])
def test_raw_values_are_not_converted(run, words):
    protocol, *rest = words.split()
    assert "leave one out" in run(protocol, "-p", "sim:", "--raw", *rest).ended(2).err


# The encoder.


def test_encoder_counts_have_an_angle_behind_them(rmd):
    rmd("position", 180, "--max-speed", 720, "--wait").ended(0)
    values = rmd("--json", "--encoder-bits", 14, "encoder").ended(0).values
    assert list(values) == ["position", "position_angle", "raw", "raw_angle", "offset", "offset_angle"]
    assert values["position_angle"] == near(values["position"] * 360 / COUNTS, 0.005)
    assert values["position_angle"] == near(180, 0.2)
    assert list(rmd("--json", "encoder").ended(0).values) == ["position", "raw", "offset"]
    # Counts beyond the given width are an error.
    assert "an encoder of 12 bits ends at 4095" in rmd("--encoder-bits", 12, "encoder").ended(1).err
    offset = rmd("--encoder-bits", 14, "--write-rom", "encoder-offset", COUNTS).ended(1).err
    assert "nothing was sent" in offset
    assert rmd("--json", "encoder").ended(0).values["offset"] == 0


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
    assert "ramp to Iq 0.4" in st(*FULL_SCALE, "torque-ramp", 0.5, 100).ended(0).out
    st(*FULL_SCALE, "set", "TORQUE_REF", 1).ended(0)
    assert st("--json", "get", "TORQUE_REF").ended(0).values == {"TORQUE_REF": 1985}
    st(*FULL_SCALE, "revup-data", 1, 500, 1.65, 300).ended(0)
    phases = st(*FULL_SCALE, "--json", "revup-data").ended(0).lines
    assert phases[1]["values"]["torque"] == {"value": 3276, "unit": "s16A", "amps": 1.6496}
    st(*FULL_SCALE, "set", "SPEED_KP", 1200).ended(0)


def test_a_current_limit_is_in_amperes_and_none_is_beyond_the_full_scale(st):
    limited = (*FULL_SCALE, "--current-limit", 1)
    st("current-reference", 5, 5).ended(0)
    for command in ("current-reference {} 0", "torque-ramp {} 50", "set TORQUE_REF {}", "revup-data 0 500 {} 300"):
        st(*limited, *command.format("-1.01").split()).ended(2)
        st(*FULL_SCALE, *command.format("16.6").split()).ended(2)
    assert st("--json", "get", "TORQUE_REF").ended(0).values == {"TORQUE_REF": 5}
    st(*limited, "current-reference", 1, -1).ended(0)
    refused = st("current-reference", 1.5, 0).ended(2).err
    assert "s16A" in refused and "--full-scale" in refused
    assert "does not fit" in st("current-reference", 40000, 0).ended(2).err
