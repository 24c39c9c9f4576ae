"""`motorlink guard` at its edges: signals, output that nobody reads, floods, web pages, other users, both protocols.

GUARD_RUNS=200 pytest tests/e2e/test_guard_edges.py -k combinations -s    shows the distribution of 200 runs each.
"""

import fcntl
import json
import os
import random
import select
import signal
import socket
import stat
import statistics
import subprocess
import sys
import termios
import threading
import time
import tty
from contextlib import ExitStack
from pathlib import Path

import pytest

from program import Sim, environment, eventually
from st_wire import ACK, EXECUTE, frame, header

HOSTS = Path(__file__).parent / "hosts"
#: Random combinations of each protocol.
RUNS = int(os.environ.get("GUARD_RUNS", "6"))
#: What ends a guard in order, and what suspends a program that does not handle it.
ENDING = [
    *[signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT],
    *[signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM, signal.SIGVTALRM, signal.SIGPROF],
    *[signal.SIGPWR, signal.SIGRTMIN, signal.SIGRTMAX],
]
SUSPENDING = [signal.SIGTSTP, signal.SIGTTOU, signal.SIGTTIN]

# What the guard is called with, and what the drive's own port is, for each protocol.
PORT = {"st": lambda drives: drives.st, "rmd": lambda drives: f"slcan:{drives.can}"}
PTY = {"st": "pty", "rmd": "slcan-pty"}
START = {"st": frame(header(EXECUTE, 1), [1]), "rmd": b"O\rt1418A2000000A08C0000\r"}


def is_turning(drives, protocol):
    motor = drives.motor(1)
    return motor["mode"] not in ("off", "stopped") if protocol == "rmd" else motor["status"] == "RUN"


def turns(drives, protocol):
    eventually(lambda: is_turning(drives, protocol), "the motor turns")


def is_told_to_stop(drives, protocol):
    """An ST motor passes other states before it is IDLE again."""
    motor = drives.motor(1)
    if protocol == "rmd":
        return motor["mode"] in ("off", "stopped")
    return motor["status"] in ("ANY_STOP", "STOP", "STOP_IDLE", "WAIT_STOP_MOTOR", "IDLE")


def rests(drives, protocol):
    def is_at_rest():
        motor = drives.motor(1)
        return motor["mode"] in ("off", "stopped") if protocol == "rmd" else motor["status"] == "IDLE"

    eventually(is_at_rest, "the motor rests", within=20)


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


def where(announced):
    """What turning.py takes for an announced port."""
    kind, _, path = announced["port"].partition(":")
    return {"tcp-listen": path, "unix-listen": f"unix:{path}"}.get(kind, path)


@pytest.fixture
def client():
    """A program of its own that turns a motor: `client("st", port, "hold")`."""
    started = []

    def client(protocol, port, mode="hold"):
        process = subprocess.Popen(
            [sys.executable, HOSTS / "turning.py", protocol, port, mode],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        started.append(process)
        assert process.stdout.readline() == "turns\n"
        return process

    yield client
    for process in started:
        process.kill()
        process.communicate()


# A1: signals.


@pytest.mark.parametrize("second", [signal.SIGTERM, signal.SIGINT, signal.SIGQUIT])
@pytest.mark.parametrize("protocol", PORT)
def test_a_second_signal_does_not_keep_the_motors_from_being_stopped(
    bench, guard, client, protocol, second
):
    for gap in (0, 0.0005, 0.002):
        drives = bench(protocol)
        process = guard(protocol, drives)
        client(protocol, process.port)
        turns(drives, protocol)
        process.interrupt()
        time.sleep(gap)
        for _ in range(3):
            process.process.send_signal(second)
        assert process.wait() == 0
        assert any("the guard ends: motor 1 is stopped" in text for text in process.err), process.err
        rests(drives, protocol)
        drives.end()


@pytest.mark.parametrize("number", ENDING, ids=lambda number: number.name)
def test_every_signal_that_would_end_a_guard_stops_the_motors(bench, guard, client, number):
    drives = bench("st")
    process = guard("st", drives)
    client("st", process.port)
    turns(drives, "st")
    process.process.send_signal(number)
    assert process.wait() == 0
    rests(drives, "st")


@pytest.mark.parametrize("number", SUSPENDING, ids=lambda number: number.name)
def test_a_guard_is_not_suspended(bench, guard, client, number):
    drives = bench("st")
    process = guard("st", drives)
    program = client("st", process.port)
    turns(drives, "st")
    process.process.send_signal(number)
    process.says("not suspended")
    program.kill()
    rests(drives, "st")
    process.says("motor 1 is stopped")


def test_what_a_guard_was_told_to_ignore_does_not_end_it(bench, guard, client, motorlink, tmp_path):
    drives = bench("st")
    words = [motorlink, "guard", "-p", drives.st, "--serve", f"pty:{tmp_path}/held"]
    process = subprocess.Popen(
        ["nohup", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=environment(),
    )
    try:
        process.stdout.readline()
        program = client("st", f"{tmp_path}/held")
        turns(drives, "st")
        for _ in range(3):
            process.send_signal(signal.SIGHUP)
        assert drives.motor(1)["status"] == "RUN"
        program.kill()
        rests(drives, "st")
        assert process.poll() is None
        process.terminate()
        assert process.wait(15) == 0
    finally:
        process.kill()
        process.communicate()


# A2: output that nobody reads.


def full_pipe():
    """A pipe that takes nothing any more: its ends."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    try:
        while True:
            os.write(writer, b"x" * 512)
    except BlockingIOError:
        pass
    os.set_blocking(writer, True)
    return reader, writer


def stopped_terminal():
    """A terminal on which Ctrl-S was pressed: its ends."""
    keys, screen = os.openpty()
    os.write(keys, b"\x13")
    return keys, screen


def closed_pipe():
    """A pipe whose reader is gone."""
    reader, writer = os.pipe()
    os.close(reader)
    return os.open(os.devnull, os.O_RDONLY), writer


UNREAD = {"full": full_pipe, "terminal": stopped_terminal, "closed": closed_pipe}


class Mute:
    """A guard whose output goes where a test wants it."""

    def __init__(self, motorlink, protocol, drives, serve, output, *arguments):
        words = ["guard", protocol, "-p", PORT[protocol](drives), "--serve", serve, *arguments]
        self.ends = output()
        try:
            self.process = subprocess.Popen(
                [motorlink, *words, "--json"],
                stdin=subprocess.DEVNULL, stdout=self.ends[1], stderr=self.ends[1], env=environment(),
            )
        finally:
            os.close(self.ends[1])
        path = serve.partition(":")[2]
        eventually(lambda: os.path.lexists(path), "the served port")
        self.port = f"unix:{path}" if serve.startswith("unix") else path

    def end(self):
        self.process.kill()
        self.process.wait()
        os.close(self.ends[0])


@pytest.fixture
def mute(motorlink, tmp_path):
    """`mute("st", drives, "full")`: a guard whose output nobody reads."""
    started = []

    def mute(protocol, drives, output, serve=None):
        serve = serve or f"{PTY[protocol]}:{tmp_path}/held"
        process = Mute(motorlink, protocol, drives, serve, UNREAD[output])
        started.append(process)
        return process

    yield mute
    for process in started:
        process.end()


@pytest.mark.parametrize("output", UNREAD)
@pytest.mark.parametrize("protocol", PORT)
def test_a_guard_whose_output_nobody_reads_guards_on_and_ends(bench, mute, client, protocol, output):
    drives = bench(protocol)
    process = mute(protocol, drives, output)
    for _ in range(3):
        program = client(protocol, process.port, "poll")
        turns(drives, protocol)
        program.kill()
        rests(drives, protocol)
    client(protocol, process.port)
    turns(drives, protocol)
    process.process.terminate()
    assert process.process.wait(15) == 0
    rests(drives, protocol)


def test_a_thousand_refused_programs_freeze_no_guard(bench, start, client, tmp_path):
    """Each is a line on stderr, and nobody reads them."""
    drives = bench("st")
    words = ["guard", "-p", drives.st, "--serve", "tcp-listen:127.0.0.1:0"]
    process = start(*words)
    announced = json.loads(process.line(0))
    host, _, number = announced["path"].rpartition(":")
    program = client("st", announced["path"])
    turns(drives, "st")
    # The reader of this test stands still, as a shell does that nobody looks at.
    with process._news:
        for _ in range(1500):
            socket.create_connection((host, int(number)), timeout=5).close()
        program.kill()
        rests(drives, "st")
    process.says("lines were dropped here")
    process.interrupt()
    assert process.wait() == 0


@pytest.mark.parametrize("output", ["full", "terminal"])
def test_simulated_drives_go_on_while_nobody_reads_what_they_answer(motorlink, run, tmp_path, output):
    ends = UNREAD[output]()
    process = subprocess.Popen(
        [motorlink, "sim", "--st", f"pty:{tmp_path}/st0"],
        stdin=subprocess.PIPE, stdout=ends[1], stderr=ends[1], env=environment(),
    )
    os.close(ends[1])
    try:
        eventually(lambda: os.path.lexists(tmp_path / "st0"), "the served port")
        process.stdin.write(b'{"command":"state"}\n' * 500)
        process.stdin.flush()
        for _ in range(3):
            run("st", "-p", tmp_path / "st0", "info").ended(0)
    finally:
        process.terminate()
        code = process.wait(15)
        process.stdin.close()
        os.close(ends[0])
    assert code == 0


# A3: a client that wrote faster than the line, and is gone.


@pytest.mark.parametrize("serve", ["pty", "unix-listen", "tcp-listen"])
@pytest.mark.parametrize("protocol", PORT)
def test_what_a_dead_program_left_does_not_delay_the_stop(slow, guard, client, tmp_path, protocol, serve):
    line = slow(protocol)
    name = {
        "pty": f"{PTY[protocol]}:{tmp_path}/held",
        "unix-listen": f"unix-listen:{tmp_path}/held.sock",
        "tcp-listen": "tcp-listen:127.0.0.1:0",
    }[serve]
    process = guard(protocol, line, serve=name)
    program = client(protocol, process.port, "flood")
    line.flooded()
    program.kill()
    began = time.monotonic()
    line.stopped()
    passed = line.bytes_since(began)
    # In bytes of the line, so that a slow machine changes nothing: what it was ahead by.
    assert passed < 0.5 * line.BYTES_PER_SECOND, f"{passed} bytes went before the stop"
    process.says("were not passed on")


class RawLine:
    """A pty, byte by byte."""

    def __init__(self, path):
        self.end = os.open(path, os.O_RDWR | os.O_NOCTTY)

    def say(self, words, answer):
        """Writes, and reads until the answer came."""
        os.write(self.end, words)
        came = b""
        while answer not in came:
            assert select.select([self.end], [], [], 10)[0], came
            came += os.read(self.end, 4096)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.end)


class Between:
    """A pty before a drive's line. A thread for each direction runs `carry` until the end."""

    def __init__(self, path, drive):
        self.path = path
        self.master, self.keep = os.openpty()
        tty.setraw(self.keep)
        os.symlink(os.ttyname(self.keep), path)
        self.drive = os.open(drive, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.drive)
        self.running = True
        self.threads = [
            threading.Thread(target=self.carry, args=(self.master, self.drive, True), daemon=True),
            threading.Thread(target=self.carry, args=(self.drive, self.master, False), daemon=True),
        ]
        for thread in self.threads:
            thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.running = False
        for thread in self.threads:
            thread.join()
        for end in (self.master, self.keep, self.drive):
            os.close(end)


class SlowLine(Between):
    """Drives behind a pty that carries 115200 baud and notes what passes."""

    BYTES_PER_SECOND = 11_520

    def __init__(self, path, protocol, drives):
        self.protocol, self.drives = protocol, drives
        self.st, self.can = str(path), str(path)
        self.seen, self.lock = [], threading.Lock()
        super().__init__(path, drives.st if protocol == "st" else drives.can)

    def carry(self, source, target, is_sent):
        while self.running:
            if not select.select([source], [], [], 0.05)[0]:
                continue
            try:
                data = os.read(source, 64)
            except OSError:
                time.sleep(0.01)
                continue
            if is_sent:
                time.sleep(len(data) / self.BYTES_PER_SECOND)
                with self.lock:
                    self.seen.append((time.monotonic(), data))
            os.write(target, data)

    def sent(self):
        with self.lock:
            return list(self.seen)

    def flooded(self):
        eventually(lambda: sum(len(data) for _, data in self.sent()) > 6_000, "a flood", within=30)

    def stopped(self):
        stop = bytes([0x23, 0x01, 0x02, 0x26]) if self.protocol == "st" else b"t141880"
        eventually(lambda: stop in b"".join(data for _, data in self.sent()), "the stop", within=30)

    def bytes_since(self, began):
        return sum(len(data) for at, data in self.sent() if at > began)


@pytest.fixture
def slow(bench, tmp_path):
    """`slow("st")`: drives behind a slow line."""
    with ExitStack() as lines:
        yield lambda protocol: lines.enter_context(
            SlowLine(tmp_path / "slow", protocol, bench(protocol))
        )


# A5: web pages, and who may open a Unix socket.


def tcp_guard(guard, protocol, drives):
    process = guard(protocol, drives, serve="tcp-listen:127.0.0.1:0")
    host, _, number = process.port.rpartition(":")
    return process, (host, int(number))


@pytest.mark.parametrize("profile", ["spec", "mcsdk-5.4"])
@pytest.mark.parametrize("protocol", PORT)
def test_no_web_page_starts_a_motor_wherever_its_request_is_cut(sim, guard, protocol, profile):
    drives = sim("--profile", profile, st=("pty",) if protocol == "st" else (),
                 rmd=() if protocol == "st" else ("slcan-pty",))
    process, address = tcp_guard(guard, protocol, drives)
    body = START[protocol] * 3
    request = b"POST / HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % len(body) + body
    # The whole of what is held back, and the beginning of what follows.
    for cut in range(12):
        with socket.create_connection(address, timeout=5) as page:
            page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if request[:cut]:
                page.sendall(request[:cut])
                eventually(lambda: unsent(page) == 0, "the first part has arrived")
            try:
                page.sendall(request[cut:])
                assert page.recv(64) == b""
            except ConnectionError:
                pass
        process.until(
            lambda: sum("nothing of it was passed on" in text for text in process.err) == cut + 1,
            f"browser {cut + 1} is told of",
        )
    assert not is_turning(drives, protocol)
    # A program is let in as before.
    with socket.create_connection(address, timeout=5) as program:
        program.sendall(START[protocol])
        turns(drives, protocol)
    rests(drives, protocol)


@pytest.mark.parametrize("protocol", PORT)
def test_the_body_behind_a_web_pages_request_does_not_reach_a_served_drive(sim, run, protocol):
    """A browser sends a longer body after the request, while the server still lets go of it."""
    drives = sim(st=("tcp",), rmd=("tcp",))
    host, port = (drives.st_address if protocol == "st" else drives.can_address).split(":")
    for number in range(60):
        with socket.create_connection((host, int(port)), timeout=5) as page:
            page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                page.sendall(b"POST / HTTP/1.1\r\nContent-Length: 40000\r\n\r\n")
                for _ in range(number % 4):
                    page.sendall(START[protocol] * 10)
                page.sendall(START[protocol] * 1000)
                page.recv(64)
            except ConnectionError:
                pass
    if protocol == "st":
        state = run("st", "-p", drives.port("tcp"), "--json", "get", "STATUS").ended(0).json
        assert state["STATUS"]["name"] == "IDLE"
    else:
        motion = run("rmd", "-p", drives.port("slcan:tcp"), "--json", "status").ended(0).json
        assert (motion["speed"], motion["angle"]) == (0, 0)


def unsent(page):
    """Bytes that the other end's kernel has not acknowledged."""
    siocoutq = 0x5411
    return int.from_bytes(fcntl.ioctl(page, siocoutq, bytes(4)), sys.byteorder)


@pytest.mark.parametrize("words", [
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"\x00\x01\x00\x50\x21\x12\xa4\x42" + b"\x23\x01\x01\x25" * 8,
    b"GET /\r\n\x23\x01\x01\x25",
], ids=["tls", "stun", "get"])
def test_simulated_drives_do_not_listen_to_browsers_either(sim, words):
    drives = sim(st=("tcp",), rmd=("tcp",))
    for address in (drives.st_address, drives.can_address):
        host, _, number = address.rpartition(":")
        with socket.create_connection((host, int(number)), timeout=5) as page:
            page.sendall(words)
            try:
                assert page.recv(64) == b""
            except ConnectionError:
                pass


@pytest.mark.parametrize("protocol", PORT)
def test_a_unix_socket_is_its_users_own_and_gone_at_the_end(bench, guard, client, run, tmp_path, protocol):
    drives = bench(protocol)
    path = tmp_path / "held.sock"
    process = guard(protocol, drives, serve=f"unix-listen:{path}")
    mode = path.stat().st_mode
    assert stat.S_ISSOCK(mode) and stat.S_IMODE(mode) == 0o600
    if protocol == "st":
        run("st", "-p", f"unix:{path}", "info").ended(0)
    else:
        run("rmd", "-p", f"slcan:unix:{path}", "--timeout", 500, "status").ended(0)
    program = client(protocol, process.port)
    turns(drives, protocol)
    second = run("st", "-p", f"unix:{path}", "info").ended(3)
    assert "hung up" in second.err
    program.kill()
    rests(drives, protocol)
    process.interrupt()
    assert process.wait() == 0
    assert not path.exists()


def test_a_socket_of_a_killed_server_is_replaced_and_a_living_one_is_not(bench, guard, run, tmp_path):
    drives = bench("st")
    path = tmp_path / "held.sock"
    process = guard("st", drives, serve=f"unix-listen:{path}")
    other = run("sim", "--stdin", "--st", f"unix-listen:{path}").ended(3)
    assert "served already" in other.err
    process.kill()
    assert path.exists()
    run("st", "-p", f"unix:{path}", "info").ended(3)
    guard("st", drives, serve=f"unix-listen:{path}")
    run("st", "-p", f"unix:{path}", "info").ended(0)


# A6: RMD.


def test_rmd_motors_are_ended_as_told(sim, guard, client):
    for on_loss, mode in (("off", "off"), ("stop", "stopped")):
        drives = sim(st=())
        process = guard("rmd", drives, "--on-loss", on_loss, "--json")
        program = client("rmd", process.port)
        turns(drives, "rmd")
        program.kill()
        eventually(lambda: drives.motor(1)["mode"] == mode, f"the motor is {mode}")
        process.until(lambda: any('"stopped"' in text for text in process.out), "the event")
        event = next(json.loads(text) for text in process.out if '"stopped"' in text)
        assert event["reason"] == "client-gone"
        assert [(motor["motor"], motor["stopped"]) for motor in event["motors"]] == [(1, True)]
        process.interrupt()
        assert process.wait() == 0
        drives.end()


def test_an_acknowledge_of_the_programs_own_end_does_not_stand_for_the_guards(sim, start, tmp_path):
    """The program switches off, moves on and dies; replies are late, and the guard's first 0x80 is lost."""
    drives = sim(st=())
    with Meddler(tmp_path / "bus", drives.can, delay=0.01) as bus:
        serve = f"slcan-pty:{tmp_path}/held"
        process = start("guard", "rmd", "-p", f"slcan:{bus.path}", "--serve", serve, "--json")
        process.line(0)
        with RawLine(tmp_path / "held") as line:
            line.say(b"\rC\rS8\rO\r", b"\r")
            os.write(line.end, b"t14188000000000000000\rt1418A2000000A08C0000\r")
            eventually(lambda: bus.passed(b"t1418A2"), "the motor is told to turn")
            bus.lose(b"t141880")
        eventually(lambda: bus.is_lost(b"t141880"), "the guard's first 0x80 is lost")
        process.says("motor 1 is stopped (0x80 acknowledged)")
        assert drives.motor(1)["mode"] == "off"
        assert not any("another node" in text for text in process.err), process.err


class Meddler(Between):
    """A serial line to a drive on which replies are late and a line of slcan is lost."""

    def __init__(self, path, drive, delay):
        self.delay = delay
        self.sent, self.losing, self.lost = b"", [], []
        super().__init__(path, drive)

    def carry(self, source, target, is_sent):
        pending = b""
        while self.running:
            if not select.select([source], [], [], 0.05)[0]:
                continue
            pending += os.read(source, 4096)
            *lines, pending = pending.split(b"\r")
            for line in lines:
                if is_sent and self.losing and line.startswith(self.losing[0]):
                    self.lost.append(self.losing.pop(0))
                    continue
                if is_sent:
                    self.sent += line + b"\r"
                else:
                    time.sleep(self.delay)
                os.write(target, line + b"\r")

    def passed(self, beginning):
        return beginning in self.sent

    def lose(self, beginning):
        self.losing.append(beginning)

    def is_lost(self, beginning):
        return beginning in self.lost


def test_an_rmd_motor_that_its_program_ended_is_left_as_it_is(sim, guard):
    drives = sim(st=())
    process = guard("rmd", drives)
    # It held motor 2 still by itself, and left motor 1 turning.
    with RawLine(process.port) as line:
        line.say(b"\rC\rS8\rO\r", b"\r")
        line.say(b"t1428A2000000A08C0000\r", b"t1428A2")
        line.say(b"t14288100000000000000\r", b"t142881")
        line.say(b"t1418A2000000A08C0000\r", b"t1418A2")
    process.says("motor 1 is stopped (0x80 acknowledged)")
    assert not any("motor 2" in text for text in process.err), process.err
    assert drives.motor(2)["mode"] == "stopped"


def test_what_other_nodes_command_is_reported(sim, start, client, run, tmp_path):
    drives = sim(st=(), rmd=("tcp",))
    port = f"slcan:tcp:{drives.can_address}"
    process = start("guard", "rmd", "-p", port, "--serve", f"slcan-pty:{tmp_path}/held", "--json")
    process.line(0)
    program = client("rmd", f"{tmp_path}/held", "poll")
    other = ("rmd", "-p", port, "--timeout", 500, "--id", 3)
    run(*other, "status").ended(0)
    assert not any("another node" in text for text in process.err), process.err
    run(*other, "speed", 100).ended(0)
    process.says("motor 3 is commanded by another node of the bus (0xa2)")
    program.kill()
    process.says("motor 1 is stopped")
    assert drives.motor(3)["mode"] == "speed", "it is another's"


def test_an_rmd_guard_over_a_lost_port_goes_on_when_it_is_back(sim, guard, client):
    drives = sim(st=())
    process = guard("rmd", drives)
    program = client("rmd", process.port)
    turns(drives, "rmd")
    drives.kill()
    process.says("the drive's port is lost")
    program.kill()
    process.says("motor 1 MAY STILL TURN")
    drives = sim(st=())
    process.says("the drive's port is back")
    process.says("motor 1 is stopped (0x80 acknowledged)")


@pytest.mark.parametrize("protocol", PORT)
def test_a_guard_proves_that_it_stops_a_motor(bench, run, protocol):
    drives = bench(protocol)
    speed = {"st": 1200, "rmd": 300}[protocol]
    words = ["guard", protocol, "-p", PORT[protocol](drives), "--prove", "--spin", speed]
    shown = run(*words, within=60).ended(0)
    assert "acknowledged its stop after" in shown.out and "seen at rest after" in shown.out
    assert "SIGKILL" in shown.err
    proof = run(*words, "--json", within=60).ended(0).json
    assert proof["proved"] and proof["motor"] == 1
    assert proof["speed"] >= 0.8 * speed
    assert 0 < proof["stopped_after_ms"] < proof["still_after_ms"]
    rests(drives, protocol)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["st", "-p", "slcan:/dev/ttyACM0"], "guard rmd"),
        (["-p", "socketcan:can0"], "guard rmd"),
        (["rmd", "-p", "/dev/ttyACM0"], "use slcan:"),
        (["st", "-p", "sim:"], "end with it"),
        (["rmd", "-p", "sim:"], "end with it"),
        (["rmd"], "which port?"),
    ],
)
def test_what_cannot_be_guarded_is_told(run, words, says):
    assert says in run("guard", *words).ended(2).err


def test_two_requests_at_once_do_not_hide_which_motor_is_started(sim, guard):
    """Motor number 0 is the motor of the request before, which is not answered yet."""
    drives = sim(rmd=())
    for before in ([0x22, 0x01, 0x02, 0x25], [0x22, 0x01, 0xFF, 0x23], [0x01, 0x02, 0x00, 0x00, 0x03]):
        process = guard("st", drives)
        with RawLine(process.port) as line:
            line.say(bytes([0x42, 0x01, 0x02, 0x45]), b"\xf0\x01")
            os.write(line.end, bytes([*before, 0x03, 0x01, 0x01, 0x05]))
            turns(drives, "st")
        process.says("motor 1 is stopped")
        rests(drives, "st")
        process.interrupt()
        assert process.wait() == 0


def test_a_supervisor_that_does_not_listen_does_not_hold_up_a_guard(bench, start, client, tmp_path):
    drives = bench("st")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        variables = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "40000"}
        serve = f"unix-listen:{tmp_path}/held"
        process = start("guard", "-p", drives.st, "--serve", serve, **variables)
        process.line(0)
        assert systemd.recv(4096) == b"READY=1\n"
        began = drives.do("state")["time"]
        eventually(lambda: drives.do("state")["time"] > began + 1, "the socket is full")
        for _ in range(2):
            program = client("st", f"unix:{tmp_path}/held")
            turns(drives, "st")
            program.kill()
            rests(drives, "st")
        heard = {systemd.recv(4096).split(b"=")[0] for _ in range(10)}
        assert b"WATCHDOG" in heard
        process.interrupt()
        assert process.wait() == 0


def test_what_a_program_left_of_a_pty_does_not_harm_the_next(bench, guard, run):
    drives = bench("st")
    process = guard("st", drives)
    line = os.open(process.port, os.O_RDWR | os.O_NOCTTY)
    modes = termios.tcgetattr(line)
    modes[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(line, termios.TCSANOW, modes)
    termios.tcflow(line, termios.TCOOFF)
    os.close(line)
    process.says("has left")
    run("st", "-p", process.port, "get", "SPEED_KP").ended(0)


# A10: the power factor correction.


def test_the_pfc_that_a_program_enabled_is_disabled(sim, guard, tmp_path):
    drives = sim(rmd=())
    process = guard("st", drives)
    line = os.open(process.port, os.O_RDWR | os.O_NOCTTY)
    os.write(line, frame(header(EXECUTE, 1), [0x0A]))
    assert os.read(line, 16)[0] == ACK
    os.close(line)
    process.says("the PFC is stopped (PFC_DISABLE acknowledged)")


# A11: links of servers that were killed.


def test_a_link_whose_pty_is_anothers_by_now_is_an_error(sim, run, tmp_path):
    drives = sim(rmd=())
    link = Path(drives.st)
    number = os.path.basename(os.path.realpath(link))
    drives.kill()
    others = []
    try:
        while not os.path.exists(f"/dev/pts/{number}"):
            others.append(os.openpty())
        told = run("st", "-p", link, "start").ended(3)
        assert "stale" in told.err and "another program" in told.err
        # So it is through a link to the link.
        (tmp_path / "alias").symlink_to(link)
        assert "stale" in run("st", "-p", tmp_path / "alias", "info").ended(3).err
        for master, _ in others:
            os.set_blocking(master, False)
            with pytest.raises(BlockingIOError):
                os.read(master, 16)
    finally:
        for pair in others:
            for end in pair:
                os.close(end)
    # The next server has the place again.
    drives = sim(rmd=())
    run("st", "-p", drives.st, "info").ended(0)


def test_a_link_does_not_lead_to_the_drive_of_another_server(sim, motorlink, run, tmp_path):
    first = sim(rmd=())
    number = os.path.basename(os.path.realpath(first.st))
    first.kill()
    second = None
    for attempt in range(50):
        second = Sim([motorlink, "sim", "--st", f"pty:{tmp_path}/other{attempt}"], 1)
        if os.path.basename(os.path.realpath(second.st)) == number:
            break
        second.end()
    else:
        pytest.fail("no pty got the number again")
    try:
        assert "stale" in run("st", "-p", first.st, "start").ended(3).err
        run("st", "-p", second.st, "info").ended(0)
        assert second.motor(1)["status"] == "IDLE"
    finally:
        second.end()


@pytest.mark.parametrize("target", ["gone", "/dev/ttyUSB99"])
def test_a_link_of_the_users_own_is_never_deleted(run, tmp_path, target):
    link = tmp_path / "drive"
    link.symlink_to(target)
    for words in (["sim", "--stdin", "--st", f"pty:{link}"], ["sim", "--stdin", "--st", f"unix-listen:{link}"]):
        assert "remove it or choose another path" in run(*words).ended(3).err
        assert os.readlink(link) == target


# All together.


@pytest.mark.parametrize("protocol", PORT)
def test_random_combinations_leave_nothing_turning(bench, motorlink, client, tmp_path, protocol):
    """Signals, kills, stops and unread pipes in any order, as often as GUARD_RUNS says."""
    seed = int(os.environ.get("GUARD_SEED", time.time_ns()))
    print(f"GUARD_SEED={seed}")
    chance = random.Random(seed)
    drives = bench(protocol)
    times = []
    for number in range(RUNS):
        serve = chance.choice([f"{PTY[protocol]}:{tmp_path}/held{number}", f"unix-listen:{tmp_path}/s{number}"])
        guard = Mute(motorlink, protocol, drives, serve, chance.choice([*UNREAD.values(), os.pipe]))
        story = [serve.partition(":")[0]]
        try:
            mode = chance.choice(["hold", "poll", "flood"])
            program = client(protocol, guard.port, mode)
            turns(drives, protocol)
            story.append(mode)
            began = time.monotonic()
            acts = ["client", *chance.choices(["end", "suspend", "freeze", "wait"], k=chance.randint(0, 4))]
            chance.shuffle(acts)
            for act in acts:
                story.append(act)
                if act == "client":
                    program.send_signal(chance.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGABRT]))
                elif act == "end":
                    guard.process.send_signal(chance.choice(ENDING))
                elif act == "suspend":
                    guard.process.send_signal(chance.choice(SUSPENDING))
                elif act == "freeze":
                    program.send_signal(signal.SIGSTOP)
                    program.send_signal(signal.SIGCONT)
                else:
                    time.sleep(chance.uniform(0, 0.05))
            what = f"the stop after {story} (GUARD_SEED={seed}, run {number})"
            eventually(lambda: is_told_to_stop(drives, protocol), what, within=20)
            times.append(time.monotonic() - began)
            if "end" in acts:
                assert guard.process.wait(40) == 0, f"{story} (GUARD_SEED={seed}, run {number})"
            else:
                assert guard.process.poll() is None, story
        finally:
            guard.end()
        # Whatever the guard did, this one begins at rest.
        rests(drives, protocol)
    times = sorted(1e3 * span for span in times)
    parts = statistics.quantiles(times, n=100) if len(times) > 1 else times * 99
    print(
        f"{protocol}: {len(times)} runs, 0 left turning; ms to the stop: median {parts[49]:.0f},"
        f" 90 % {parts[89]:.0f}, 99 % {parts[98]:.0f}, most {times[-1]:.0f}"
    )
