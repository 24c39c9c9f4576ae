"""Programs in turn on lines whose replies are late, doubled, lost or echoed: nothing wrong with exit code 0.

PAIRS=200 pytest tests/e2e/test_two_programs.py -s    shows what became of 200 pairs each.
"""

import collections
import json
import os
import random
import subprocess
import time

import pytest

from badline import BadLine, Fate, slcan_messages, st_messages
from program import environment, eventually, plain

#: Pairs of each protocol.
PAIRS = int(os.environ.get("PAIRS", "8"))
GAINS = {"SPEED_KP": 1111, "SPEED_KI": 2222, "TORQUE_KP": 3333, "TORQUE_KI": 4444}
STOP = bytes([0x23, 0x01, 0x02, 0x26])
ACK = bytes([0xF0, 0x00, 0xF0])
OFF = b"t141880" + 14 * b"0" + b"\r"

#: Late by less than twice the timeout of the second program; doubled; lost; all of it.
FATES = {
    "late": lambda chance: Fate(late=chance.choice([0.005, 0.06, 0.15, 0.3, 0.6])),
    "twice": lambda chance: Fate(late=chance.choice([0.0, 0.01]), twice=chance.choice([0.1, 1.0])),
    "lost": lambda chance: Fate(late=chance.choice([0.0, 0.15]), lost=0.2),
    "all": lambda chance: Fate(late=chance.choice([0.01, 0.15, 0.4]), twice=0.2, lost=0.1),
}


class Pairs:
    """Programs of one protocol on a bad line."""

    def __init__(self, motorlink, protocol, address, messages, seed):
        self.chance = random.Random(seed)
        self.line = BadLine(address, messages, self.chance)
        port = self.line.port if protocol == "st" else f"slcan:{self.line.port}"
        self.command = [motorlink, protocol, "-p", port, "--json"]
        self.counts = collections.Counter()

    def run(self, *arguments, life=None):
        """Runs the program, and kills it after `life` seconds; exit code, output, and how many requests and
        replies there were before."""
        before = len(self.line.requests), len(self.line.replies)
        process = subprocess.Popen(
            [*self.command, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
        )
        try:
            out, err = process.communicate(timeout=life or 30)
        except subprocess.TimeoutExpired:
            assert life is not None, "it does not end"
            process.kill()
            out, err = process.communicate()
        assert "panicked" not in err, err
        return process.returncode, out, before

    def first(self, *commands):
        """A program of any kind, which may be killed."""
        arguments = self.chance.choice(commands)
        timeout = self.chance.choice(["40ms", "100ms", "1s"])
        life = self.chance.uniform(0.01, 0.6) if self.chance.random() < 0.5 or "--every" in arguments else None
        self.run("--timeout", timeout, *arguments, life=life)
        time.sleep(self.chance.choice([0, 0, 0.05]))

    def judge(self, fate, code, is_right):
        """Counts what became of the second program."""
        self.counts[fate, "right" if code == 0 and is_right else "WRONG" if code == 0 else "error"] += 1


@pytest.fixture
def pairs(motorlink, sim):
    """Programs in turn; prints what became of them."""
    made = []

    def pairs(protocol):
        drives = sim(st=("tcp",), rmd=("tcp",))
        seed = int(os.environ.get("PAIRS_SEED", time.time_ns()))
        print(f"PAIRS_SEED={seed}")
        host, port = (drives.st_address if protocol == "st" else drives.can_address).split(":")
        messages = st_messages if protocol == "st" else slcan_messages
        made.append(Pairs(motorlink, protocol, (host, int(port)), messages, seed))
        return made[-1]

    yield pairs
    for each in made:
        each.line.close()
        print(dict(each.counts))


def fates(pairs):
    """The fates of PAIRS pairs, in turn."""
    for number in range(PAIRS):
        name = list(FATES)[number % len(FATES)]
        pairs.line.fate = FATES[name](pairs.chance)
        yield name
        pairs.line.fate = Fate()


def test_st_programs_in_turn_read_their_own_values(pairs):
    st = pairs("st")
    for name, value in GAINS.items():
        assert st.run("set", name, value)[0] == 0
    for fate in fates(st):
        st.first(["get", *GAINS], ["status"], ["info"], ["start"], ["get", "SPEED_KI", "--every", "20ms", "--count", 20])
        if st.chance.random() < 0.3:
            code, _, (_, replies) = st.run("stop")
            st.judge(fate, code, ACK in st.line.replies[replies:] and STOP in st.line.requests)
            continue
        names = st.chance.sample(list(GAINS), 4)
        code, out, _ = st.run("get", *names)
        expected = {name: GAINS[name] for name in names}
        st.judge(fate, code, code or plain(json.loads(out)) == expected)
    assert not any(end == "WRONG" for _, end in st.counts), st.counts
    assert any(end == "right" for _, end in st.counts), "something comes through"


def test_rmd_programs_in_turn_read_their_own_values(pairs):
    rmd = pairs("rmd")
    for fate in fates(rmd):
        value = rmd.chance.randrange(1, 200)
        rmd.first(["pid"], ["status"], ["--id", 1, "off"], ["speed", 100], ["status", "--every", "20ms", "--count", 20])
        rmd.line.fate, bad = Fate(), rmd.line.fate
        eventually(lambda: rmd.run("pid", *6 * [value])[0] == 0, "new gains")
        rmd.line.fate = bad
        rmd.first(["pid"], ["status"], ["--id", 1, "off"], ["speed", 100])
        if rmd.chance.random() < 0.3:
            code, _, (requests, _) = rmd.run("--timeout", "1s", "--id", 1, "off")
            rmd.judge(fate, code, OFF in rmd.line.requests[requests:])
            continue
        code, out, _ = rmd.run("--timeout", "1s", "pid")
        rmd.judge(fate, code, code or set(plain(json.loads(out)).values()) == {value})
    assert not any(end == "WRONG" for _, end in rmd.counts), rmd.counts
    assert any(end == "right" for _, end in rmd.counts), "something comes through"


@pytest.mark.parametrize("arguments", [["off"], ["zero", "--write-rom"], ["scan"]])
def test_an_adapter_that_echoes_is_named_with_or_without_a_motor(run, pairs, arguments):
    rmd = pairs("rmd")
    rmd.line.fate = Fate(echo=True)
    for motor in (1, 9) if arguments == ["off"] else (1,):
        words = arguments if arguments == ["scan"] else ["--id", motor, *arguments]
        echoed = run("rmd", "-p", f"slcan:{rmd.line.port}", *words).ended(3)
        assert "echo=1" in echoed.err
        assert echoed.out == ""
        # A busy machine may be late with a reply.
        patient = ["--timeout", "1s"] if motor == 1 else []
        run("rmd", "-p", f"slcan:{rmd.line.port}?echo=1", *patient, *words).ended(0 if motor == 1 else 3)


@pytest.mark.parametrize("command", ["stop", "start"])
def test_a_serial_line_that_echoes_is_named(run, pairs, command):
    st = pairs("st")
    st.line.fate = Fate(echo=True)
    echoed = run("st", "-p", st.line.port, command).ended(3)
    assert "the line echoes" in echoed.err and "baud" not in echoed.err
