"""Drives of one protocol, guards, and programs that turn motors."""

import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from guarded import PORT, PTY, where
from lines import SlowLine
from program import children
from unread import UNREAD, Mute

HOSTS = Path(__file__).parents[1] / "hosts"


@pytest.fixture
def bench(sim):
    """Drives of one protocol."""

    def bench(protocol):
        return sim(rmd=()) if protocol == "st" else sim(st=())

    return bench


@pytest.fixture
def guard(start, tmp_path):
    """A guard: `guard("rmd", drives)` gives it with `.port`, where programs find the drive."""

    def guard(protocol, drives, *arguments, serve=None, **options):
        serve = serve or f"{PTY[protocol]}:{tmp_path}/held"
        words = ["guard", protocol, "-p", PORT[protocol](drives), "--serve", serve, *arguments]
        process = start(*words, **options)
        announced = json.loads(process.line(0))
        process.port = where(announced)
        return process

    return guard


@pytest.fixture
def client():
    """A program of its own that turns a motor: `client("st", port, "hold")`."""
    with children() as start:
        yield lambda protocol, port, mode="hold": start(
            [sys.executable, HOSTS / "turning.py", protocol, port, mode],
            "turns",
            stderr=subprocess.DEVNULL,
        )


@pytest.fixture
def mute(motorlink, tmp_path):
    """`mute("st", drives, "full")`: a guard whose output is not read."""
    started = []

    def mute(protocol, drives, output, serve=None):
        serve = serve or f"{PTY[protocol]}:{tmp_path}/held"
        process = Mute(motorlink, protocol, drives, serve, UNREAD[output])
        started.append(process)
        return process

    yield mute
    for process in started:
        process.end()


@pytest.fixture
def slow(bench, tmp_path):
    """`slow("st")`: drives behind a slow line."""
    with ExitStack() as lines:
        yield lambda protocol: lines.enter_context(
            SlowLine(tmp_path / "slow", protocol, bench(protocol))
        )
