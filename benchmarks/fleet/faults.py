"""What becomes of motors and recordings when parts of a fleet fail, each 30 times.

    make fleet-faults [ROUNDS=30]
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import zenoh
from bench import MOTORLINK, ROOT, Bench, percentile, publish, table, until
from proxy import Cable

from fleeting import network, runs
from sharing import Client
from siting import Site as SecureSite
from siting import joins, member, strangers, turn

ROUNDS = int(os.environ.get("ROUNDS", "30"))
DEADLINE = 0.5
#: Connections without a certificate at a time. The router needs 0.1 s for each.
STRANGERS = 50
#: How long a network is cut, in seconds. Each of them ROUNDS / 6 times.
CUTS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
#: °/s of the commander; below the second one the motor has been stopped.
TURNS, STOPS = 300, 250
HEADS = ["fault", "times", "stopped", "ms until the motor slows, median", "most", "rows lost", "longest gap, s",
         "back after, ms, median", "most"]


class Site(Bench):
    """A router, two nodes, and a cable between the router and programs."""

    def __enter__(self):
        super().__enter__()
        self.router = self.route("tcp/127.0.0.1:0")
        self.inner = self.router.address
        self.cable = Cable(int(self.inner.rsplit(":", 1)[1]))
        self.outer = self.cable.address
        self.nodes = {name: self.node(name) for name in ("arm1", "arm2")}
        until(self.found, "motors", pause=0.2)
        self.direct = Client(self.folder / "arm1.share", "looks")
        return self

    def route(self, address):
        router = self.start("fleet", "router", "--listen", address, "--json")
        router.address = router.line()["addresses"][0]
        return router

    def node(self, name):
        at = f"unix:{self.folder}/{name}.share"
        words = ["-p", "sim:", "--name", name, "--at", at, "--connect", self.inner, "--json"]
        node = self.start("node", *words)
        node.line()
        return node

    def found(self):
        listed = self.start("fleet", "list", "--via", self.outer, "--json").wait()
        heard = [len(line.get("heard", ())) for it in listed for line in it.get("lines", ())]
        return sorted(heard) == [2, 2, 4, 4]

    def record(self):
        """A recording of all nodes at 50 Hz, through the cable."""
        self.file = self.folder / "run.mcap"
        self.file.unlink(missing_ok=True)
        words = ["-o", self.file, "--rate", "50", "--no-settings", "--json"]
        self.recorder = self.start("fleet", "record", "--via", self.outer, *words)
        self.recorder.line()

    def recorded(self):
        """The rows that the recording lacks, and its longest gap of a motor of arm1, in seconds."""
        self.recorder.send(signal.SIGINT)
        end = self.recorder.wait()[-1]
        return end["lost"] + end["unconfirmed"], longest_gap(self.file)

    def command(self):
        """A program that streams references to a motor of arm1."""
        words = [sys.executable, Path(__file__).parent / "commander.py", self.outer, "arm1", DEADLINE, DEADLINE]
        commander = subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.callback(commander.kill)
        assert commander.stdout.readline(), "the commander has ended"
        until(lambda: self.direct.dps(1) > TURNS, "a motor that turns")
        return commander

    def stops(self, within=30):
        """The time until the motor has been stopped."""
        return until(lambda: self.direct.dps(1) < STOPS, "a motor that stops", within=within)


def longest_gap(file):
    from mcap.reader import make_reader

    last, longest = {}, 0.0
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            topic = channel.topic
            if topic.startswith("/arm1_") and topic.endswith("/signals"):
                before = last.get(topic, message.log_time)
                longest = max(longest, (message.log_time - before) / 1e9)
                last[topic] = message.log_time
    return longest


def row(name, rounds, stopped=(), recorded=None, back=()):
    ms = lambda value: f"{value * 1000:.0f}"
    times = [ms(percentile(stopped, 0.5)), ms(max(stopped))] if stopped else ["", ""]
    lost = [recorded[0], f"{recorded[1]:.2f}"] if recorded else ["", ""]
    returned = [ms(percentile(back, 0.5)), ms(max(back))] if back else ["", ""]
    made = f"{len(stopped)} of {rounds}" if stopped else ""
    line = [name, rounds, made, *times, *lost, *returned]
    print(line, file=sys.stderr, flush=True)
    return line


def end(commander):
    commander.kill()
    commander.wait()
    commander.stdout.close()


def lost_commander(site, name, number):
    """The commander is killed or frozen while it streams."""
    times = []
    for _ in range(ROUNDS):
        commander = site.command()
        commander.send_signal(number)
        times.append(site.stops())
        end(commander)
        until(lambda: abs(site.direct.dps(1)) < 5, "a motor at rest")
    return row(name, ROUNDS, stopped=times)


def router_killed(site):
    times, back = [], []
    site.record()
    for _ in range(ROUNDS):
        commander = site.command()
        site.router.end()
        times.append(site.stops())
        end(commander)
        time.sleep(1)
        site.router = site.route(site.inner)
        back.append(until(site.found, "the nodes", pause=0.02))
        time.sleep(2)
    return row("router killed, back after 1 s", ROUNDS, times, site.recorded(), back)


def node_killed(site):
    back = []
    site.record()
    for _ in range(ROUNDS):
        site.nodes["arm2"].end()
        time.sleep(1)
        site.nodes["arm2"] = site.node("arm2")
        back.append(until(site.found, "the node", pause=0.02))
    return row("other node killed and started again", ROUNDS, (), site.recorded(), back)


def network_cut(site, seconds):
    """Cut for some seconds: the motor stops if that is longer than the deadline."""
    times, rounds, kept = [], max(1, ROUNDS // len(CUTS)), 0
    site.record()
    for _ in range(rounds):
        commander = site.command()
        site.cable.cut()
        began = time.monotonic()
        if seconds > DEADLINE:
            times.append(site.stops())
        while time.monotonic() < began + seconds:
            time.sleep(0.01)
        site.cable.mend()
        time.sleep(1)
        if seconds < DEADLINE:
            kept += site.direct.dps(1) > STOPS
        end(commander)
        until(lambda: abs(site.direct.dps(1)) < 5, "a motor at rest")
        time.sleep(5)
    line = row(f"network cut for {seconds:g} s", rounds, times, site.recorded())
    if seconds < DEADLINE:
        line[2] = f"turned on: {kept} of {rounds}"
    return line


def slow_viewer(site):
    """Programs that take nothing: how long stops take meanwhile."""
    frozen = [site.start("fleet", "watch", "--via", site.outer, "--every", "1s", "--json") for _ in range(3)]
    followers = [
        site.start("fleet", "record", "--via", site.outer, "--rate", "50", "--no-settings", "-o",
                   site.folder / f"slow{number}.mcap", "--json")
        for number in range(2)
    ]
    for program in followers:
        program.line()
    time.sleep(2)
    for program in (*frozen, *followers):
        program.send(signal.SIGSTOP)
    times = []
    site.record()
    for _ in range(ROUNDS):
        commander = site.command()
        began = time.monotonic()
        stop = site.start("fleet", "stop-all", "--via", site.outer, "--json")
        site.stops()
        times.append(time.monotonic() - began)
        stop.wait()
        end(commander)
        site.start("fleet", "release", "--via", site.outer, "--json").wait()
        until(lambda: abs(site.direct.dps(1)) < 5, "a motor at rest")
    recorded = site.recorded()
    for program in (*frozen, *followers):
        program.send(signal.SIGCONT)
    return row("5 frozen viewers; `fleet stop-all`", ROUNDS, times, recorded)


def flood(is_silent):
    """Strangers at the router of a site; the operator is connected, and stops a motor."""
    times = []
    with Bench() as bench:
        site = SecureSite(MOTORLINK, bench.folder)
        bench.callback(site.end)
        site.route()
        site.direct = Client(site.node("arm1"), "looks")
        with network(site.file("alice")) as session:
            (site.boot,) = runs(session, "arm1")
            alice = member(site, session, "alice")
            assert joins(alice)
            for _ in range(ROUNDS):
                turn(site)
                with strangers(site.address, STRANGERS, is_silent):
                    began = time.monotonic()
                    alice.stop({"line": "st0", "motor": 1})
                    until(lambda: site.direct.rpm() < 1300, "a motor that stops")
                    times.append(time.monotonic() - began)
                until(lambda: abs(site.direct.rpm()) < 30, "a motor at rest")
        # Each connection that failed has delayed others.
        until(lambda: is_admitted(site.file("bob")), "a member that is admitted", within=300)
        assert not is_admitted(site.file("stranger"))
    how = "silent" if is_silent else "without a certificate"
    return row(f"{STRANGERS} strangers, {how}; a stop", ROUNDS, stopped=times)


def is_admitted(file):
    try:
        network(file).close()
    except zenoh.ZError:
        return False
    return True


def clock_jump():
    """The clock of a node jumps: a test with a clock of its own."""
    words = ["cargo", "test", "-q", "-p", "motorlink-fleet", "--all-features", "--locked", "--test", "node"]
    words += ["a_clock_that_jumps", "--", "--nocapture"]
    environment = {**os.environ, "ROUNDS": str(ROUNDS)}
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, env=environment, check=True)
    times = [int(text) / 1000 for text in re.findall(r"stopped after (\d+) ms", done.stdout)]
    return row("network cut, and the clock of the node jumps", ROUNDS, stopped=times)


FAULTS = {
    "killed": lambda site: [lost_commander(site, "commander killed", signal.SIGKILL)],
    "frozen": lambda site: [lost_commander(site, "commander frozen", signal.SIGSTOP)],
    "router": lambda site: [router_killed(site)],
    "node": lambda site: [node_killed(site)],
    "cut": lambda site: [network_cut(site, seconds) for seconds in CUTS],
    "viewer": lambda site: [slow_viewer(site)],
}
#: Those that make their own site.
APART = {
    "flood": lambda: [flood(is_silent) for is_silent in (True, False)],
    "clock": lambda: [clock_jump()],
}


def main():
    rows = []
    for name in sys.argv[1:] or (*FAULTS, *APART):
        if name in APART:
            rows += APART[name]()
            continue
        with Site() as site:
            rows += FAULTS[name](site)
    publish("fleet-faults", table(HEADS, rows))


if __name__ == "__main__":
    main()
