"""The command `motorlink` that pip installs is the same program."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import motorlink
from conftest import Served


def run(*words: str) -> subprocess.CompletedProcess[str]:
    """Runs a command line to its end."""
    return subprocess.run(words, capture_output=True, text=True, timeout=30)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, ["st", "-p", "sim:", "get", "SPEED_MEAS"]),
        (1, ["st", "-p", "sim:", "get", "I_A"]),
        (2, ["fly"]),
        (3, ["st", "-p", "/dev/nothing-there", "info"]),
    ],
)
def test_it_has_the_exit_codes_of_the_program(command: str, code: int, words: list[str]) -> None:
    done = run(command, *words)
    assert done.returncode == code, done.stderr
    assert ("error" in done.stderr) == (code > 0), done.stderr
    assert "Traceback" not in done.stderr and "panicked" not in done.stderr
    assert bool(done.stdout) == (code == 0)


def test_it_is_also_a_module(command: str) -> None:
    done = run(sys.executable, "-m", "motorlink", "--version")
    assert done.stdout == run(command, "--version").stdout == f"motorlink {motorlink.__version__}\n"


def test_ctrl_c_ends_a_wait_at_once(command: str, tmp_path: Path) -> None:
    words = [command, "sim", "--st", f"pty:{tmp_path}/st0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as sim:
        assert sim.stdout and sim.stdout.readline()
        sim.send_signal(signal.SIGINT)
        sim.communicate(timeout=10)
        assert sim.returncode == 0
    assert not (tmp_path / "st0").is_symlink(), "nothing is left behind"


def test_a_closed_pipe_is_not_an_error(command: str, served: Served) -> None:
    # A rate that the line carries on any machine: a lower one is told.
    words = [command, "st", "-p", served.st, "get", "STATUS", "--every", "200ms"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as loop:
        assert loop.stdout and loop.stderr and loop.stdout.readline()
        loop.stdout.close()
        assert loop.wait(10) == 0
        assert loop.stderr.read() == ""


def test_a_guard_proves_itself_by_a_process_of_this_interpreter(
    command: str, served: Served
) -> None:
    done = run(command, "guard", "rmd", "-p", served.can, "--prove", "--spin", "100", "--json")
    assert done.returncode == 0, done.stderr
    values = json.loads(done.stdout.splitlines()[-1])["values"]
    assert values["speed"]["value"] == pytest.approx(100, abs=20)
