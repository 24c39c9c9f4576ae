"""A network with a router: who may do what, pair by pair. `motorlink fleet init` has written its files;
the programs of the tests speak the messages themselves.
"""

import base64
import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import zenoh

from fleeting import network
from program import children, eventually
from sharing import Client
from site_attempts import (
    hears_of_ends, hears_why_not, hears_events, hears_all, joins_to_see, reads, stops, moves, moves_as_another,
    asks_with_wildcards, says_false_state, says_that_arm1_ends, answers_as_arm1,
    answers_others_queries_as_arm1, is_alive_as_arm1, takes_requests_of_others, sees_programs,
    says_that_alice_is_gone,
)
from siting import (
    PAUSE, ROOT, Site, answers, hears, hears_tokens, joins, member, rest, strangers, tokens, turn,
)

@pytest.fixture(scope="module")
def site(motorlink, tmp_path_factory):
    """A site that all tests use."""
    site = Site(motorlink, tmp_path_factory.mktemp("site"))
    site.route()
    for name in ("arm1", "arm2"):
        site.node(name)
    site.direct = Client(site.shares["arm1"], "looks")
    site.alice = network(site.file("alice"))
    site.nodes = {name: network(site.file(name)) for name in ("arm1", "arm2")}

    def alive():
        tokens = site.alice.liveliness().get(f"{ROOT}/arm1/node/alive/*")
        return [str(it.ok.key_expr).rsplit("/", 1)[1] for it in tokens if it.ok]

    (site.boot,) = eventually(alive, "the node arm1")
    eventually(lambda: answers(site.alice, f"{ROOT}/arm1/st0/1/columns"), "columns")
    # The first start of a motor takes longer than PAUSE.
    turn(site, 2)
    rest(site, 2)
    yield site
    for session in (site.alice, *site.nodes.values()):
        session.close()
    site.end()


@pytest.fixture(scope="module")
def sessions(site):
    """`sessions(who)`: the session of somebody."""
    opened = {}

    def session(who):
        if who not in opened:
            opened[who] = network(site.file(who))
        return opened[who]

    yield session
    for one in opened.values():
        one.close()


#: What all programs may do; the key of what is asked or heard.
PUBLIC = {
    "sees_nodes": lambda session: any("/arm1/" in it for it in tokens(session, f"{ROOT}/*/node/alive/*")),
    "hears_of_nodes": lambda session: hears_tokens(session, f"{ROOT}/*/node/alive/*", PAUSE),
    "asks_info": lambda session: answers(session, f"{ROOT}/*/node/info/*"),
    "asks_columns": lambda session: answers(session, f"{ROOT}/arm1/st0/1/columns"),
    "asks_identity": lambda session: answers(session, f"{ROOT}/arm1/st0/1/identity"),
    "asks_register": lambda session: answers(session, f"{ROOT}/arm1/st0/1/registers/STATUS"),
    "asks_settings": lambda session: answers(session, f"{ROOT}/arm1/st0/1/settings", timeout=5),
    "hears_state": lambda session: hears(session, f"{ROOT}/arm1/node/state", within=2.2),
    "hears_samples": lambda session: hears(session, f"{ROOT}/*/*/*/samples"),
}
WHAT = [
    # What is under way of an earlier subscription would also come to that to all.
    *(hears_why_not, hears_all, hears_events, joins_to_see, reads, stops, moves, moves_as_another),
    *(asks_with_wildcards, says_false_state, answers_as_arm1, answers_others_queries_as_arm1, is_alive_as_arm1),
    *(takes_requests_of_others, sees_programs, says_that_alice_is_gone, hears_of_ends, says_that_arm1_ends),
]
SEE = {hears_why_not, hears_events, joins_to_see, reads}
MEET = {hears_of_ends}
#: All else is denied. The node itself is the control of what others may not do in its name.
MAY = {
    "bob": SEE,
    "alice": SEE | {stops, moves, says_that_alice_is_gone},
    "arm2": MEET,
    "arm1": MEET | {says_false_state, answers_as_arm1, answers_others_queries_as_arm1, is_alive_as_arm1,
                    takes_requests_of_others, sees_programs, says_that_arm1_ends},
}


@pytest.mark.parametrize("what", WHAT, ids=lambda it: it.__name__)
@pytest.mark.parametrize("who", MAY)
def test_each_may_do_what_its_role_allows_and_nothing_else(site, sessions, who, what):
    assert what(site, sessions(who), who) == (what in MAY[who])


@pytest.mark.parametrize("who", MAY)
def test_all_programs_see_what_is_public_and_nodes_see_nodes_alone(site, sessions, who):
    seen = {name for name, sees in PUBLIC.items() if sees(sessions(who))}
    assert seen == (set(PUBLIC) if who in ("bob", "alice") else {"hears_of_nodes"})


@pytest.mark.parametrize("who", ["nobody", "plain", "stranger"])
def test_the_router_takes_nobody_without_its_certificate(site, who):
    with pytest.raises(zenoh.ZError):
        network(site.file(who))


SPIES = [hears_all, asks_with_wildcards, moves, takes_requests_of_others, sees_programs]


@pytest.mark.parametrize("what", SPIES, ids=lambda it: it.__name__)
def test_a_viewer_that_connects_as_a_router_may_do_no_more(site, routing, what):
    assert not what(site, routing, "bob")


@pytest.fixture(scope="module")
def routing(site):
    """A session of the viewer in the mode of a router."""
    config = zenoh.Config.from_file(str(site.file("bob")))
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", "[]")
    session = zenoh.open(config)
    yield session
    session.close()


def test_without_access_control_wildcards_have_an_effect(start):
    """The control of tests above in which all is denied."""
    open_node = start("node", "-p", "sim:", "--name", "arm1", "--listen", "tcp/127.0.0.1:0", "--json")
    session = network(json.loads(open_node.line(0))["addresses"][0])
    eventually(lambda: hears_all(None, session, "alice"), "a value")
    assert asks_with_wildcards(None, session, "alice")
    session.close()


def st(site, who, *words):
    return ["st", "-p", f"zenoh:arm1/st0?via={site.file(who)}", *words]


def test_a_viewer_sees_and_is_told_what_it_may_not(site, run):
    via = ["--via", site.file("bob")]
    listed = run("fleet", "list", *via, "--json").ended(0)
    assert [it["node"] for it in listed.lines] == ["arm1", "arm2"]
    run(*st(site, "bob", "get", "SPEED_MEAS")).ended(0)
    denied = run(*st(site, "bob", "start")).ended(3)
    assert "bob may be allowed to see only" in denied.err
    turn(site)
    stopped = run("fleet", "stop-all", *via).ended(3)
    for node in ("arm1", "arm2"):
        assert f"node {node} is there, but does not answer" in stopped.out
    assert "may still turn" in stopped.err and "confirmed" not in stopped.out
    assert "no answer of arm1, arm2" in run("fleet", "release", *via).ended(3).err
    assert site.direct.rpm() > 1400
    confirmed = run("fleet", "stop-all", "--via", site.file("alice")).ended(0)
    assert "arm1/st0, motor 1: it confirmed the stop" in confirmed.out
    run("fleet", "release", "--via", site.file("alice")).ended(0)


def test_a_program_has_the_name_of_its_certificate(site, run):
    rest(site)
    run(*st(site, "alice", "ramp", "500", "1s")).ended(0)
    arm1 = site.running[1]
    arm1.until(lambda: any('"alice (motorlink' in line for line in arm1.out), "the name alice")
    other = f"zenoh:arm1/st0?via={site.file('alice')}&as=bob"
    denied = run("st", "-p", other, "get", "SPEED_MEAS").ended(3)
    assert "bob may not be allowed to see" in denied.err
    name = run("node", "-p", "sim:", "--name", "arm7", "--network", site.file("arm1")).ended(2)
    assert "is that of arm1, not of arm7" in name.err
    role = run("node", "-p", "sim:", "--network", site.file("bob")).ended(2)
    assert "a file of the role viewer" in role.err
    again = run("node", "-p", "sim:", "--network", site.file("arm1")).ended(3)
    assert "another node of this network has the name arm1" in again.err


def changed(site, who, tmp_path, **replaced):
    """The file of a member with other texts in it."""
    text = site.file(who).read_text()
    for old, new in replaced.values():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / f"{who}.json5"
    path.write_text(text)
    return path


@pytest.mark.parametrize("fault", ["plain", "stranger", "host"])
def test_a_network_that_refuses_a_program_is_named_at_once(site, run, fault, tmp_path):
    host = ("tls/127.0.0.1", "tls/localhost")
    way = changed(site, "alice", tmp_path, host=host) if fault == "host" else site.file(fault)
    began = time.monotonic()
    for words in (["fleet", "stop-all", "--via", way], ["st", "-p", f"zenoh:arm1/st0?via={way}", "status"]):
        refused = run(*words).ended(3)
        assert "nothing answers at t" in refused.err, refused.err
        assert ("or it refuses the certificate of alice" in refused.err) == (fault != "plain")
    if fault == "stranger":
        file = site.folder / "other/nodes/arm2.json5"
        node = run("node", "-p", "sim:", "--network", file).ended(3)
        assert "or it refuses the certificate of arm2" in node.err
    assert time.monotonic() - began < 10


def test_a_node_says_that_the_router_does_not_know_it_yet(site, run):
    site.init("plant", "--node", "arm3")
    unknown = run("node", "-p", "sim:", "--network", site.file("arm3")).ended(3)
    assert "the router does not know the node arm3" in unknown.err and "router.json5" in unknown.err


def openssl(*words, cwd):
    done = subprocess.run(["openssl", *map(str, words)], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def pem(path, what):
    """A certificate or a key of a file, in PEM."""
    (text,) = re.findall(f'"{what}_base64": "([^"]+)"', path.read_text())
    return base64.b64decode(text).decode()


def test_an_expired_certificate_is_named_and_refused(site, run, tmp_path):
    ca = site.folder / "plant/ca"
    (tmp_path / "key.pem").write_text(pem(site.file("alice"), "connect_private_key"))
    openssl("req", "-new", "-key", "key.pem", "-subj", "/CN=alice", "-out", "it.csr", cwd=tmp_path)
    (tmp_path / "index.txt").touch()
    (tmp_path / "ca.cnf").write_text("[ca]\ndefault_ca=own\n[own]\ndatabase=index.txt\nserial=serial\n"
                                     "new_certs_dir=.\npolicy=any\nx509_extensions=client\n"
                                     "[any]\ncommonName=supplied\n[client]\nextendedKeyUsage=clientAuth\n")
    dates = ["-startdate", "20250101000000Z", "-enddate", "20250201000000Z"]
    openssl("ca", "-batch", "-config", "ca.cnf", "-cert", ca / "ca.pem", "-keyfile", ca / "ca.key",
            "-in", "it.csr", "-out", "it.pem", "-md", "sha256", "-rand_serial", *dates, "-notext", cwd=tmp_path)
    text = base64.b64encode((tmp_path / "it.pem").read_bytes()).decode()
    old = base64.b64encode(pem(site.file("alice"), "connect_certificate").encode()).decode()
    path = changed(site, "alice", tmp_path, certificate=(old, text))
    refused = run("fleet", "list", "--via", path).ended(3)
    assert "the certificate of alice has expired on 2025-02-01" in refused.err
    # The router looks, too.
    with pytest.raises(zenoh.ZError):
        network(path)


def test_another_program_reads_the_certificates(site):
    ca = site.folder / "plant/ca/ca.pem"
    for who, side, purpose in (("alice", "connect", "sslclient"), ("arm1", "connect", "sslclient")):
        path = site.folder / f"{who}.pem"
        path.write_text(pem(site.file(who), f"{side}_certificate"))
        openssl("verify", "-x509_strict", "-CAfile", ca, "-purpose", purpose, path, cwd=site.folder)
        text = openssl("x509", "-in", path, "-noout", "-subject", cwd=site.folder)
        assert text.strip().replace(" ", "") == f"subject=CN={who}"
    path = site.folder / "router.pem"
    path.write_text(pem(site.folder / "plant/router.json5", "listen_certificate"))
    openssl("verify", "-x509_strict", "-CAfile", ca, "-purpose", "sslserver",
            "-verify_ip", "127.0.0.1", path, cwd=site.folder)


#: A program that turns ST motor 1 until it is killed. It promises a sign of life each 10 s.
TURNS = """
import sys, time
sys.path.insert(0, sys.argv[2])
from fleeting import Member
member = Member(sys.argv[1], "arm1", who="alice", deadline=10)
key = f"motorlink/v1/arm1/node/here/{member.boot}/alice/{member.session}"
token = member.zenoh.liveliness().declare_token(key)
member.turn()
print("turning", flush=True)
time.sleep(600)
"""


def test_the_router_tells_a_node_at_once_that_a_program_was_killed(site):
    rest(site)
    words = [sys.executable, "-c", TURNS, site.file("alice"), Path(__file__).parent]
    with children() as start:
        process = start(words, "turning")
        eventually(lambda: site.direct.rpm() > 1400, "motor 1 at speed", within=20)
        process.kill()
        eventually(lambda: site.direct.rpm() < 1300, "a motor that stops", within=3)
    eventually(lambda: abs(site.direct.rpm()) < 30, "motor 1 at rest", within=20)


def test_many_messages_in_both_directions_lose_no_connection(site):
    """The router writes to a TLS connection while it reads from it, on two threads."""
    arm1, alice = site.nodes["arm1"], network(site.file("alice"))
    ask, sample = f"{ROOT}/arm1/node/ask/many/see/alice/many", f"{ROOT}/arm1/many/1/samples"
    tokens = [arm1.liveliness().declare_token(f"{ROOT}/arm1/node/alive/many"),
              alice.liveliness().declare_token(f"{ROOT}/arm1/node/here/many/alice/many")]
    gone, heard, answered = [], [], []

    def seen(it):
        if it.kind == zenoh.SampleKind.DELETE:
            gone.append(str(it.key_expr))

    declared = [
        alice.liveliness().declare_subscriber(f"{ROOT}/*/node/alive/*", seen, history=True),
        arm1.liveliness().declare_subscriber(f"{ROOT}/arm1/node/here/*/*/*", seen, history=True),
        alice.declare_subscriber(sample, heard.append),
        arm1.declare_queryable(ask, lambda query: query.reply(query.key_expr, b"answer")),
    ]
    ends = threading.Event()

    def publish():
        sent, last = 0, time.monotonic()
        while not ends.is_set():
            # Not more than the machine carries: what waits would delay the tests behind this one. Some may be lost.
            is_stuck = time.monotonic() > last + 0.5
            if is_stuck or sent < len(heard) + 500:
                sent, last = (len(heard) if is_stuck else sent) + 20, time.monotonic()
                for size in range(20):
                    arm1.put(sample, b"m" * size)
            time.sleep(0.002)

    publisher = threading.Thread(target=publish, daemon=True)
    publisher.start()
    end = time.monotonic() + 3

    def is_enough():
        answered.extend(it for it in alice.get(ask, timeout=5) if it.ok)
        return time.monotonic() > end and len(heard) > 1000 and len(answered) > 100

    try:
        eventually(is_enough, "many messages in both directions", within=60)
        # Or the nodes miss this run of arm1.
        arm1.put(f"{ROOT}/arm1/node/ended/many", "")
    finally:
        ends.set()
        publisher.join()
        lost = list(gone)
        for it in (*declared, *tokens):
            it.undeclare()
        alice.close()
    assert not lost and site.running[0].process.poll() is None


def test_a_flood_of_strangers_does_not_delay_a_stop(site, sessions):
    """The operator is connected. For some seconds new programs cannot connect: Zenoh needs 0.1 s for each
    connection that fails. The stop does not wait for that. So this test comes late."""
    turn(site)
    alice = member(site, sessions("alice"), "alice")
    assert joins(alice)
    with strangers(site.address, 200, is_silent=False) as closed:
        assert alice.stop({"line": "st0", "motor": 1}, within=20)["kind"] == "answer"
        assert closed() < 100
        eventually(lambda: abs(site.direct.rpm()) < 30, "motor 1 at rest", within=20)


def test_access_is_withdrawn_when_the_router_starts_again(site, sessions, run):
    """Last: the sessions of other tests lose their router."""
    bob = site.file("bob")
    copy = site.folder / "bob.json5"
    shutil.move(bob, copy)
    site.init("plant", "--viewer", "carol")
    router = site.running[0]
    router.process.send_signal(signal.SIGTERM)
    assert router.wait(10) == 0
    site.running[0] = site.route()
    site.running.pop()
    alice = ["fleet", "list", "--via", site.file("alice"), "--json"]

    def both():
        listed = run(*alice)
        return listed.code == 0 and len(listed.lines) == 2

    eventually(both, "both nodes, by themselves", within=20)
    assert len(run("fleet", "list", "--via", site.file("carol"), "--json").ended(0).lines) == 2
    hidden = run("fleet", "list", "--via", copy).ended(0).out
    assert "No node is at this network that bob may see" in hidden
    assert run("st", "-p", f"zenoh:arm1/st0?via={copy}", "status").code == 3
