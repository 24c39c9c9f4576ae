"""Motion commands of `motorlink rmd` to a motor with an error: it answers them and does not turn."""

import pytest

from peers import device, slcan_adapter

TEXT = "motor 2 answered and does not turn: it reports low voltage protection (supply 5.0 V, 25 °C)"
LOW = "plant.supply.voltage = 5.0\n"


@pytest.fixture
def bus(tmp_path):
    """Motors 1 and 2. The supply of motor 2 is too low."""
    config = tmp_path / "bench.toml"
    config.write_text(f"[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 2\n{LOW}")
    return f"sim:{config}"


def test_a_motor_with_an_error_is_told_after_a_motion_command(run, bus):
    for words in ("torque 0.5", "speed 90", "position 90", "single-turn-position 90 cw --full-turn", "run"):
        failed = run("rmd", "-p", bus, "-i", 2, *words.split()).ended(1)
        assert TEXT in failed.err and failed.out == "", failed
        clear = f"`motorlink rmd -p {bus} --id 2 clear-errors`, and repeat the command"
        assert f"remove the cause, then {clear}" in failed.err
    failed = run("rmd", "-p", bus, "-i", 2, "--json", "speed", 90).ended(1)
    assert failed.out == "" and '"kind":"refused"' in failed.err and '"motor":2' in failed.err


@pytest.mark.parametrize("words", [("--id", "1,2", "speed", 90), ("torque4", 0.5, 0.5, 0, 0, "--expect", "1,2")])
def test_of_several_motors_the_one_with_an_error_is_told(run, bus, words):
    lines = run("rmd", "-p", bus, "--json", *words).ended(1).lines
    assert [(line["motor"], line["ok"]) for line in lines] == [(1, True), (2, False)]
    assert lines[1]["error"]["kind"] == "refused"
    assert TEXT in run("rmd", "-p", bus, *words).ended(1).err


def test_a_motor_that_does_not_tell_its_errors_may_be_turning(run, tmp_path):
    moved = []

    def motor(frame):
        """It falls silent after the reply to the motion command."""
        if moved:
            return []
        if frame[5:7] == "A2":
            moved.append(frame)
        return [f"t1418{frame[5:7]}1900F000000000"]

    with device(tmp_path / "can0", slcan_adapter(motor)) as path:
        done = run("rmd", "-p", f"slcan:{path}", "--timeout", "500ms", "speed", 90).ended(3)
    assert "motor 1 may be turning now: the motor took the command, and its errors are unknown" in done.err
    assert "--id 1 stop`" in done.err
