"""What to try after a mistake of a first hour: the wrong file, the wrong port, the wrong profile.

Words that no command has are tested in crates/cli/src/help/tests.rs.
"""

import pytest

SCENARIO = 'title = "rest"\nduration = 0.1\n[[st.motor]]\n'


@pytest.mark.parametrize(
    "words, tip",
    [
        ("st --json info", "-p PORT"),
        ("st -p COM3 status", "`COM3` is a port of Windows, and this system is not Windows; `motorlink ports`"),
        ("rmd -p can0 scan", "did you mean `socketcan:can0`?"),
        ("rmd -p ./can0 scan", "write -p slcan:./can0"),
        ("st -p slcan:./st0 status", "for an ST drive on this line write -p ./st0"),
        ("st -p socketcan:can0 status", "for RMD motors on a CAN bus use `motorlink rmd`"),
        ("st get SPEED_MES -p sim:", "did you mean `SPEED_MEAS`?"),
        ("st get SPEED_* -p sim:", "`motorlink st registers 'SPEED_*'`"),
    ],
)
def test_a_command_line_that_makes_no_sense_is_answered_with_what_to_write(run, words, tip):
    assert tip in run(*words.split()).ended(2).err


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


def test_a_plot_is_not_written_into_a_file_of_another_format(run, tmp_path):
    scenario = tmp_path / "rest.toml"
    scenario.write_text(SCENARIO + '[[panel]]\nsignals = ["st1.speed_rpm"]\n')
    message = run("sim", "run", scenario, "--plot", tmp_path / "run.PDF").ended(2).err
    assert "--plot writes SVG and PNG" in message and ".svg" in message
    assert [path.name for path in tmp_path.iterdir()] == ["rest.toml"]
    run("sim", "run", scenario, "--plot", tmp_path / "run").ended(0)


@pytest.fixture
def cold(sim, tmp_path):
    """The port of a drive of `mcsdk-5.4` at -10 °C."""
    config = tmp_path / "cold.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\nplant.heat.ambient = -10.0\n')
    return sim(config, rmd=()).port("pty")


def test_a_value_that_is_plausible_in_the_other_profile_only_is_neither_printed_nor_replaced(run, cold):
    wrong = run("st", "-p", cold, "--trace", "status").ended(1)
    assert "HEATS_TEMP is 65526 °C in profile spec" in wrong.err and "-10 °C in profile mcsdk-5.4" in wrong.err
    assert "add --profile mcsdk-5.4" in wrong.err
    assert "ACK HEATS_TEMP is 65526 °C in profile spec" in wrong.err, "the trace"
    assert "65526" not in wrong.out and "BUS_VOLTAGE   325 V" in wrong.out
    object = run("st", "-p", cold, "--json", "get", "HEATS_TEMP", "SPEED_MEAS").ended(1).json
    assert list(object["values"]) == ["SPEED_MEAS"] and object["errors"]["HEATS_TEMP"]["kind"] == "refused"
    assert "HEATS_TEMP    -10 °C" in run("st", "-p", cold, "--profile", "mcsdk-5.4", "status").ended(0).out
    assert "65526" in run("st", "-p", cold, "--raw", "get", "HEATS_TEMP").ended(0).out
    set = run("st", "-p", cold, "set", "FLUXWK_BUS", 90).ended(1)
    assert "FLUXWK_BUS was not written" in set.err and "add --profile mcsdk-5.4" in set.err


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


def test_the_conformance_kit_names_the_profile_that_fits(run, cold):
    kit = ("conformance", "st", "-p", cold, "--profile", "spec", "--only")
    message = run(*kit, "a_shorter_value").ended(1).err
    assert "try --profile mcsdk-5.4" in message and "exist only in profile spec" in message
    assert "try --profile" not in run(*kit, "a_shorter_value_keeps_the_other_bytes[FF_").ended(1).err
