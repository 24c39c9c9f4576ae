"""Wrong command lines of a first hour: each error says what to try."""

import pytest

SCENARIO = 'title = "rest"\nduration = 0.1\n[[st.motor]]\n'


@pytest.mark.parametrize(
    "words, tip",
    [
        ("-p sim: st status", "write options behind the protocol: motorlink st -p PORT status"),
        ("st ./st0 status", "write the port as -p ./st0"),
        ("guard st /dev/ttyACM0", "write the port as -p /dev/ttyACM0"),
        ("status", "write the protocol first"),
        ("scan", "write the protocol first"),
        ("version", "`motorlink --help` lists the commands"),
        ("st -p sim: speed 1500", "`speed` is for RMD motors"),
        ("rmd -p sim: start", "`start` is for ST drives"),
        ("rmd -p sim: 2 status", "write --id 2"),
        ("rmd -p sim: status 2", "write --id 2"),
        ("st -p sim: status 2", "write --motor 2"),
        ("st -p sim: -motor 2 status", "write --motor with two dashes"),
        ("rmd -p sim: -id 2 status", "write --id with two dashes"),
        ("rmd -p sim: position 90deg", "without a unit; DEGREES is: Angle, degrees"),
        ("rmd -p sim: speed 100rpm", "without a unit; DPS is: Speed, °/s"),
        ("rmd -p sim: position 90 --max-speed 5dps", "without a unit; DPS is: Maximum speed, °/s"),
        ("st -p sim: ramp 1500rpm 1s", "without a unit; RPM is: Speed at the end, rpm"),
        ("st -p sim: --baud 9600 status", "-p '/dev/ttyUSB0?baud=9600'"),
        ("rmd -p sim: --bitrate=500000 scan", "-p 'slcan:/dev/ttyACM0?bitrate=500000'"),
        ("guard st -p sim: --profile mcsdk-5.4", "a guard needs no profile"),
        ("st -p COM3 status", "`COM3` is a port of Windows, and this system is not Windows"),
        ("rmd -p PCAN_USBBUS1 scan", "is a port of Windows"),
        ("rmd -p ./can0 scan", "write -p slcan:./can0"),
        ("rmd -p can0 scan", "did you mean `socketcan:can0`?"),
        ("st -p slcan:./st0 status", "for an ST drive on this line write -p ./st0"),
        ("st -p socketcan:can0 status", "for RMD motors on a CAN bus use `motorlink rmd`"),
    ],
)
@pytest.mark.parametrize("json", [(), ("--json",)])
def test_an_invalid_command_line_is_answered_with_what_to_write(run, words, tip, json):
    message = run(*words.split(), *json).ended(2).err
    assert tip in message, message


def test_a_scenario_behind_sim_is_recognized(run, tmp_path):
    assert "`motorlink sim run none.toml` plays a scenario" in run("sim", "none.toml").ended(2).err
    assert "`motorlink sim --help` lists the commands" in run("sim", "pesets").ended(2).err
    assert "write the command before its options: `motorlink sim presets" in (
        run("sim", "--json", "presets").ended(2).err
    )
    path = tmp_path / "rest.toml"
    path.write_text(SCENARIO)
    assert f"the file is a scenario; `motorlink sim run {path}` plays a scenario" in run("sim", path).ended(2).err
    path.write_text("[[st.motor]]\nspeed = 1\n")
    assert "motorlink sim run" not in run("sim", path).ended(2).err


@pytest.mark.parametrize("name", ["run.jpg", "run.PDF"])
def test_a_plot_is_not_written_into_a_file_of_another_format(run, tmp_path, name):
    scenario = tmp_path / "rest.toml"
    scenario.write_text(SCENARIO + '[[panel]]\nsignals = ["st1.speed_rpm"]\n')
    message = run("sim", "run", scenario, "--plot", tmp_path / name).ended(2).err
    assert "--plot writes SVG and PNG" in message and ".svg" in message
    assert [path.name for path in tmp_path.iterdir()] == ["rest.toml"]
    run("sim", "run", scenario, "--plot", tmp_path / "run").ended(0)


@pytest.fixture
def cold(sim, tmp_path):
    """The port of a drive of `mcsdk-5.4` at -10 °C."""
    config = tmp_path / "cold.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\nplant.heat.ambient = -10.0\n')
    return sim(config, rmd=()).port("pty")


def test_a_temperature_that_is_plausible_in_the_other_profile_only_is_an_error(run, cold):
    wrong = run("st", "-p", cold, "status").ended(1)
    assert "HEATS_TEMP is 65526 °C in profile spec" in wrong.err and "-10 °C in profile mcsdk-5.4" in wrong.err
    assert "add --profile mcsdk-5.4" in wrong.err
    assert "65526" not in wrong.out and "BUS_VOLTAGE   325 V" in wrong.out
    object = run("st", "-p", cold, "--json", "get", "HEATS_TEMP", "SPEED_MEAS").ended(1).json
    assert list(object["values"]) == ["SPEED_MEAS"] and object["errors"]["HEATS_TEMP"]["kind"] == "refused"
    assert "HEATS_TEMP    -10 °C" in run("st", "-p", cold, "--profile", "mcsdk-5.4", "status").ended(0).out
    assert "65526" in run("st", "-p", cold, "--raw", "get", "HEATS_TEMP").ended(0).out


def test_a_share_of_another_profile_is_neither_printed_nor_replaced(run, cold):
    wrong = run("st", "-p", cold, "get", "FLUXWK_BUS").ended(1)
    assert "FLUXWK_BUS is 985 % in profile spec" in wrong.err and "98.5 % in profile mcsdk-5.4" in wrong.err
    set = run("st", "-p", cold, "set", "FLUXWK_BUS", 90).ended(1)
    assert "FLUXWK_BUS was not written" in set.err and "add --profile mcsdk-5.4" in set.err
    assert "it takes 0 to 100 %" in run("st", "-p", cold, "set", "FLUXWK_BUS", 985).ended(2).err
    right = run("st", "-p", cold, "--profile", "mcsdk-5.4", "get", "FLUXWK_BUS").ended(0)
    assert "98.5 %" in right.out
    assert "985" in run("st", "-p", cold, "--raw", "get", "FLUXWK_BUS").ended(0).out


def test_a_trace_says_that_a_value_may_be_of_the_other_profile(run, cold):
    trace = run("st", "-p", cold, "--trace", "get", "HEATS_TEMP").ended(1).err
    assert "ACK HEATS_TEMP is 65526 °C in profile spec" in trace


def test_a_value_of_another_size_keeps_the_others(run, cold):
    done = run("st", "-p", cold, "get", "SPEED_MEAS", "CTRBID", "BUS_VOLTAGE").ended(3)
    assert [line.split()[0] for line in done.out.splitlines()] == ["SPEED_MEAS", "BUS_VOLTAGE"]
    assert "CTRBID" in done.err and "add --profile mcsdk-5.4" in done.err
    words = ("get", "CTRBID", "BUS_VOLTAGE", "--every", "5ms", "--count", 3)
    lines = run("st", "-p", cold, "--json", *words).ended(3).lines
    assert [line["values"]["BUS_VOLTAGE"]["value"] for line in lines] == 3 * [325]


def test_an_unknown_frame_code_may_be_one_of_the_other_profile(run, cold):
    refused = run("st", "-p", cold, "--profile", "mcsdk-5.4", "position", "1rad", "1s").ended(1)
    assert "BAD_FRAME_ID" in refused.err and "try --profile spec" in refused.err


def test_the_time_of_samples_starts_at_0(run, drives):
    words = ("--json", "get", "SPEED_MEAS", "--every", "20ms", "--count", 3)
    times = [line["t"] for line in run("st", "-p", drives.st, *words).ended(0).lines]
    assert times[0] == 0 and times == sorted(times)


@pytest.mark.parametrize("served, tried", [("mcsdk-5.4", "spec"), ("spec", "mcsdk-5.4")])
def test_the_conformance_kit_names_the_profile_that_fits(run, sim, served, tried):
    port = sim("--profile", served, rmd=()).port("pty")
    message = run("conformance", "st", "-p", port, "--profile", tried, within=60).ended(1).err
    assert f"try --profile {served}" in message and f"exist only in profile {tried}" in message
    few = run("conformance", "st", "-p", port, "--profile", tried, "--only", "board_info", within=60)
    assert "try --profile" not in few.err
