"""Help: its examples run, its pages keep their tables, shells complete."""

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
def test_every_example_of_every_help_runs(run, motorlink, tmp_path, command):
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
    # Commands of a fleet go to one node.
    for together in [lines] if command == "fleet" else [[line] for line in lines]:
        with Shell(tmp_path, PATH=path, MOTORLINK_RMD_TIMEOUT="2s") as shell:
            for line in together:
                words = next(commands(line))[1]
                config = "servo.toml" if "mcsdk-5.4" in line else ""
                has_drives = "./st0" in line or "./can0" in line or asks_a_share(words) or words[1] == "replay"
                if has_drives and words[1] != "sim":
                    shell.run(*next(commands(f"motorlink sim {config} --st pty:./st0 --rmd slcan-pty:./can0 &")))
                if asks_a_share(words):
                    shell.run(*next(commands("motorlink share -p ./st0 -p slcan:./can0 --at unix:./share &")))
                if asks_a_node(words) and not shell.background:
                    shell.run(*next(commands("motorlink node -p sim: --name arm1 &")))
                if words[1] in RECORDINGS:
                    short(tmp_path / "run.mcap")
                if words[1] == "replay":
                    shell.run(*next(commands("motorlink record -p ./st0 -o run.mcap --duration 300ms")))
                shell.run(*next(commands(line)))
        for made in ("run.csv", "run.svg", "run.mcap", "fixed.mcap", "motorlink.bash"):
            (tmp_path / made).unlink(missing_ok=True)


def test_help_has_the_exit_codes_and_options_of_a_command_before_those_of_every_command(run):
    assert "Exit codes: 0 done, 1 the drive refused" in run("--help").ended(0).out
    for command in ("st get", "rmd status"):
        text = run(*command.split(), "--help").ended(0).out
        own, every = text.split("Options of every command:\n")
        assert "--port" in every and "--json" in every and "--port" not in own.partition("Options:")[2]
        assert not {"--every", "--csv", "--verify"} & set(re.findall(r"--[a-z]+", every.partition("Examples:")[0]))


#: What shells complete.
COMPLETED = {
    "st rev": {"revup-data", "revup"},
    "st get SPEED_M": {"SPEED_MEAS"},
    "st segment I_A": {"I_A", "I_ALPHA"},
    "st --profile m": {"mcsdk-5.4"},
    "rmd pid speed": {"speed_kp=", "speed_ki="},
    "rmd --id 3": {"3", "30", "31", "32"},
    "rmd single-turn-position 90 co": {"counterclockwise"},
    "st registers --feature pf": {"pfc"},
}


def completed(shell, script, asks, **options):
    """What a shell offers after each of `asks`."""
    text = "".join(f"{ask}; echo ==\n" for ask in asks)
    done = subprocess.run(shell, input=f"{script}\n{text}", capture_output=True, text=True, timeout=60, **options)
    offers = done.stdout.split("==\n")[:-1]
    assert len(offers) == len(asks), done.stderr
    return offers


def test_bash_completes_registers_profiles_gains_and_ids(run):
    def ask(typed):
        words = ["motorlink", *typed.split()]
        of = f"COMP_WORDS=({' '.join(words)}) COMP_CWORD={len(words) - 1}"
        return f'{of}; _motorlink motorlink {words[-1]} {words[-2]}; echo "${{COMPREPLY[@]}}"'

    script = run("completions", "bash").ended(0).out
    offers = completed(["bash"], script, [ask(typed) for typed in COMPLETED])
    assert [set(offer.split()) for offer in offers] == list(COMPLETED.values())
    assert "torque4" in run("completions", "zsh").ended(0).out


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
def test_fish_completes_the_same_and_offers_no_files_where_a_command_takes_none(run, tmp_path):
    script = run("completions", "fish").ended(0).out
    environment = {**os.environ, "HOME": str(tmp_path)}
    asks = [f'complete -C "motorlink {typed}"' for typed in COMPLETED]
    offers = completed(["fish", "--no-config"], script, asks, env=environment, cwd=tmp_path)
    for (typed, words), offer in zip(COMPLETED.items(), offers):
        # fish also offers words that contain what was typed.
        offered = {line.split("\t")[0] for line in offer.splitlines()}
        assert {word for word in offered if word.startswith(typed.split()[-1])} == words, typed
    using = "__fish_motorlink_using_subcommand"
    assert f'-n "{using} rmd; and __fish_seen_subcommand_from status" -f\n' in script
    assert f'-n "{using} sim; and __fish_seen_subcommand_from run" -f' not in script


def test_manual_pages_keep_their_tables(run, tmp_path):
    run("man", tmp_path / "man").ended(0)
    pages = {page.name: page for page in (tmp_path / "man").iterdir()}
    assert {"motorlink.1", "motorlink-st-ramp.1", "motorlink-rmd-torque4.1"} <= pages.keys()
    command = ["groff", "-man", "-Tutf8", "-P-c", "-P-b", "-P-o", "-P-u", "-rLL=80n", "-K", "utf8", "-ww"]
    shown = subprocess.run([*command, *pages.values()], capture_output=True, text=True, check=True)
    assert shown.stderr == ""
    assert [line for line in shown.stdout.splitlines() if len(line) > 80] == []
    assert re.search(r"^ +sim: {10,}simulated drives inside this process$", shown.stdout, re.MULTILINE)
    assert re.search(r"^ +motorlink st -p \./st0 info$", shown.stdout, re.MULTILINE)
