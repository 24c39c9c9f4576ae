"""A network with a router: who may do what, pair by pair. `motorlink fleet init` has written its files;
the programs of the tests speak the messages themselves.
"""

import json
import os
import re
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import threading
import time
from types import SimpleNamespace

import pytest
import zenoh

from fleeting import Member, network
from program import Running, eventually
from sharing import Client
from shell import free_port
from test_json import check

ROOT = "motorlink/v1"
RAMP = (7, *struct.pack("<iH", 1500, 100))
START = (3, 1)
#: What is not there after this time does not come, s.
PAUSE = 0.7


class Site:
    """A site, its router and its nodes arm1 and arm2."""

    def __init__(self, motorlink, folder):
        self.motorlink, self.folder, self.running = motorlink, folder, []
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
        return path

    def end(self):
        for running in reversed(self.running):
            running.end()


@pytest.fixture(scope="module")
def site(motorlink, tmp_path_factory):
    """A site that all tests use."""
    site = Site(motorlink, tmp_path_factory.mktemp("site"))
    site.route()
    site.shares = {name: site.node(name) for name in ("arm1", "arm2")}
    site.direct = Client(site.shares["arm1"], "looks")
    site.alice = network(site.file("alice"))

    def alive():
        tokens = site.alice.liveliness().get(f"{ROOT}/arm1/node/alive/*")
        return [str(it.ok.key_expr).rsplit("/", 1)[1] for it in tokens if it.ok]

    (site.boot,) = eventually(alive, "the node arm1")
    eventually(lambda: answers(site.alice, f"{ROOT}/arm1/st0/1/columns"), "columns")
    yield site
    site.alice.close()
    site.end()


@pytest.fixture(scope="module")
def sessions(site):
    """`sessions(who)`: the session of somebody; None: the router does not take it."""
    opened = {}

    def session(who):
        if who not in opened:
            try:
                opened[who] = network(site.file(who))
            except zenoh.ZError:
                opened[who] = None
        return opened[who]

    yield session
    for one in filter(None, opened.values()):
        one.close()


def answers(session, key, payload=None, **options):
    """The answers to a query."""
    mode = zenoh.ConsolidationMode.NONE
    options = {"target": zenoh.QueryTarget.ALL, "timeout": PAUSE, "consolidation": mode, **options}
    replies = session.get(key, payload=payload, **options)
    return [reply.ok.payload.to_bytes() for reply in replies if reply.ok]


def tokens(session, key):
    return [str(it.ok.key_expr) for it in session.liveliness().get(key, timeout=PAUSE) if it.ok]


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


def turn(site):
    """Motor 1 turns, by a program at the share of arm1."""
    for code in (RAMP, START):
        assert site.direct.command("st0", 1, *code)["kind"] == "answer"
    eventually(lambda: site.direct.rpm() > 1400, "motor 1 at speed", within=20)


# What somebody may try. Each gives whether it had an effect.


def sees_nodes(site, session, who):
    return any("/arm1/" in it for it in tokens(session, f"{ROOT}/*/node/alive/*"))


def asks_info(site, session, who):
    return bool(answers(session, f"{ROOT}/*/node/info/*"))


def asks_columns(site, session, who):
    return bool(answers(session, f"{ROOT}/arm1/st0/1/columns"))


def hears_state(site, session, who):
    return hears(session, f"{ROOT}/arm1/node/state", within=2.2)


def hears_samples(site, session, who):
    return hears(session, f"{ROOT}/*/*/*/samples")


def hears_events(site, session, who):
    def cause():
        site.direct.ask("latch")
        site.direct.ask("release")

    return hears(session, f"{ROOT}/*/*/events", cause)


def hears_all(site, session, who):
    return hears(session, f"{ROOT}/**", within=1.2)


def joins_to_see(site, session, who):
    return joins(member(site, session, who))


def reads(site, session, who):
    it = member(site, session, who)
    if not joins(it):
        return False
    return it.command(2, 30, scope="see")["kind"] == "answer"


def stops(site, session, who):
    turn(site)
    it = member(site, session, who)
    joins(it)
    joins(it, "stop")
    ask = {"ask": "urgent", "after": 0, "number": 1, "sent": 0.0, "time_to_live": 1.0}
    for scope in ("see", "stop", "act"):
        it.ask(scope, {**ask, "request": {"id": 1, "ask": "stop"}}, PAUSE)
    time.sleep(PAUSE)
    return site.direct.rpm() < 1300


def moves(site, session, who, name=None):
    it = member(site, session, name or who)
    for scope in ("see", "act"):
        joins(it, scope)
    number = 0
    for code in (RAMP, START):
        for scope in ("see", "stop", "act"):
            request = {"ask": "command", "line": "st0", "motor": 2, "bytes": list(code)}
            request |= {"id": 1, "time_to_live": 1.0}
            post = {"ask": "post", "number": number + 1, "sent": it.now(), "time_to_live": 1.0}
            taken = it.ask(scope, {**post, "request": request}, PAUSE)
            if taken and taken["kind"] == "taken":
                number += 1
    time.sleep(PAUSE)
    turned = site.direct.rpm(2) > 200
    site.direct.ask("stop", motor={"line": "st0", "motor": 2})
    eventually(lambda: abs(site.direct.rpm(2)) < 30, "motor 2 at rest", within=20)
    return turned


def moves_as_another(site, session, who):
    return any(moves(site, session, who, name) for name in ("alice", "bob", "arm1") if name != who)


def asks_with_wildcards(site, session, who):
    join = json.dumps({"ask": "join", "protocol": 1, "program": "test", "deadline": 10})
    keys = ("**", "arm1/**", "*/node/ask/**", "arm1/node/ask/*/*/*/*", "arm1/node/ask/*/*/alice/*")
    return any(answers(session, f"{ROOT}/{key}", join, timeout=0.3) for key in keys)


def says_false_state(site, session, who):
    return hears(site.alice, f"{ROOT}/arm1/node/false/samples",
                 lambda: session.put(f"{ROOT}/arm1/node/false/samples", "false"))


def answers_as_arm1(site, session, who):
    key = f"{ROOT}/arm1/node/info/false"
    queryable = session.declare_queryable(key, lambda query: query.reply(key, "false"))
    time.sleep(0.1)
    came = b"false" in answers(site.alice, f"{ROOT}/*/node/info/*")
    queryable.undeclare()
    return came


def answers_others_queries_as_arm1(site, session, who):
    """It may answer in its own name, and answers in that of arm1."""
    key = f"{ROOT}/{who}/node/info/false"
    false = f"{ROOT}/arm1/node/info/false"
    queryable = session.declare_queryable(f"{ROOT}/*/node/info/*", lambda it: it.reply(false, "false"))
    own = session.declare_queryable(key, lambda it: it.reply(false, "false"))
    time.sleep(0.1)
    came = b"false" in answers(site.alice, f"{ROOT}/*/node/info/*")
    own.undeclare()
    queryable.undeclare()
    return came


def is_alive_as_arm1(site, session, who):
    key = f"{ROOT}/arm1/node/alive/false"
    token = session.liveliness().declare_token(key)
    time.sleep(0.1)
    came = key in tokens(site.alice, f"{ROOT}/arm1/node/alive/*")
    token.undeclare()
    return came


def takes_requests_of_others(site, session, who):
    taken = threading.Event()
    queryable = session.declare_queryable(f"{ROOT}/arm1/node/ask/**", lambda query: taken.set())
    time.sleep(0.1)
    assert joins(member(site, site.alice, "alice"))
    came = taken.wait(0.2)
    queryable.undeclare()
    return came


def sees_programs(site, session, who):
    here = f"{ROOT}/arm1/node/here/{site.boot}/alice/feed"
    token = site.alice.liveliness().declare_token(here)
    time.sleep(0.1)
    came = tokens(session, f"{ROOT}/arm1/node/here/*/*/*") + tokens(session, f"{ROOT}/**")
    heard = threading.Event()
    key = f"{ROOT}/arm1/node/here/*/*/*"
    subscriber = session.liveliness().declare_subscriber(key, lambda it: heard.set(), history=True)
    came = heard.wait(0.3) or bool(came)
    subscriber.undeclare()
    token.undeclare()
    return came


def says_that_alice_is_gone(site, session, who):
    """The motors of a program that is gone stop."""
    alice = member(site, site.alice, "alice")
    assert joins(alice)
    alice.command(*RAMP, motor=2)
    alice.command(*START, motor=2)
    eventually(lambda: site.direct.rpm(2) > 1400, "motor 2 at speed", within=20)
    token = f"{ROOT}/arm1/node/here/{site.boot}/alice/{alice.session}"
    session.liveliness().declare_token(token).undeclare()
    time.sleep(PAUSE)
    stopped = site.direct.rpm(2) < 1300
    site.direct.ask("stop", motor={"line": "st0", "motor": 2})
    eventually(lambda: abs(site.direct.rpm(2)) < 30, "motor 2 at rest", within=20)
    alice.ask("see", {"ask": "leave", "why": "end"})
    return stopped


WHAT = [
    *(sees_nodes, asks_info, asks_columns, hears_state, hears_samples, hears_events, hears_all),
    *(joins_to_see, reads, stops, moves, moves_as_another, asks_with_wildcards),
    *(says_false_state, answers_as_arm1, answers_others_queries_as_arm1, is_alive_as_arm1),
    *(takes_requests_of_others, sees_programs, says_that_alice_is_gone),
]
SEE = {sees_nodes, asks_info, asks_columns, hears_state, hears_samples, hears_events, joins_to_see, reads}
#: All else is denied. The node itself is the control of what others may not do in its name.
MAY = {
    "nobody": set(),
    "plain": set(),
    "stranger": set(),
    "bob": SEE,
    "alice": SEE | {stops, moves, says_that_alice_is_gone},
    "arm2": set(),
    "arm1": {says_false_state, answers_as_arm1, answers_others_queries_as_arm1, is_alive_as_arm1,
             takes_requests_of_others, sees_programs},
}


@pytest.mark.parametrize("what", WHAT, ids=lambda it: it.__name__)
@pytest.mark.parametrize("who", MAY)
def test_each_may_do_what_its_role_allows_and_nothing_else(site, sessions, who, what):
    session = sessions(who)
    assert (session is None) == (who in ("nobody", "plain", "stranger"))
    had_effect = session is not None and what(site, session, who)
    assert had_effect == (what in MAY[who])
