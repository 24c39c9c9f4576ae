"""A network with a router for the tests, and what somebody may try in it through Zenoh."""

import contextlib
import json
import os
import socket
import ssl
import struct
import subprocess
import threading
import time

import zenoh

from fleeting import Member
from program import Running, eventually
from sharing import Client
from shell import free_port
from test_json import check

ROOT = "motorlink/v1"
RAMP = (7, *struct.pack("<iH", 1500, 100))
START = (3, 1)
#: The value of STATUS of a motor that may be started.
IDLE = 0
#: What has not come after this time is denied, s.
PAUSE = 0.5


class Site:
    """A site, its router and its nodes arm1 and arm2."""

    def __init__(self, motorlink, folder):
        self.motorlink, self.folder, self.running = motorlink, folder, []
        #: The sockets of the nodes, and the programs that turn motors of arm1.
        self.shares, self.turning = {}, {}
        self.address = f"tls/127.0.0.1:{free_port()}"
        self.members = ["--node", "arm1", "--node", "arm2", "--operator", "alice", "--viewer", "bob"]
        self.init("plant", "--router", self.address[4:], *self.members)
        # Another authority, with the same names.
        self.init("other", "--router", self.address[4:], *self.members)

    def init(self, name, *words):
        words = [self.motorlink, "fleet", "init", self.folder / name, *words, "--json"]
        done = subprocess.run(words, capture_output=True, text=True, timeout=20)
        assert done.returncode == 0, done.stderr
        check(done.stdout)
        return json.loads(done.stdout)

    def file(self, who):
        """The file of a member, or another way to the network."""
        ways = {"nobody": self.address, "plain": self.address.replace("tls", "tcp")}
        if who in ways:
            return ways[who]
        if who == "stranger":
            return self.folder / "other/operators/alice.json5"
        (path,) = (self.folder / "plant").glob(f"*/{who}.json5")
        return path

    def start(self, *words):
        running = Running([self.motorlink, *map(str, words), "--json"])
        self.running.append(running)
        check(running.line(0))
        return running

    def route(self):
        return self.start("fleet", "router", "--network", self.folder / "plant/router.json5")

    def node(self, name):
        path = self.folder / f"{name}.share"
        words = ["-p", "sim:", "--at", f"unix:{path}", "--network", self.file(name)]
        running = self.start("node", *words, "--timeout", "5s")
        assert json.loads(running.line(0))["node"] == name
        self.shares[name] = path
        return path

    def end(self):
        for running in reversed(self.running):
            running.end()


def answers(session, key, payload=None, **options):
    """The answers to a query."""
    mode = zenoh.ConsolidationMode.NONE
    options = {"target": zenoh.QueryTarget.ALL, "timeout": PAUSE, "consolidation": mode, **options}
    replies = session.get(key, payload=payload, **options)
    return [reply.ok.payload.to_bytes() for reply in replies if reply.ok]


def tokens(session, key):
    return [str(it.ok.key_expr) for it in session.liveliness().get(key, timeout=PAUSE) if it.ok]


def hears_tokens(session, key, within):
    """Whether a token is there, or comes."""
    heard = threading.Event()
    subscriber = session.liveliness().declare_subscriber(key, lambda it: heard.set(), history=True)
    came = heard.wait(within)
    subscriber.undeclare()
    return came


def hears(session, key, cause=lambda: None, within=PAUSE):
    """Whether a value comes to a subscriber."""
    heard = threading.Event()
    subscriber = session.declare_subscriber(key, lambda sample: heard.set())
    time.sleep(0.1)
    cause()
    came = heard.wait(within)
    subscriber.undeclare()
    return came


def member(site, session, who):
    """A session of a program at arm1."""
    it = Member.__new__(Member)
    it.zenoh, it.boot, it.node = session, site.boot, "arm1"
    it.base = f"{ROOT}/arm1/node/ask/{site.boot}"
    it.who, it.session = who, os.urandom(8).hex()
    it.last = it.urgent = it.pulls = it.ids = it.after = 0
    it.deadline, it.alive, it.heard, it.ahead = 10, None, [], 0
    return it


def joins(it, scope="see"):
    joined = it.ask(scope, {"ask": "join", "protocol": 1, "program": "test", "deadline": 10}, PAUSE)
    if joined:
        it.ahead = joined["t"] - time.monotonic()
    return bool(joined) and joined["kind"] == "joined"


def turn(site, motor=1):
    """A motor turns, by a program of its own at the share of arm1."""
    if site.direct.rpm(motor) > 1400:
        return
    rest(site, motor)
    eventually(lambda: site.direct.status(motor) == IDLE, f"motor {motor} idle", within=20)
    site.turning[motor] = Client(site.shares["arm1"], "turns")
    for code in (RAMP, START):
        assert site.turning[motor].command("st0", motor, *code)["kind"] == "answer"
    eventually(lambda: site.direct.rpm(motor) > 1400, f"motor {motor} at speed", within=20)


def rest(site, motor=1):
    """A motor stops, and no program of the share holds it."""
    site.direct.ask("stop", motor={"line": "st0", "motor": motor})
    if motor in site.turning:
        site.turning.pop(motor).socket.close()
    eventually(lambda: abs(site.direct.rpm(motor)) < 30, f"motor {motor} at rest", within=20)


def leaves(site, it):
    """Its motor stops, and is free."""
    rest(site, 2)
    it.ask("see", {"ask": "leave", "why": "end"}, PAUSE)


@contextlib.contextmanager
def strangers(address, count, is_silent):
    """Connections without a certificate. Silent ones say nothing at all. Gives what counts those that the router
    has closed."""
    host, port = address.removeprefix("tls/").split(":")
    context = ssl._create_unverified_context()
    connected, closed = [], []

    def attack():
        with socket.create_connection((host, int(port)), timeout=20) as stranger:
            connected.append(stranger)
            try:
                if not is_silent:
                    context.wrap_socket(stranger, suppress_ragged_eofs=False).recv(1)
                stranger.recv(1)
            except OSError:
                pass
            closed.append(stranger)

    for _ in range(count):
        threading.Thread(target=attack, daemon=True).start()
    try:
        eventually(lambda: len(connected) == count, f"{count} connections")
        yield lambda: len(closed)
    finally:
        for stranger in connected:
            with contextlib.suppress(OSError):
                stranger.shutdown(socket.SHUT_RDWR)
