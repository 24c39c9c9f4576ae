"""Two nodes with one name, and what becomes of the motors of the one that vanishes."""

import json
import os
import signal
import struct

import pytest

from fleeting import Cable
from monitoring import Site
from program import eventually
from sharing import Client, are_still, speeds
from test_json import check

#: Nodes that vanish. ROUNDS=50 for more.
ROUNDS = int(os.environ.get("ROUNDS", "1"))


class Arm:
    """A node arm1 with drives of its own."""

    def __init__(self, sim, start, folder, address):
        folder.mkdir()
        self.drives = sim(st=[f"pty:{folder}/st"], rmd=[f"slcan-pty:{folder}/can"])
        ports = ["-p", self.drives.st, "-p", f"slcan:{self.drives.can}", "--timeout", "5s"]
        words = [*ports, "--at", f"unix:{folder}/share", "--connect", address, "--name", "arm1", "--json"]
        self.node = start("node", *words)
        self.node.line(0)
        self.program = Client(folder / "share", "program")

    def turn(self):
        def turns():
            self.program.command("rmd0", 2, 0xA2, 0, 0, 0, *struct.pack("<i", 36000))
            return speeds(self.program)[1] > 300

        eventually(turns, "a motor that turns")

    def rests(self):
        eventually(lambda: are_still(self.program), "motors that rest", within=20)


@pytest.fixture
def twins(nodes, sim, start, run, tmp_path):
    """How to reach the network, and two nodes of one name: one was cut off when the other one began."""
    base = nodes("base")
    via = ("--via", base.address)

    def rows():
        found = run("fleet", "list", *via, "--json").lines
        return [(it["node"], it["answers"], "away_seconds" in it) for it in found if "node" in it]

    with Cable(base) as cable:
        first = Arm(sim, start, tmp_path / "first", cable.address)
        eventually(lambda: ("arm1", True, False) in rows(), "arm1", within=30)
        cable.process.send_signal(signal.SIGSTOP)
        eventually(lambda: ("arm1", False, True) in rows(), "the loss of arm1", within=30)
        second = Arm(sim, start, tmp_path / "second", base.address)
        cable.process.send_signal(signal.SIGCONT)
        eventually(lambda: rows().count(("arm1", True, False)) == 2, "two nodes of one name", within=30)
        yield via, first, second


def test_nodes_with_one_name_are_stopped_both_and_one_that_vanishes_is_not_forgotten(twins, run, start):
    via, first, second = twins
    found = run("fleet", "list", *via).ended(3)
    assert found.out.count("\narm1.run-") == 2 and "2 nodes have the name arm1" in found.err, found
    shown = run("fleet", "watch", "--once", *via).ended(3)
    assert shown.out.count("arm1.run-") >= 12, shown
    # By its name no motor is moved, and the motors of both are stopped.
    moved = run("rmd", "-p", "zenoh:arm1/rmd0", "--id", "2", "speed", "100", MOTORLINK_NETWORK=via[1]).ended(3)
    assert "2 nodes have the name arm1" in moved.err and "fleet stop-all --node arm1" in moved.err
    for _ in range(ROUNDS):
        first.turn()
        second.turn()
        run("fleet", "stop-all", "--node", "arm1", *via).ended(0)
        first.rests()
        second.rests()
        run("fleet", "release", *via).ended(0)
    # So does a page.
    monitor = start("monitor", "--fleet", "--listen", "127.0.0.1:0", "--json", *via)
    site = Site(json.loads(monitor.line(0)))
    first.turn()
    second.turn()
    with site.page() as page:
        page.alive()
        found = lambda: {it["line"].partition("/")[0] for it in page.ask("lines")["lines"]}
        eventually(lambda: len([it for it in found() if it.startswith("arm1")]) == 2, "both nodes", within=30)
        stopped = page.ask("stop-all", within=30)["motors"]
        nodes = {it["line"].partition("/")[0] for it in stopped if not it.get("failure")}
        assert len([it for it in nodes if it.startswith("arm1")]) == 2, nodes
        first.rests()
        second.rests()
        assert page.ask("release")["kind"] == "answer"
        # One vanishes while its motor turns. The other one has its name.
        first.turn()
        first.node.kill()
        eventually(lambda: "away for" in run("fleet", "list", *via).out, "the loss of arm1", within=30)
        for order in ("list", "stop-all", "release"):
            done = run("fleet", order, *via).ended(3)
            assert "arm1" in done.err, done
        listed = [it for it in check(run("fleet", "list", *via, "--json").out) if it["node"] == "arm1"]
        assert [it["answers"] for it in listed] == [True, False]
        failed = {it["line"] for it in page.ask("stop-all", within=30)["motors"] if it.get("failure")}
        assert any(line.startswith("arm1") for line in failed), failed
        assert page.ask("release")["kind"] in ("answer", "refusal")
    run("fleet", "stop-all", "--gone", "arm1", *via).ended(0)
    first.drives.kill()
