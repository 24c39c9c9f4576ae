"""Drives that somebody wrote from the two documents alone, under the conformance kit: what the kit calls a sentence of
a document has to be one. How they read the holes is in `document/HOLES.md`."""

import sys
from pathlib import Path

import pytest

from program import Running

DOCUMENT = Path(__file__).parent / "document"
BACK_DOOR = f"{sys.executable} {DOCUMENT}/back_door.py"


@pytest.fixture
def written():
    """Starts a drive; gives its addresses on the line and at the back door."""
    started = []

    def written(program, *options):
        words = [DOCUMENT / program, "--listen", "127.0.0.1:0", "--control", "127.0.0.1:0", *options]
        started.append(Running([sys.executable, *map(str, words)]))
        return [started[-1].line(number).split()[-1] for number in (0, 1)]

    yield written
    for drive in started:
        drive.end()


def judged(run, *arguments):
    """What the kit found: no failed case, and how often a drive read a hole otherwise."""
    report = run("conformance", *arguments, "--json", within=300)
    assert report.code == 0, report.out + report.err
    return report.json


@pytest.mark.parametrize(
    "options, spin", [(["--motors", "3", "--pfc", "1"], ["--spin"]), (["--motors", "1", "--d-access", "none"], [])]
)
def test_a_slave_written_from_the_document_alone_passes_without_readings(run, written, options, spin):
    line, control = written("st_slave.py", *options)
    fault = f"{BACK_DOOR} {control} fault 1 2"
    port = ["-p", f"tcp:{line}", *spin, "--fault-on", f"{fault} on", "--fault-off", f"{fault} off"]
    report = judged(run, "st", *port)
    assert report["failed"] == 0 and report["passed"] > (350 if spin else 300)
    assert report["reading"] > 0, "it reads TARGET_MOTOR otherwise"
    assert run("conformance", "st", "-p", f"tcp:{line}", "--only", "ST-4.4-18", "--readings", "strict").code == 1


def test_a_motor_written_from_the_document_alone_passes_without_readings(run, written):
    motor = "3"
    line, control = written("rmd_motor.py", "--ids", motor)
    volts = f"{BACK_DOOR} {control} volts {motor}"
    port = ["-p", f"slcan:tcp:{line}", "--id", motor, "--spin", "--write-rom"]
    hooks = ["--power-cycle", f"{BACK_DOOR} {control} power {motor}"]
    faults = ["--fault-on", f"{volts} 9", "--fault-off", f"{volts} 24"]
    report = judged(run, "rmd", *port, *hooks, *faults)
    assert report["failed"] == 0 and report["passed"] > 100
