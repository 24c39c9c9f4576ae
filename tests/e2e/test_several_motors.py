"""One command for several motors: `--id 1,3`, `--id 1-4`, `off --all`, `stop --all`."""

import pytest


@pytest.fixture(name="bench")
def on_a_bus(sim):
    return sim(st=())


@pytest.fixture(name="rmd")
def on_its_port(run, bench):
    port = bench.port("slcan")
    return lambda *words: run("rmd", "-p", port, "--timeout", "1s", *words)


def modes(bench):
    return [bench.motor(number)["mode"] for number in (1, 2, 3, 4)]


@pytest.mark.parametrize(("command", "mode"), [("off", "off"), ("stop", "stopped")])
def test_all_motors_come_to_rest(bench, rmd, command, mode):
    rmd("--id", "1-4", "speed", 100).ended(0)
    assert modes(bench) == ["speed"] * 4
    done = rmd("--json", command, "--all").ended(0)
    assert [(line["motor"], line["ok"]) for line in done.lines] == [(n, True) for n in (1, 2, 3, 4)]
    assert "28 IDs did not answer 4 requests: no motor, no supply, or no connection to it" in done.err
    assert modes(bench) == [mode] * 4


@pytest.mark.parametrize("command", ["off", "stop"])
def test_ids_without_a_motor_are_no_failure_at_the_default_timeout(run, command):
    done = run("rmd", "-p", "sim:", "--json", command, "--all").ended(0)
    assert [line["motor"] for line in done.lines] == [1, 2, 3, 4]
    done = run("rmd", "-p", "sim:", "--id", "1,9", command).ended(3)
    assert "motor 9 does not answer" in done.err


@pytest.mark.parametrize("command", ["off", "stop"])
def test_a_stop_without_ids_is_refused(bench, rmd, command):
    rmd("--id", "1-4", "speed", 100).ended(0)
    refused = rmd("--trace", command).ended(2).err
    assert "name the motors: --id 1, or --all" in refused and "->" not in refused
    assert modes(bench) == ["speed"] * 4


@pytest.mark.parametrize("ids", [["--id", "1,3"], ["--id", "1", "--id", "3"], ["-i", "1,3-3"]])
def test_a_command_reaches_the_motors_that_are_meant(bench, rmd, ids):
    done = rmd("--json", *ids, "speed", 100).ended(0)
    assert [line["motor"] for line in done.lines] == [1, 3]
    assert modes(bench) == ["speed", "off", "speed", "off"]


def test_a_motor_that_is_not_there_keeps_no_other_from_stopping(bench, rmd):
    rmd("--id", "1-4", "speed", 100).ended(0)
    done = rmd("--json", "--id", "9,1-4", "stop").ended(3)
    assert [(line["motor"], line["ok"]) for line in done.lines] == [
        *((number, True) for number in (1, 2, 3, 4)),
        (9, False),
    ]
    assert modes(bench) == ["stopped"] * 4


def test_a_motor_that_is_not_there_keeps_no_other_from_the_command(bench, rmd):
    done = rmd("--id", "9,2", "torque", 0.5).ended(3)
    assert "motor 2" in done.out
    assert "motor 9 does not answer" in done.err
    assert modes(bench)[1] == "torque"


def test_without_any_motor_all_is_a_failure(bench, run):
    port = bench.port("slcan")
    lost = ("rmd", "-p", port, "--timeout", "20ms", "--fault", "drop=1")
    assert "may still be turning" in run(*lost, "off", "--all").ended(3).err


@pytest.mark.parametrize("loss", [0.05, 0.4])
@pytest.mark.parametrize(("command", "mode"), [("off", "off"), ("stop", "stopped")])
@pytest.mark.parametrize("ids", [["--all"], ["--id", "1-4"], ["--id", "1"]])
def test_motors_stop_on_a_line_that_loses_frames(bench, run, rmd, loss, command, mode, ids):
    for seed in range(3):
        rmd("--id", "1-4", "speed", 100).ended(0)
        bad = ("--fault", f"drop={loss},seed={seed}")
        done = run("rmd", "-p", bench.port("slcan"), *bad, command, *ids)
        meant = modes(bench)[:1] if ids == ["--id", "1"] else modes(bench)
        assert meant == [mode] * len(meant), done.err
        assert done.code in (0, 3)
        # A motor without a confirmation is an error.
        is_confirmed = len(done.out.splitlines()) == len(meant)
        assert is_confirmed if done.code == 0 else "may still be turning" in done.err, done.err


def test_what_is_for_one_motor_refuses_several(rmd):
    for words in (["zero"], ["encoder-offset", 3], ["status", "--every", "1s"]):
        assert "one --id" in rmd("--id", "1,2", *words).ended(2).err
    for wrong in ("0", "33", "4-1", "1,,2"):
        assert "1 to 32" in rmd("--id", wrong, "angle").ended(2).err


def test_a_value_that_is_out_of_range_is_told_once(rmd):
    done = rmd("--id", "1-4", "torque", 99).ended(2)
    assert done.err.count("99") == 1


@pytest.fixture(name="rmd_into")
def on_its_port_into(piped, bench):
    return lambda words, out: piped(f"rmd -p {bench.port('slcan')} --timeout 500ms {words}", out)


@pytest.mark.parametrize(("out", "code"), [("| true", 0), ("| head -n 1", 0), ("> /dev/full", 3)])
@pytest.mark.parametrize("json", ["", "--json"])
def test_output_that_cannot_be_written_keeps_no_motor_from_its_command(bench, rmd, rmd_into, out, code, json):
    rmd("--id", "1-4", "speed", 100).ended(0)
    done = rmd_into(f"--id 1-4 {json} torque 0", out)
    assert done.code == code, done.err
    assert ("the command was carried out" in done.err) == (code == 3)
    assert modes(bench) == ["torque"] * 4


@pytest.mark.parametrize("words", ["--id 9,1 off", "--id 9,1 --json off", "--id 1,9 torque 0"])
def test_a_closed_output_hides_no_failure(rmd_into, words):
    done = rmd_into(words, "| true")
    assert done.code == 3
    assert "motor 9" in done.err


def test_a_closed_output_hides_no_motor_that_four_torques_do_not_reach(piped, sim, tmp_path):
    config = tmp_path / "one.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n")
    port = sim(config, st=()).port("slcan")
    done = piped(f"rmd -p {port} torque4 0 0 0 0", "| true")
    assert done.code == 3 and "motor 4" in done.err


def test_a_move_that_fails_is_the_last_and_the_motors_before_it_are_stopped(run, sim, tmp_path):
    config = tmp_path / "two.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 10\n")
    bus = sim(config, st=())
    words = ("--id", "1,9,10", "position", 90, "--max-speed", 720, "--wait")
    done = run("rmd", "-p", bus.port("slcan"), "--timeout", "1s", *words).ended(3)
    assert "motor 9 does not answer" in done.err and "motor 1 was stopped" in done.err
    assert [bus.motor(number)["mode"] for number in (1, 10)] == ["stopped", "off"]


@pytest.mark.parametrize("words", [["off", "--all"], ["torque4", 0, 0, 0, 0], ["scan"]])
def test_an_id_without_a_meaning_is_refused(bench, rmd, words):
    rmd("--id", "1-4", "speed", 100).ended(0)
    assert "leave out --id" in rmd("--id", 2, *words).ended(2).err
    assert modes(bench) == ["speed"] * 4
