"""`motorlink node`: drives at another computer. The programs of the tests speak the messages themselves."""

import json
import random
import signal

import pytest

from fleeting import Member, network
from program import eventually
from sharing import Client, samples
from siting import RAMP, START
from test_json import check


@pytest.fixture
def node(nodes):
    """A node with the name arm1."""
    return nodes("arm1")


@pytest.fixture
def direct(node):
    """A program at the share of the node, which knows how the motors turn."""
    return Client(node.path, "looks")


def stands(direct):
    eventually(lambda: abs(direct.rpm()) < 30, "motor 1 at rest", within=20)


def turns(direct):
    eventually(lambda: direct.rpm() > 1400, "motor 1 at speed", within=20)


def via(node):
    return {"MOTORLINK_NETWORK": node.address}


def test_the_command_line_uses_a_node_as_a_port(node, run):
    port = ["-p", "zenoh:arm1/st0"]
    speed = run("st", *port, "get", "SPEED_MEAS", "--json", **via(node)).ended(0)
    check(speed.out)
    assert abs(speed.values["SPEED_MEAS"]) < 30
    run("st", *port, "set", "SPEED_KP", "123", **via(node)).ended(0)
    dump = run("st", *port, "dump", **via(node)).ended(0)
    assert "SPEED_KP" in dump.out and "123" in dump.out
    named = f"zenoh:arm1/rmd0?via={node.address}"
    assert "temperature" in run("rmd", "-p", named, "--id", "2", "status").ended(0).out
    rows = run("st", *port, "get", "SPEED_MEAS", "--every", "20ms", "--count", "20", **via(node))
    assert len(rows.ended(0).out.splitlines()) >= 20
    refused = run("st", *port, "set", "SPEED_MEAS", "1", **via(node))
    assert refused.code != 0
    away = run("st", "-p", "zenoh:arm9/st0", "get", "SPEED_MEAS", **via(node)).ended(3)
    assert "no node arm9 answers" in away.err and "motorlink node" in away.err
    raw = run("st", "-p", "zenoh:arm1/st0?raw", "get", "SPEED_MEAS", **via(node)).ended(2)
    assert "no raw bytes" in raw.err


def test_a_fleet_is_listed_and_stopped_and_latched_until_it_is_released(nodes, run):
    first, second = nodes("arm1"), nodes("arm2")
    looks = [Client(it.path, "looks") for it in (first, second)]
    members = [Member(first.address, name, deadline=10) for name in ("arm1", "arm2")]
    for member, look in zip(members, looks):
        member.turn()
        turns(look)
    listed = run("fleet", "list", "--json", **via(first)).ended(0)
    check(listed.out)
    assert [it["node"] for it in listed.lines] == ["arm1", "arm2"]
    assert [it["line"] for it in listed.lines[0]["lines"]] == ["st0", "rmd0"]
    stopped = run("fleet", "stop-all", "--json", **via(first)).ended(0)
    check(stopped.out)
    for name, look in zip(("arm1", "arm2"), looks):
        stands(look)
        confirmed = {"event": "stopped", "node": name, "line": "st0", "motor": 1}
        assert any(confirmed.items() <= it.items() for it in stopped.lines)

    def latched_by():
        return [it["latched_by"] for it in run("fleet", "list", "--json", **via(first)).ended(0).lines]

    assert all(latched_by())
    port = ["-p", "zenoh:arm2/st0?take"]
    latched = run("st", *port, "start", **via(first)).ended(1)
    assert "latched" in latched.err and "fleet release" in latched.err
    # A node that must answer and is not there.
    missing = run("fleet", "stop-all", "--node", "arm1", "--node", "arm9", **via(first))
    assert "arm9" in missing.ended(3).err
    run("fleet", "release", **via(first)).ended(0)
    assert latched_by() == [None, None]
    assert members[1].command(*RAMP)["kind"] == "answer"


def test_the_motor_of_a_program_that_takes_no_answers_stops(node, direct):
    member = Member(node.address, "arm1", who="mute", deadline=1.0)
    member.lives()
    member.turn()
    turns(direct)
    # It asks on, and pulls nothing.
    for _ in range(2000):
        answer, _ = member.post(ask="command", line="st0", motor=1, bytes=list(RAMP), time_to_live=1.0)
        if answer is None or answer["kind"] == "over":
            break
    member.dies()
    stands(direct)


def test_a_motor_that_a_command_takes_stops_at_its_end(node, direct, run):
    holder = Member(node.address, "arm1", deadline=5)
    holder.lives()
    holder.turn()
    turns(direct)
    run("st", "-p", "zenoh:arm1/st0?take", "set", "SPEED_KP", "200", **via(node)).ended(0)
    stands(direct)
    ramp = run("st", "-p", "zenoh:arm1/st0?take", "ramp", "1500", "200", **via(node)).ended(0)
    assert "the share stops the motor now" in ramp.err


def test_a_node_finds_drives_that_are_late_and_a_whole_bus_of_them(start, sim, run, tmp_path):
    bus = tmp_path / "bus.toml"
    bus.write_text("".join(f"[[rmd.motor]]\nid = {id}\n" for id in range(1, 33)))
    drives = sim(bus)
    drives.process.send_signal(signal.SIGSTOP)
    ports = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{tmp_path}/node.share"]
    node = start("node", *ports, "--listen", "tcp/127.0.0.1:0", "--name", "arm1", "--json")
    node.address = json.loads(node.line(0))["addresses"][0]

    def listed():
        return [line.get("heard") for line in run("fleet", "list", "--json", **via(node)).ended(0).json["lines"]]

    def shown():
        watched = run("fleet", "watch", "--once", "--json", **via(node)).ended(0).lines
        return [(it["line"], it["motor"]) for it in watched if it["state"] in ("IDLE", "at rest")]

    assert listed() == [None, None]
    drives.process.send_signal(signal.SIGCONT)
    drives = [("st0", 1), ("st0", 2), *(("rmd0", id) for id in range(1, 33))]
    eventually(lambda: shown() == drives, "all drives", within=60)


def test_a_frozen_node_carries_out_no_old_motion(node, direct):
    member = Member(node.address, "arm1", deadline=10)
    member.command(*RAMP)
    node.process.send_signal(signal.SIGSTOP)
    try:
        # Until the node answers, this asks.
        wanted = {"ask": "command", "line": "st0", "motor": 1, "bytes": [3, 1], "time_to_live": 0.5}
        member.last += 1
        post = {"ask": "post", "number": member.last, "sent": member.now()}
        post |= {"time_to_live": 0.5, "request": {"id": 999, **wanted}}
        assert member.ask("act", post, within=1.5) is None
    finally:
        node.process.send_signal(signal.SIGCONT)
    refusal = member.answer(999)
    assert refusal["reason"] == "expired", refusal
    stands(direct)


def test_requests_that_are_wrong_or_of_others_move_nothing(node, direct):
    member = Member(node.address, "arm1", who="alice", deadline=10)
    assert member.command(*RAMP)["kind"] == "answer"
    start = {"ask": "command", "line": "st0", "motor": 1, "bytes": [3, 1], "time_to_live": 1.0}
    # A key that is for something else.
    for scope in ("see", "stop"):
        answer, _ = member.post(scope, number=member.last + 1, **start)
        assert answer["kind"] == "refused" and "act" in answer["why"], answer
    # Somebody else's session, and one that is none.
    other = Member(node.address, "arm1", who="bob", joins=False)
    body = {"ask": "post", "number": member.last + 1, "sent": member.now()}
    body |= {"time_to_live": 1.0, "request": {"id": 1, **start}}
    stolen = other.ask("act", body, session=member.session)
    assert stolen["kind"] == "refused" and "somebody else" in stolen["why"], stolen
    assert other.ask("act", body)["kind"] == "over"
    # Another right or another name behind those that access control sees.
    for tail in (f"act/alice/{member.session}", f"x/{member.session}"):
        assert other.ask("see", body, session=tail) is None
    # A stranger's word that the program is gone.
    token = f"motorlink/v1/arm1/node/here/{member.boot}/bob/{member.session}"
    other.zenoh.liveliness().declare_token(token).undeclare()
    huge = member.ask("act", b" " * 200_000)
    assert huge["kind"] == "refused" and "bytes" in huge["why"], huge
    chance = random.Random(20261127)
    for _ in range(50):
        noise = chance.randbytes(chance.randrange(200))
        answer = member.ask(chance.choice(["see", "stop", "act"]), noise)
        assert answer["kind"] == "refused", answer
    stands(direct)
    assert not any("START" in line for line in node.out)
    # The session goes on.
    assert member.command(*START)["kind"] == "answer"
    turns(direct)


def test_a_node_says_what_its_motors_do_to_whoever_listens(node, direct):
    zenoh = network(node.address)
    heard = {}

    def listen(sample):
        heard.setdefault(str(sample.key_expr), []).append(sample.payload.to_bytes())

    zenoh.declare_subscriber("motorlink/v1/**", listen)
    key = "motorlink/v1/arm1/st0/1/samples"
    eventually(lambda: len(heard.get(key, [])) > 5, "samples of motor 1", within=20)
    (reply,) = zenoh.get("motorlink/v1/arm1/st0/1/columns")
    columns = json.loads(reply.ok.payload.to_bytes())
    names = [column["name"] for column in columns["columns"]]
    assert {"SPEED_MEAS", "TORQUE_MEAS", "STATUS", "FLAGS"} <= set(names)
    *_, values = samples(heard[key][-1])
    assert len(values) == 2 + len(names)
    state = "motorlink/v1/arm1/node/state"
    eventually(lambda: heard.get(state), "the state", within=20)
    assert json.loads(heard[state][-1])["node"] == "arm1"
    member = Member(node.address, "arm1")
    member.turn()
    events = "motorlink/v1/arm1/st0/events"
    eventually(lambda: any(b"START_MOTOR" in it for it in heard.get(events, [])), "the event")
    # It gives no sign of life.
    stands(direct)
    eventually(lambda: any(b"no sign of life" in it for it in heard.get(events, [])), "the reason")
    zenoh.close()


def test_limits_of_the_file_hold_for_all_programs(nodes, run, tmp_path):
    file = tmp_path / "node.toml"
    file.write_text("[limits.st]\nspeed_rpm = 1000\n\n[limits.rmd]\nspeed_dps = 100.0\n")
    node = nodes("arm1", "--config", file)
    st, rmd = ["-p", "zenoh:arm1/st0"], ["-p", "zenoh:arm1/rmd0"]
    refused = run("st", *st, "ramp", "1500", "1s", **via(node))
    assert refused.code != 0 and "1000" in refused.err, refused.err
    run("st", *st, "ramp", "900", "1s", **via(node)).ended(0)
    refused = run("rmd", *rmd, "--id", "2", "speed", "360", **via(node))
    assert refused.code != 0 and "100" in refused.err, refused.err


def test_a_network_that_is_not_there_and_a_name_that_is_none(run):
    nobody = run("node", "-p", "sim:", "--connect", "tcp/127.0.0.1:1").ended(3)
    assert "nothing answers at tcp/127.0.0.1:1" in nobody.err
    assert run("node", "-p", "sim:", "--name", "a/b").code == 2
