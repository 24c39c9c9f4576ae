"""`motorlink fleet` and `motorlink monitor --fleet`: the drives of several nodes from one place."""

import json
import os
import signal
import struct
import time

import pytest
from mcap.reader import make_reader

from fleeting import Cable
from monitoring import Site, is_kind
from program import eventually
from sharing import Client, are_still, speeds
from terminal import Terminal
from test_json import check

#: Programs that are killed, and motors that are taken from a page. ROUNDS=30 for more.
ROUNDS = int(os.environ.get("ROUNDS", "1"))


@pytest.fixture
def arms(nodes, run):
    """Two nodes at one network, which have found their motors."""
    arms = [nodes("arm1"), nodes("arm2")]

    def found():
        listed = check(run("fleet", "list", "--via", arms[0].address, "--json").ended(0).out)
        return [[len(line.get("heard", [])) for line in it["lines"]] for it in listed] == [[2, 4], [2, 4]]

    eventually(found, "all motors")
    return arms


@pytest.fixture
def via(arms):
    return ("--via", arms[0].address)


@pytest.fixture
def watchers(arms):
    """A program at the share of each node, which knows how the motors turn."""
    return [Client(arm.path, "watcher") for arm in arms]


@pytest.fixture
def show(start, via):
    """`show()`: a monitor of the fleet, and its site."""

    def show(*words):
        words = ["--listen", "127.0.0.1:0", "--json", "--deadline", "2s", *via, *words]
        monitor = start("monitor", "--fleet", *words)
        ready = json.loads(monitor.line(0))
        check(monitor.line(0))
        return monitor, ready, Site(ready)

    return show


def turn(watcher):
    rpm, dps = speeds(watcher)
    return rpm > 1200 and dps > 300


def turn_both(page, watchers):
    for node, watcher in zip(("arm1/", "arm2/"), watchers):
        page.turn(node=node)
        eventually(lambda watcher=watcher: turn(watcher), "motors that turn")


def rest(watchers):
    for watcher in watchers:
        eventually(lambda watcher=watcher: are_still(watcher), "motors that rest")


@pytest.mark.parametrize("ends", [signal.SIGKILL, signal.SIGSTOP])
def test_a_monitor_that_fails_leaves_no_motor_of_any_node_turning(show, watchers, ends):
    for _ in range(ROUNDS):
        monitor, _, site = show()
        with site.page() as page:
            page.alive()
            turn_both(page, watchers)
            os.kill(monitor.process.pid, ends)
            began = time.monotonic()
            rest(watchers)
            # 1 s without a sign of life, the time to come to rest, and that of a busy machine.
            assert time.monotonic() - began < 20
            if ends == signal.SIGSTOP:
                os.kill(monitor.process.pid, signal.SIGCONT)


def test_a_node_that_vanished_is_missed_by_programs_that_come_later(show, arms, nodes, via, run, tmp_path):
    def left_out(*words):
        return run("fleet", *words, *via).ended(3)

    arms[1].kill()
    eventually(lambda: run("fleet", "list", *via).code == 3, "arm1 knows it")
    assert "arm2  away for " in left_out("list").out
    listed = check(left_out("list", "--json").out)
    assert [(it["node"], it["answers"]) for it in listed] == [("arm1", True), ("arm2", False)]
    assert listed[1]["away_seconds"] > 0
    stopped = left_out("stop-all")
    assert "arm1/st0, motor 1: it confirmed the stop" in stopped.out
    assert "motors of arm2 may still turn" in stopped.err
    assert "no answer of arm2" in left_out("watch", "--once").err
    summed = check(left_out("watch", "--once", "--by-node", "--json").out)
    assert [(it["node"], it["drives"]) for it in summed] == [("arm1", 6), ("arm2", None)]
    for words in (("settings", "diff"), ("record", "-o", tmp_path / "all.mcap", "--duration", "1s")):
        assert "node arm2 went away" in left_out(*words).err
    read = run("fleet", "command", *via, "--", "st", "get", "STATUS").ended(3)
    assert "arm1/st0/1: STATUS" in read.out and "node arm2 went away" in read.err
    # A monitor that starts now counts its motors as not stopped.
    _, _, site = show()
    with site.page() as page:
        page.alive()
        motors = page.ask("stop-all")["motors"]
        assert [it["line"] for it in motors if it.get("failure") and not it.get("absent")] == ["arm2"]
        # A person who knows its motors at rest leaves it out.
        confirmed = run("fleet", "stop-all", *via, "--gone", "arm2").ended(0)
        assert "arm2" not in confirmed.out + confirmed.err
        run("fleet", "release", *via, "--gone", "arm2").ended(0)
        assert "node arm2 is away" in page.ask("latch")["message"]
        # The same name, started again.
        arm2 = nodes("arm2")
        page.until(lambda it: is_kind(it, "event") and it["event"] == "opened" and it["line"] == "arm2/st0")
        # A line that looks for motors may be busy.
        eventually(lambda: page.act("arm2/st0", 1, "START_MOTOR")["reason"] == "latched", "the latch")
    # It is there, so it is not left out.
    run("fleet", "list", *via).ended(0)
    confirmed = run("fleet", "stop-all", *via, "--gone", "arm2").ended(0)
    assert "arm2/st0, motor 1: it confirmed the stop" in confirmed.out
    run("fleet", "release", *via).ended(0)
    arm2.process.send_signal(signal.SIGTERM)
    assert arm2.wait(20) == 0
    assert len(run("fleet", "list", *via, "--json").ended(0).lines) == 1, "it ended by itself"
    run("fleet", "stop-all", *via).ended(0)


def test_a_motor_that_is_taken_from_a_page_that_streams_references_turns_for_the_taker(show, arms, watchers):
    motor = {"line": "rmd0", "motor": 2}
    _, _, site = show()
    with site.page() as page:
        page.alive()
        for _ in range(ROUNDS):
            started = {"reason": "overtaken"}
            # While a stop is confirmed, motion is refused.
            while started.get("reason") in ("overtaken", "expired"):
                started = page.ask("run", line="arm1/rmd0", motor=2, mode="speed", target=360, rate=60, hold=False)
            assert started["streams"], started
            eventually(lambda: speeds(watchers[0])[1] > 20, "a motor that turns")
            taker = Client(arms[0].path, "taker")
            assert taker.ask("take", motor=motor)["kind"] == "answer"
            assert taker.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 30000))["kind"] == "answer"
            eventually(lambda: speeds(watchers[0])[1] > 295, "the speed of the taker")
            # The page gives up references that are not acknowledged for 0.5 s.
            until = time.monotonic() + 0.8
            while time.monotonic() < until:
                assert speeds(watchers[0])[1] > 250
            taker.socket.close()
            rest(watchers[:1])


def test_the_table_has_all_drives_and_sums_and_says_who_does_not_answer(run, via, arms, watchers):
    watchers[0].command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))

    def rows(*words):
        return check(run("fleet", "watch", *via, "--once", "--json", *words).ended(0).out)

    def sorted_rows():
        """The drives by their speed, in a table that no pause of the machine has made old."""

        def fresh():
            table = rows("--sort", "speed")
            ages = [it["age_seconds"] for it in table]
            return len(ages) == 12 and None not in ages and max(ages) < 2 and table

        return eventually(fresh, "all drives")

    sorted_rows()
    eventually(lambda: rows("--only", "turning"), "a motor that turns")
    [row] = rows("--only", "turning")
    assert (row["node"], row["line"], row["motor"]) == ("arm1", "rmd0", 2)
    assert row["speed"] > 300 and row["speed_unit"] == "°/s"
    fastest = sorted_rows()[0]
    assert (fastest["node"], fastest["motor"]) == ("arm1", 2)
    sums = {it["node"]: it for it in rows("--by-node")}
    assert (sums["arm1"]["drives"], sums["arm1"]["turning"]) == (6, 1)
    assert (sums["arm2"]["drives"], sums["arm2"]["turning"]) == (6, 0)
    text = run("fleet", "watch", *via, "--once").ended(0).out
    assert text.startswith("2 nodes, 12 drives: 1 turning, 0 faulty, 0 old\n")
    assert max(map(len, text.splitlines())) <= 80
    os.kill(arms[1].process.pid, signal.SIGSTOP)
    try:
        table = run("fleet", "watch", *via, "--once").ended(3)
    finally:
        os.kill(arms[1].process.pid, signal.SIGCONT)
    assert table.out.startswith("1 node, 6 drives") and "no answer of arm2" in table.err


def test_the_table_on_the_screen_has_keys_and_needs_a_terminal(motorlink, run, via, arms):
    terminal = Terminal([motorlink, "fleet", "watch", *via], 80, 24)
    try:
        terminal.shows("2 nodes, 12 drives", "arm2/rmd0/4", "1 to 12 of 12, sorted by name, all")
        terminal.press("s")
        terminal.shows("sorted by speed")
        terminal.press("n")
        terminal.shows("hottest", "here")
        arms[1].kill()
        terminal.shows("away for")
        terminal.press("n", "f")
        terminal.shows("sorted by speed, turning")
        terminal.press("q")
        assert terminal.wait() == 0
    finally:
        terminal.end()
    assert "--once" in run("fleet", "watch", *via).ended(2).err
    assert "--once" in run("fleet", "watch", *via, "--json").ended(2).err


def test_a_command_is_for_all_motors_of_its_kind_and_their_settings_are_compared(run, via, arms):
    said = check(run("fleet", "command", *via, "--json", "--", "st", "get", "SPEED_MEAS").ended(0).out)
    drives = [f"{node}/st0/{motor}" for node in ("arm1", "arm2") for motor in (1, 2)]
    assert [it["drive"] for it in said] == drives
    assert all(it["values"]["SPEED_MEAS"]["unit"] == "rpm" for it in said)
    text = run("fleet", "command", *via, "--node", "arm2", "--name", "/2", "--", "rmd", "clear-errors")
    assert all(line.startswith("arm2/rmd0/2: ") for line in text.ended(0).out.splitlines())
    refused = run("fleet", "command", *via, "--", "st", "start").ended(2)
    assert "`start` is not for a fleet" in refused.err
    missing = run("fleet", "command", *via, "--node", "arm9", "--", "st", "info").ended(3)
    assert "no node arm9" in missing.err
    failed = run("fleet", "command", *via, "--", "st", "get", "PFC_I_KP").ended(1)
    assert "at 2 of 4 motors: arm1/st0/2, arm2/st0/2" in failed.err
    # Settings of siblings are compared.
    words = ("fleet", "settings", "diff", *via, "--name", "/st0/1")
    assert "2 motors of st: no difference" in run(*words).ended(0).err
    port = f"zenoh:arm2/st0?via={arms[0].address}"
    run("st", "-p", port, "set", "SPEED_KP", "300").ended(0)
    [one] = check(run(*words, "--json").ended(1).out)
    alone = run("fleet", "settings", "diff", *via, "--node", "arm1", "--name", "/st0/1").ended(3)
    assert "nothing to compare with" in alone.err
    assert (one["protocol"], one["setting"]) == ("st", "SPEED_KP")
    assert [it["drives"] for it in one["values"] if it["value"].startswith("300")] == [["arm2/st0/1"]]


def recorded(start, address, file):
    words = ("--via", address, "-o", file, "--rate", "50", "--no-settings", "--json")
    recording = start("fleet", "record", *words)
    recording.line(0)
    return recording


def last_times(file):
    """When the last value of each motor came, by the log."""
    times = {}
    with open(file, "rb") as opened:
        for _, channel, message in make_reader(opened).iter_messages():
            if channel.topic.endswith("/signals"):
                times[channel.topic] = message.log_time / 1e9
    return times


def test_the_end_of_a_recording_waits_for_what_is_late(start, arms, tmp_path):
    file = tmp_path / "run.mcap"
    with Cable(arms[0]) as cable:
        recording = recorded(start, cable.address, file)
        time.sleep(1)
        cable.process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        ends = time.time()
        recording.interrupt()
        time.sleep(0.5)
        cable.process.send_signal(signal.SIGCONT)
        assert recording.wait(20) == 0
    times = last_times(file)
    assert len(times) == 12 and min(times.values()) > ends - 0.4, (ends, times)


def test_one_recording_has_all_nodes_also_one_that_is_started_again(start, nodes, arms, run, tmp_path):
    file = tmp_path / "run.mcap"
    other, node = arms
    recording = recorded(start, other.address, file)
    time.sleep(1)
    node.process.kill()
    node.process.wait()
    nodes("arm2")
    back = time.time()
    time.sleep(6)
    recording.interrupt()
    assert recording.wait(20) == 0
    times = last_times(file)
    assert len(times) == 12 and min(times.values()) > back + 4, (back, times)
    events = check(run("info", file, "--events", "--json").ended(0).out)
    of = {(it["event"], it["of"]) for it in events}
    assert {("lost", "arm2_rmd0"), ("back", "arm2_rmd0")} <= of, of
    assert not any(of.startswith("arm1") for event, of in of if event == "lost")
