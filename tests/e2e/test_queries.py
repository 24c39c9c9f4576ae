"""What a `motorlink node` answers about its drives without a session: identity, registers, settings."""

import json
import signal
import threading
import time
import tomllib

import pytest
import zenoh

from fleeting import Member, network
from program import eventually
from sharing import Client
from test_node import stands, turns, via

ROOT = "motorlink/v1"
ARM1 = f"{ROOT}/arm1"


class Asker:
    """A program that asks without a session."""

    def __init__(self, address):
        self.zenoh = network(address)

    def ask(self, key, within=20):
        """The replies by key, and the error replies."""
        options = {"target": zenoh.QueryTarget.ALL, "consolidation": zenoh.ConsolidationMode.NONE}
        replies, errors = {}, []
        for reply in self.zenoh.get(key, timeout=within, **options):
            if reply.ok is None:
                errors.append(json.loads(reply.err.payload.to_bytes()))
                continue
            assert str(reply.ok.key_expr) not in replies
            text = reply.ok.payload.to_string()
            is_json = str(reply.ok.encoding) == "application/json"
            replies[str(reply.ok.key_expr)] = json.loads(text) if is_json else text
        return replies, errors

    def one(self, key):
        """The only reply."""
        replies, errors = self.ask(key)
        assert list(replies) == [key] and errors == [], (replies, errors)
        return replies[key]

    def error(self, key):
        """The only error reply."""
        replies, errors = self.ask(key)
        assert replies == {} and len(errors) == 1, (replies, errors)
        return errors[0]


@pytest.fixture
def askers():
    opened = []

    def asker(address):
        opened.append(Asker(address))
        return opened[-1]

    yield asker
    for it in opened:
        it.zenoh.close()


@pytest.fixture
def node(nodes):
    return nodes("arm1")


@pytest.fixture
def asker(node, askers):
    return askers(node.address)


def test_a_node_says_what_a_drive_is_and_reads_its_registers(node, asker, run):
    said = asker.one(f"{ARM1}/st0/1/identity")
    board, firmware = said["drive"].pop("board"), said["drive"].pop("firmware")
    assert said == {"line": "st0", "motor": 1, "protocol": "st", "profile": "spec", "drive": {}}
    dump = run("st", "-p", "zenoh:arm1/st0", "dump", **via(node)).ended(0).out
    assert f"# board: {board}\n# firmware: {firmware}\n" in dump
    said = asker.one(f"{ARM1}/rmd0/2/identity")
    assert said == {"line": "rmd0", "motor": 2, "protocol": "rmd", "drive": {}}
    # One register.
    voltage = asker.one(f"{ARM1}/st0/1/registers/BUS_VOLTAGE")
    port = ["-p", "zenoh:arm1/st0", "get", "BUS_VOLTAGE", "STATUS", "--json"]
    got = run("st", *port, **via(node)).ended(0).json["values"]
    assert abs(voltage.pop("value") - got["BUS_VOLTAGE"]["value"]) <= 2
    assert voltage.pop("text").isdecimal()
    assert voltage == {"name": "BUS_VOLTAGE", "unit": got["BUS_VOLTAGE"]["unit"]}
    status = asker.one(f"{ARM1}/st0/1/registers/STATUS")
    assert status == {"name": "STATUS", "value": got["STATUS"]["value"], "text": "IDLE", "unit": ""}
    # By its number, as the command line takes it.
    assert asker.one(f"{ARM1}/st0/1/registers/0x02") == status
    gain = asker.one(f"{ARM1}/rmd0/2/registers/position_kp")
    assert gain == {"name": "position_kp", "value": 100, "text": "100", "unit": ""}
    # All registers. The drive refuses some.
    replies, errors = asker.ask(f"{ARM1}/st0/1/registers/*")
    listed = run("st", "registers", "--json").ended(0).lines
    readable = {it["name"] for it in listed if "R" in it["access"]}
    answered = {key.removeprefix(f"{ARM1}/st0/1/registers/") for key in replies}
    assert {"SPEED_MEAS", "FLAGS", "SPEED_KP", "REVUP_1_SPEED"} <= answered
    assert all(value["name"] == key.rsplit("/", 1)[1] for key, value in replies.items())
    refused = {it["key"].removeprefix(f"{ARM1}/st0/1/registers/") for it in errors}
    assert {it["reason"] for it in errors} == {"refused"} and not refused & answered
    assert all("refused" in it["message"] for it in errors)
    named = {name for name in answered | refused if not name.startswith("REVUP_")}
    assert named <= readable
    one = asker.error(f"{ARM1}/st0/1/registers/{min(refused)}")
    assert one == next(it for it in errors if it["key"] == one["key"])
    replies, errors = asker.ask(f"{ARM1}/rmd0/2/registers/*")
    assert errors == [] and f"{ARM1}/rmd0/2/registers/iq_amps" in replies


def test_the_file_of_settings_is_taken_by_diff_and_restore_unchanged(node, asker, run, tmp_path):
    for line, motor, changes in [
        ("st0", 1, ("set", "SPEED_KP", "123")),
        ("rmd0", 2, ("pid", "1", "2", "3", "4", "5", "6")),
    ]:
        text = asker.one(f"{ARM1}/{line}/{motor}/settings")
        of_drive = [line[:-1], "-p", f"zenoh:arm1/{line}"] + (["--id", "2"] if line == "rmd0" else [])
        assert text == run(*of_drive, "dump", **via(node)).ended(0).out
        tomllib.loads(text)
        file = tmp_path / "settings.toml"
        file.write_text(text)
        run(*of_drive, *changes, **via(node)).ended(0)
        run(*of_drive, "diff", file, **via(node)).ended(1)
        run(*of_drive, "restore", file, **via(node)).ended(0)
        assert asker.one(f"{ARM1}/{line}/{motor}/settings") == text


def test_wildcards_are_for_motors_that_have_answered(nodes, askers):
    first, _ = nodes("arm1"), nodes("arm2")
    asker = askers(first.address)
    motors = {f"{ROOT}/{node}/{motor}" for node in ("arm1", "arm2") for motor in ("st0/1", "rmd0/1")}
    eventually(lambda: {f"{it}/identity" for it in motors} <= set(asker.ask(f"{ROOT}/*/*/*/identity")[0]),
               "motors of both nodes", within=30)
    rpm, errors = asker.ask(f"{ROOT}/*/*/*/registers/SPEED_MEAS")
    # RMD motors have no such register.
    assert errors == [] and all("/st0/" in key for key in rpm)
    assert {f"{ROOT}/arm1/st0/1/registers/SPEED_MEAS", f"{ROOT}/arm2/st0/1/registers/SPEED_MEAS"} <= set(rpm)
    kp, _ = asker.ask(f"{ROOT}/arm$*/st0/1/registers/SPEED_K$*")
    assert {key for key in kp if not key.endswith("_DIV")} == {
        f"{ROOT}/{node}/st0/1/registers/SPEED_K{it}" for node in ("arm1", "arm2") for it in "PID"}
    files, errors = asker.ask(f"{ARM1}/*/*/settings")
    assert errors == [] and all(text.startswith("# Settings of a motor") for text in files.values())
    assert asker.ask(f"{ROOT}/*/st7/1/identity") == ({}, [])
    # Those of a line that the key does not name.
    assert set(asker.ask(f"{ARM1}/st0/**")[0]) >= {f"{ARM1}/st0/1/{it}" for it in ("identity", "settings")}


def test_unknown_names_are_told_apart_and_noise_is_answered_or_ignored(asker):
    for key, reason, part in [
        ("st7/1/identity", "usage", "no line `st7`; the lines are st0, rmd0"),
        ("st0/200/identity", "usage", "no motor can have the number `200`"),
        ("rmd0/99/registers/iq_amps", "usage", "no motor can have the number `99`"),
        ("st0/1/registers/SPEED_MEAZ", "usage", "did you mean `SPEED_MEAS`"),
        (f"st0/1/registers/{65 * 'S'}", "usage", "has up to 64 bytes"),
        ("rmd0/2/registers/SPEED_MEAS", "usage", "no setting or value `SPEED_MEAS`"),
        ("st0/5/identity", "unheard", "no motor of this number"),
        ("st0/5/registers/*", "unheard", "no motor of this number"),
        ("rmd0/29/registers/iq_amps", "unheard", "29"),
    ]:
        error = asker.error(f"{ARM1}/{key}")
        assert error["key"] == f"{ARM1}/{key}" and error["reason"] == reason, (key, error)
        assert part in error["message"], (key, error)
    for key in ("st0/1/registers", "st0/1/registers/A/B", "st0/1/else"):
        assert asker.ask(f"{ARM1}/{key}") == ({}, []), key
    for key in ("**", "st0/1/**/SPEED_MEAS", "st0/*/registers/$*_MEAS", "s$*/$*1/$*y", "node/1/identity",
                "st0/1/registers/%00", "st0/18446744073709551616/identity", "st0/-1/identity", "st0/01/registers/STATUS",
                f"st0/1/registers/{'A' * 5000}"):
        for error in asker.ask(f"{ARM1}/{key}")[1]:
            assert error["reason"] in ("usage", "refused"), (key, error)
    asker.one(f"{ARM1}/st0/1/registers/STATUS")


def test_a_line_that_is_lost_is_said_until_it_is_back(node, asker, sim, tmp_path):
    asker.one(f"{ARM1}/st0/1/identity")
    node.drives.end()
    for key in ("registers/*", "settings"):
        error = asker.error(f"{ARM1}/st0/1/{key}")
        assert error["reason"] == "line" and error["key"] == f"{ARM1}/st0/1/{key}", error
    sim(st=[f"pty:{tmp_path}/arm1.st"], rmd=[f"slcan-pty:{tmp_path}/arm1.can"])
    eventually(lambda: asker.ask(f"{ARM1}/st0/1/identity")[0], "the line", within=30)


def test_few_queries_wait_for_a_silent_drive_and_the_others_are_refused_at_once(node, asker):
    asker.one(f"{ARM1}/st0/1/identity")
    # The queries wait for the drive.
    node.drives.process.send_signal(signal.SIGSTOP)
    results = []
    threads = [threading.Thread(target=lambda: results.append(asker.ask(f"{ARM1}/st0/1/registers/SPEED_MEAS")))
               for _ in range(12)]
    try:
        for thread in threads:
            thread.start()
        eventually(lambda: len(results) == 8, "queries that are refused")
        assert all(errors[0]["reason"] == "busy" and not replies for replies, errors in results), results
        for thread in threads:
            thread.join(40)
        assert len(results) == 12 and not any(replies for replies, _ in results), results
        assert {errors[0]["reason"] for _, errors in results[8:]} <= {"silent", "expired", "line"}, results
    finally:
        node.drives.process.send_signal(signal.SIGCONT)
    eventually(lambda: asker.ask(f"{ARM1}/st0/1/registers/SPEED_MEAS")[0], "the drive", within=30)


def test_queries_delay_no_stop(node, asker):
    direct = Client(node.path, "looks")
    ends = threading.Event()
    counts = []

    def ask():
        while not ends.is_set():
            counts.append(len(asker.ask(f"{ARM1}/*/*/registers/*")[0]))

    askers = [threading.Thread(target=ask) for _ in range(6)]
    for thread in askers:
        thread.start()
    try:
        member = Member(node.address, "arm1", deadline=10)
        member.turn()
        turns(direct)
        began = time.monotonic()
        assert member.stop({"line": "st0", "motor": 1})["kind"] == "answer"
        took = time.monotonic() - began
        stands(direct)
    finally:
        ends.set()
        for thread in askers:
            thread.join()
    assert took < 2 and any(counts), (took, counts)

