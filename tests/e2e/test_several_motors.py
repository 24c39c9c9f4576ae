"""One command for several motors: `--id 1,3`, `--id 1-4`, `off --all`, `stop --all`."""

import pytest


@pytest.fixture(name="bench")
def on_a_bus(sim):
    return sim(st=())


@pytest.fixture(name="rmd")
def on_its_port(run, bench):
    port = bench.port("slcan")
    return lambda *words: run("rmd", "-p", port, "--timeout", "500ms", *words)


def modes(bench):
    return [bench.motor(number)["mode"] for number in (1, 2, 3, 4)]


def test_all_motors_come_to_rest(bench, rmd):
    rmd("--id", "1-4", "speed", 100).ended(0)
    for command in ("off", "stop"):
        refused = rmd("--trace", command).ended(2).err
        assert "name the motors: --id 1, or --all" in refused and "->" not in refused
    assert modes(bench) == ["speed"] * 4
    done = rmd("--json", "off", "--all").ended(0)
    assert [(line["motor"], line["ok"]) for line in done.lines] == [(n, True) for n in (1, 2, 3, 4)]
    assert "28 IDs did not answer 4 requests: no motor, no supply, or no connection to it" in done.err
    assert modes(bench) == ["off"] * 4


def test_a_command_reaches_the_motors_that_are_meant(bench, rmd):
    done = rmd("--json", "--id", "1", "-i", "3-3", "speed", 100).ended(0)
    assert [line["motor"] for line in done.lines] == [1, 3]
    assert modes(bench) == ["speed", "off", "speed", "off"]


def test_a_motor_that_is_not_there_keeps_no_other_from_stopping_or_from_the_command(bench, rmd):
    done = rmd("--id", "9,2", "torque", 0.5).ended(3)
    assert "motor 2" in done.out
    assert "motor 9 does not answer" in done.err
    assert modes(bench)[1] == "torque"
    rmd("--id", "1-4", "speed", 100).ended(0)
    done = rmd("--json", "--id", "9,1-4", "stop").ended(3)
    assert [(line["motor"], line["ok"]) for line in done.lines] == [
        *((number, True) for number in (1, 2, 3, 4)),
        (9, False),
    ]
    assert modes(bench) == ["stopped"] * 4


def test_without_any_motor_all_is_a_failure(run):
    lost = ("rmd", "-p", "sim:", "--timeout", "20ms", "--fault", "drop=1")
    assert "may still be turning" in run(*lost, "off", "--all").ended(3).err


def test_what_is_for_one_motor_refuses_several(run):
    for words in (["zero"], ["encoder-offset", 3]):
        assert "one --id" in run("rmd", "-p", "sim:", "--id", "1,2", *words).ended(2).err
    done = run("rmd", "-p", "sim:", "--id", "1-4", "torque", 99).ended(2)
    assert done.err.count("99") == 1


@pytest.mark.parametrize(("out", "code"), [("| true", 0), ("> /dev/full", 3)])
def test_output_that_cannot_be_written_keeps_no_motor_from_its_command(bench, rmd, piped, out, code):
    rmd("--id", "1-4", "speed", 100).ended(0)
    done = piped(f"rmd -p {bench.port('slcan')} --timeout 500ms --id 1-4 torque 0", out)
    assert done.code == code, done.err
    assert ("the command was carried out" in done.err) == (code == 3)
    assert modes(bench) == ["torque"] * 4


@pytest.mark.parametrize("words", ["--id 9,1 off", "--id 9,1 --json off", "--id 1,9 torque 0"])
def test_a_closed_output_hides_no_failure(piped, words):
    done = piped(f"rmd -p sim: {words}", "| true")
    assert done.code == 3
    assert "motor 9" in done.err


def test_a_closed_output_hides_no_motor_that_four_torques_do_not_reach(piped, tmp_path):
    config = tmp_path / "one.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n")
    done = piped(f"rmd -p sim:{config} torque4 0 0 0 0", "| true")
    assert done.code == 3 and "motor 4" in done.err


def test_a_move_that_fails_is_the_last_and_the_motors_before_it_are_stopped(run, sim, tmp_path):
    config = tmp_path / "two.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n[[rmd.motor]]\nid = 10\n")
    bus = sim(config, st=())
    words = ("--id", "1,9,10", "position", 90, "--max-speed", 720, "--wait")
    done = run("rmd", "-p", bus.port("slcan"), "--timeout", "1s", *words).ended(3)
    assert "motor 9 does not answer" in done.err and "motor 1 was stopped" in done.err
    assert [bus.motor(number)["mode"] for number in (1, 10)] == ["stopped", "off"]


def test_an_id_without_a_meaning_is_refused(bench, rmd):
    rmd("--id", "1-4", "speed", 100).ended(0)
    for words in (["off", "--all"], ["torque4", 0, 0, 0, 0], ["scan"]):
        assert "leave out --id" in rmd("--id", 2, *words).ended(2).err
    assert modes(bench) == ["speed"] * 4
