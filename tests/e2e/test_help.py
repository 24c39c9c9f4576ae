"""Help: its examples run, its suggestions turn no motor, its pages keep their tables, shells complete."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from recordings import short
from shell import Shell, asks_a_node, asks_a_share, lines as commands

ROOT = Path(__file__).parents[2]
#: What a bare `motorlink` needs: position control and the other features of a servo.
SERVO = 'profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n'


#: A pcapng file without packets.
EMPTY_CAPTURE = bytes.fromhex("0a0d0d0a 1c000000 4d3c2b1a 01000000 ffffffff ffffffff 1c000000")

#: What turns a motor, lets it turn, or wears it.
MOVING = {
    *("start", "start-stop", "ramp", "torque-ramp", "current-reference", "current", "position", "move", "set", "raw"),
    *("encoder-align", "torque", "torque4", "speed", "single-turn-position", "run", "zero", "encoder-offset"),
    *("--full-turn", "--spin", "--prove", "--write-rom", "--start", "--max-speed", "--power-cycle", "--fault-on"),
}


def helps(run, *path):
    """The help of a command and of all its subcommands, by path."""
    text = run(*path, "--help").ended(0).out
    yield path, text
    table = re.search(r"^Commands:\n((?:  .*\n)+)", text, re.MULTILINE)
    for name in re.findall(r"^  ([a-z0-9-]+)", table[1] if table else "", re.MULTILINE):
        if name != "help":
            yield from helps(run, *path, name)


def examples(text):
    """The command lines under `Examples:`."""
    block = re.search(r"^Examples:\n((?:  .*\n)+)", text, re.MULTILINE)
    return [line.strip() for line in block[1].replace("\\\n", "").splitlines()] if block else []


#: What reads a recording.
RECORDINGS = ("info", "recover", "convert", "plot")
#: The program itself, and commands without subcommands.
OF_THEIR_OWN = [(), *((name,) for name in ("ports", "completions", "man", "watch", "record", "replay", *RECORDINGS))]


@pytest.mark.parametrize("command", ["st", "rmd", "guard", "share", "sim", "decode", "conformance", "spec", "node", "fleet", ""])
def test_every_example_of_every_help_runs(run, sim, motorlink, tmp_path, command):
    pages = helps(run, command) if command else [
        page for page in helps(run) if page[0][:1] in OF_THEIR_OWN
    ]
    lines = {line: None for _, text in pages for line in examples(text)}
    assert len(lines) >= 2
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    (tmp_path / "servo.toml").write_text(SERVO)
    (tmp_path / "can0.log").write_text("(1436509053.249713) can0 141#9A1900F000000009\n")
    (tmp_path / "capture.pcapng").write_bytes(EMPTY_CAPTURE)
    path = f"{Path(motorlink).resolve().parent}:{os.environ['PATH']}"
    for line in lines:
        config = "servo.toml" if "mcsdk-5.4" in line else ""
        with Shell(tmp_path, PATH=path) as shell:
            if "motorlink sim" not in line:
                shell.run(*next(commands(f"motorlink sim {config} --st pty:./st0 --rmd slcan-pty:./can0 &")))
            command = next(commands(line))
            if asks_a_share(command[1]):
                shell.run(*next(commands("motorlink share -p ./st0 -p slcan:./can0 --at unix:./share &")))
            if asks_a_node(command[1]):
                shell.run(*next(commands("motorlink node -p sim: --name arm1 &")))
            if command[1][1] in RECORDINGS:
                short(tmp_path / "run.mcap")
            if command[1][1] == "replay":
                shell.run(*next(commands("motorlink record -p ./st0 -o run.mcap --duration 300ms")))
            shell.run(*command)
        for made in ("run.csv", "run.svg", "run.mcap", "fixed.mcap", "motorlink.bash"):
            (tmp_path / made).unlink(missing_ok=True)


@pytest.mark.parametrize("command", ["st get", "st set", "rmd off", "rmd speed", "rmd status"])
def test_options_of_a_command_come_before_those_of_every_command(run, command):
    text = run(*command.split(), "--help").ended(0).out
    own, every = text.split("Options of every command:\n")
    assert "--port" in every and "--json" in every and "--port" not in own.partition("Options:")[2]
    assert not {"--every", "--csv", "--verify"} & set(re.findall(r"--[a-z]+", every.partition("Examples:")[0]))


@pytest.mark.parametrize(
    "words",
    [
        "rmd set-id 2", "rmd speedd 3", "rmd torqe 3", "rmd runn", "rmd positon 3", "rmd rawr 9a", "rmd mov 3",
        "st startt", "st rampp 3 3", "st sett", "st encoder-aling", "st torqe-ramp 3 3", "st curent 3 3", "st positio 3 3",
        "rmd off --max-speed 3", "rmd single-turn-position 3 cw --full-turns", "rmd --write-ro zero",
        "conformance st --spinn", "guard st --prov", "conformance host --star x",
    ],
)
@pytest.mark.parametrize("json", [(), ("--json",)])
def test_no_suggestion_turns_a_motor(run, words, json):
    message = run(*words.split(), *json).ended(2).err
    # Words that were typed are repeated.
    suggested = set(re.findall(r"[a-z0-9-]+", message)) - set(words.split())
    assert not suggested & MOVING, message


@pytest.mark.parametrize(
    "words, suggested",
    [
        ("st statu", "status"), ("st gett SPEED_MEAS", "get"), ("rmd scn", "scan"), ("rmd stopp", "stop"), ("rmd of", "off"),
        ("st -p sim: get STATUS --evry 5ms", "--every"), ("portss", "ports"), ("st --jsn info", "--json"),
    ],
)
def test_suggestions_that_turn_no_motor_are_kept(run, words, suggested):
    assert f"'{suggested}'" in run(*words.split()).ended(2).err


COMPLETED = pytest.mark.parametrize(
    "typed, completed",
    [
        ("st get SPEED_M", {"SPEED_MEAS"}),
        ("st segment I_A", {"I_A", "I_ALPHA"}),
        ("st set BUS_", {"BUS_VOLTAGE"}),
        ("st --profile m", {"mcsdk-5.4"}),
        ("rmd pid speed", {"speed_kp=", "speed_ki="}),
        ("rmd --id 3", {"3", "30", "31", "32"}),
        ("rmd single-turn-position 90 co", {"counterclockwise"}),
        ("st registers --feature pf", {"pfc"}),
        ("sim --profile m", {"mcsdk-5.4"}),
    ],
)


@COMPLETED
def test_bash_completes_registers_profiles_gains_and_ids(run, typed, completed):
    script = run("completions", "bash").ended(0).out
    words = ["motorlink", *typed.split()]
    ask = f"COMP_WORDS=({' '.join(words)}) COMP_CWORD={len(words) - 1}; _motorlink motorlink {words[-1]} {words[-2]}"
    done = subprocess.run(
        ["bash"], input=f'{script}\n{ask}; echo "${{COMPREPLY[@]}}"\n', capture_output=True, text=True, timeout=10
    )
    assert set(done.stdout.split()) == completed, done.stderr


@COMPLETED
@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
def test_fish_completes_the_same(run, tmp_path, typed, completed):
    script = run("completions", "fish").ended(0).out
    ask = f'complete -C "motorlink {typed}"'
    done = subprocess.run(
        ["fish", "--no-config"], input=f"{script}\n{ask}\n", capture_output=True, text=True, timeout=60,
        env={**os.environ, "HOME": str(tmp_path)}, cwd=tmp_path,
    )
    offered = {line.split("\t")[0] for line in done.stdout.splitlines()}
    # fish also offers words that contain what was typed.
    last = typed.split()[-1]
    assert {word for word in offered if word.startswith(last)} == completed, done.stderr


def test_fish_offers_no_files_where_a_command_takes_none(run):
    script = run("completions", "fish").ended(0).out
    using = "__fish_motorlink_using_subcommand"
    assert f'-n "{using} rmd; and __fish_seen_subcommand_from status" -f\n' in script
    assert f'-n "{using} sim; and __fish_seen_subcommand_from run" -f' not in script


def test_manual_pages_keep_their_tables(run, tmp_path):
    run("man", tmp_path).ended(0)
    for page in tmp_path.iterdir():
        shown = subprocess.run(
            ["groff", "-man", "-Tutf8", "-P-c", "-P-b", "-P-o", "-P-u", "-rLL=80n", "-K", "utf8", "-ww", page],
            capture_output=True, text=True, check=True,
        )
        assert shown.stderr == "", page
        assert all(len(line) <= 80 for line in shown.stdout.splitlines()), page
        if page.name == "motorlink-st.1":
            assert re.search(r"^ +sim: {10,}simulated drives inside this process$", shown.stdout, re.MULTILINE)
            assert re.search(r"^ +motorlink st -p \./st0 info$", shown.stdout, re.MULTILINE)
