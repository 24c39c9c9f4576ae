"""The program under test, and simulated drives that it serves. `make e2e` does all of it:

$ cargo build --workspace --all-features --bin motorlink --example machine --example rmd_frames \
    --example wireshark_frames
$ pip install -r tests/requirements.txt
$ MOTORLINK_BIN=target/debug/motorlink pytest tests/e2e
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from program import PATIENT, Outcome, Running, environment, serving
from sharing import Client
from terminal import Terminal
from wireshark import dissector, packets, sets, tshark  # noqa: F401

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def motorlink():
    """Path of the program."""
    path = Path(os.environ.get("MOTORLINK_BIN", REPOSITORY / "target/debug/motorlink"))
    if not os.access(path, os.X_OK):
        pytest.exit(f"{path} is not built: `cargo build -p motorlink-cli`, or set MOTORLINK_BIN", 2)
    return str(path.resolve())


@pytest.fixture(scope="session")
def run(motorlink):
    """Runs the program to its end: `run("st", "-p", port, "info")`."""

    # One that hangs ends.
    def run(*arguments, within=120, stdin="", **variables):
        done = subprocess.run(
            [motorlink, *map(str, arguments)],
            input=stdin,
            capture_output=True,
            text=True,
            timeout=within,
            env=environment(variables),
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture(scope="session")
def piped(motorlink):
    """Runs the program with its stdout redirected by a shell: `piped("st registers", "| head -n 2")`."""

    def piped(words, out, within=120):
        done = subprocess.run(
            ["bash", "-c", f"{motorlink} {words} {out}; exit ${{PIPESTATUS[0]}}"],
            capture_output=True,
            text=True,
            timeout=within,
            env=environment(),
        )
        return Outcome(done.returncode, done.stdout, done.stderr)

    return piped


@pytest.fixture
def start(motorlink):
    """Starts the program and lets it run: `start("demo")`. It is ended after the test."""
    started = []

    def start(*arguments, **options):
        process = Running([motorlink, *map(str, arguments)], **options)
        started.append(process)
        return process

    yield start
    for process in started:
        process.end()


@pytest.fixture
def watch(motorlink):
    """`watch(ports, ...)`: `motorlink watch` on these ports, in a terminal."""
    started = []

    def watch(*words, columns=80, lines=24, **variables):
        words = ["watch", *PATIENT, *map(str, words)]
        terminal = Terminal([motorlink, *words], columns, lines, **variables)
        started.append(terminal)
        return terminal

    yield watch
    for terminal in started:
        terminal.end()


@pytest.fixture
def sim(motorlink, tmp_path):
    """`sim(...)`: simulated drives with arguments of the test's choice."""
    yield from serving(motorlink, tmp_path)


@pytest.fixture(scope="module")
def drives(motorlink, tmp_path_factory):
    """Drives on a port of every kind, shared by tests that do not mind what was done before."""
    folder = tmp_path_factory.mktemp("drives")
    for sim in serving(motorlink, folder):
        yield sim(st=("pty", "tcp"), rmd=("slcan-pty", "tcp"))
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def shares(start, sim, tmp_path):
    """`shares()`: a share of simulated drives, again and again at the same `path`. The drives stay when it ends.

    `st` and `rmd` are its lines as ports.
    """
    drives, path = sim(), tmp_path / "share"

    def shares(timeout="2s"):
        words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{path}", "--timeout", timeout]
        running = start("share", *words, "--json")
        running.line(0)
        running.path, running.drives = path, drives
        running.st, running.rmd = f"share:{path}/st0", f"share:{path}/rmd0"
        return running

    return shares


@pytest.fixture
def nodes(start, sim, tmp_path):
    """`nodes("arm1", ...)`: a node of simulated drives, again and again; further ones connect to the first."""
    started, simulated = [], {}

    def nodes(name, *more):
        if name not in simulated:
            simulated[name] = sim(st=[f"pty:{tmp_path}/{name}.st"], rmd=[f"slcan-pty:{tmp_path}/{name}.can"])
        drives = simulated[name]
        path = tmp_path / f"{name}.share"
        words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{path}", *more]
        there = [it.address for it in started if it.process.poll() is None]
        at = ["--connect", there[0]] if there else ["--listen", "tcp/127.0.0.1:0"]
        running = start("node", *words, *at, "--name", name, "--timeout", "5s", "--json")
        running.ready = ready = json.loads(running.line(0))
        assert ready["ports"] == [f"zenoh:{name}/st0", f"zenoh:{name}/rmd0"]
        running.path, running.address = path, ready["addresses"][0]
        running.drives = drives
        # If the first answer of a drive is late, its line rests for twice the timeout (SPEC-NOTES S16).
        Client(path, "waits").status()
        started.append(running)
        return running

    return nodes
