"""What somebody may try in a network with a router. Each gives whether it had an effect."""

import json
import threading
import time

from program import eventually
from siting import (
    PAUSE, RAMP, ROOT, START, answers, hears, hears_tokens, joins, leaves, member, tokens, turn,
)  # fmt: skip


def hears_of_ends(site, session, who):
    ended = f"{ROOT}/arm1/node/ended/false"
    return hears(session, f"{ROOT}/*/node/ended/*", lambda: site.nodes["arm1"].put(ended, ""))


def hears_why_not(site, session, who):
    replies = session.get(f"{ROOT}/arm1/st7/1/identity", timeout=PAUSE)
    return any(b"no line" in it.err.payload.to_bytes() for it in replies if it.ok is None)


def hears_events(site, session, who):
    def cause():
        site.direct.ask("latch")
        site.direct.ask("release")

    return hears(session, f"{ROOT}/*/*/events", cause)


def hears_all(site, session, who):
    return hears(session, f"{ROOT}/**", within=2.2)


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
    request = {"id": 1, "ask": "stop", "motor": {"line": "st0", "motor": 1}}
    for scope in ("see", "stop", "act"):
        it.ask(scope, {**ask, "request": request}, PAUSE)
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
    leaves(site, it)
    return turned


def moves_as_another(site, session, who):
    return moves(site, session, who, "bob" if who == "alice" else "alice")


def asks_with_wildcards(site, session, who):
    join = json.dumps({"ask": "join", "protocol": 1, "program": "test", "deadline": 10})
    keys = ("**", "arm1/**", "*/node/ask/**", "arm1/node/ask/*/*/*/*", "arm1/node/ask/*/*/alice/*")
    return any(answers(session, f"{ROOT}/{key}", join, timeout=0.3) for key in keys)


def says_false_state(site, session, who):
    return hears(site.alice, f"{ROOT}/arm1/node/false/samples",
                 lambda: session.put(f"{ROOT}/arm1/node/false/samples", "false"))


def says_that_arm1_ends(site, session, who):
    ended = f"{ROOT}/arm1/node/ended/false"
    return hears(site.nodes["arm2"], f"{ROOT}/*/node/ended/*", lambda: session.put(ended, ""))


def answers_falsely(site, session, asked, key, *takes):
    """Whether alice gets the answer of somebody who takes such queries."""
    declared = [session.declare_queryable(it, lambda query: query.reply(key, "false")) for it in takes]
    time.sleep(0.1)
    came = b"false" in answers(site.alice, asked)
    for queryable in declared:
        queryable.undeclare()
    return came


def answers_as_arm1(site, session, who):
    key = f"{ROOT}/arm1/node/info/false"
    return answers_falsely(site, session, f"{ROOT}/*/node/info/*", key, key)


def answers_others_queries_as_arm1(site, session, who):
    """It may answer in its own name, and answers in that of arm1."""
    all_infos, false = f"{ROOT}/*/node/info/*", f"{ROOT}/arm1/node/info/false"
    return answers_falsely(site, session, all_infos, false, all_infos, f"{ROOT}/{who}/node/info/false")


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
    found = tokens(session, f"{ROOT}/arm1/node/here/*/*/*") + tokens(session, f"{ROOT}/**")
    came = hears_tokens(session, f"{ROOT}/arm1/node/here/*/*/*", 0.3) or here in found
    token.undeclare()
    return came


def says_that_alice_is_gone(site, session, who):
    """The motors of a program that is gone stop."""
    alice = member(site, site.alice, "alice")
    assert joins(alice)
    for code in (RAMP, START):
        assert alice.command(*code, motor=2)["kind"] == "answer"
    eventually(lambda: site.direct.rpm(2) > 1400, "motor 2 at speed", within=20)
    token = f"{ROOT}/arm1/node/here/{site.boot}/alice/{alice.session}"
    session.liveliness().declare_token(token).undeclare()
    time.sleep(PAUSE)
    stopped = site.direct.rpm(2) < 1300
    leaves(site, alice)
    return stopped
