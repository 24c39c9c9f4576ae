"""Many simulated drives in several nodes, with a recorder, a viewer and a commander.

    make fleet-scale [SECONDS=60]
"""

import json
import os
import struct
import sys
import threading
import time
from pathlib import Path

from bench import Bench, percentile, publish, table, until

import zenoh
from fleeting import Member, network
from sharing import Client, samples

SECONDS = float(os.environ.get("SECONDS", "60"))
#: Nodes, and drives of each.
SIZES = [tuple(map(int, it.split("x"))) for it in os.environ.get("SIZES", "1x10 1x100 10x10 10x100").split()]
#: How often nodes publish, and how often the recorder reads, in seconds.
PERIOD = float(os.environ.get("PERIOD", "1"))
#: The most drives of a port: 2 motors of an ST drive, the others on a CAN bus.
PORT = 20
#: One of so many drives turns.
TURNS = 10
SPEED = struct.pack("<i", 9000)
HEADS = ["drives", "nodes", "turning", "values/s", "lost", "without values, s", "recorder, % of a core",
         "a node, mean", "viewer", "sample, ms, median", "99 %", "command, ms, median", "99 %", "most"]


def configure(folder, drives):
    """The ports of a node with so many drives."""
    ports = []
    for number in range(0, drives, PORT):
        count = min(PORT, drives - number)
        path = folder / f"bench{count}.toml"
        motors = ['[[st.motor]]\npreset = "servo"\n'] * 2
        motors += [f"[[rmd.motor]]\nid = {id}\n" for id in range(1, count - 1)]
        path.write_text("\n".join(motors))
        ports += ["-p", f"sim:{path}"]
    return ports


class Latency:
    """How old samples of nodes are when they come to a program of this computer."""

    def __init__(self, address):
        self.clocks, self.ages = {}, []
        self.lock = threading.Lock()
        self.session = network(address)
        root = "motorlink/v1"
        self.subscribers = [
            self.session.declare_subscriber(f"{root}/*/node/state", self.state),
            self.session.declare_subscriber(f"{root}/*/*/*/samples", self.samples),
        ]

    def state(self, sample):
        info = json.loads(sample.payload.to_bytes())
        with self.lock:
            for line in info["lines"]:
                self.clocks[info["node"], line["line"]] = line["wall"] - line["t"]

    def samples(self, sample):
        now = time.time()
        _, _, node, line, *_ = str(sample.key_expr).split("/")
        *_, t0, columns = samples(sample.payload.to_bytes())
        with self.lock:
            ahead = self.clocks.get((node, line))
            if ahead is not None:
                self.ages.append(now - (t0 + columns[0][-1] + columns[1][-1] / 2 + ahead))

    def taken(self):
        with self.lock:
            ages, self.ages = self.ages, []
        return ages


def command(member, ends, times):
    """Streams references to a motor, and measures each until its answer."""
    while not ends.is_set():
        began = time.monotonic()
        answer = member.command(0xA2, 0, 0, 0, *SPEED, line="rmd0", motor=1)
        assert answer["kind"] == "answer", answer
        times.append(time.monotonic() - began)
        ends.wait(0.05)


def measure(count, drives):
    """A row of the table."""
    with Bench() as bench:
        ports, nodes = configure(bench.folder, drives), []
        for number in range(count):
            words = ["--name", f"arm{number}", "--at", f"unix:{bench.folder}/{number}.share", "--json"]
            words += ["--period", f"{round(PERIOD * 1000)}ms", "--timeout", "500ms"]
            where = ["--connect", nodes[0].address] if nodes else ["--listen", "tcp/127.0.0.1:0"]
            node = bench.start("node", *ports, *words, *where)
            node.address = node.line()["addresses"][0]
            nodes.append(node)
        address = nodes[0].address

        member = Member(address, "arm0", who="commander", deadline=2)
        bench.callback(member.zenoh.close)

        def found():
            replies = member.zenoh.get("motorlink/v1/*/node/info/*", target=zenoh.QueryTarget.ALL)
            infos = [json.loads(it.ok.payload.to_bytes()) for it in replies if it.ok]
            heard = sum(len(line.get("heard", ())) for info in infos for line in info["lines"])
            # A search for motors that a bus does not have holds it up.
            return heard >= count * drives and not any(info.get("searching") for info in infos)

        until(found, "all drives", within=120, pause=1)
        clients, turning = [], 0
        for number in range(count):
            client = Client(f"{bench.folder}/{number}.share", "turns")
            clients.append(client)
            for motor in range(drives // TURNS):
                line, id = motor // 2, motor % 2 + 2
                answer = client.command(f"rmd{line}", id, 0xA2, 0, 0, 0, *SPEED)
                assert answer["kind"] == "answer", answer
                turning += 1
        rate = f"{1 / PERIOD:g}"
        words = ["-o", bench.folder / "run.mcap", "--rate", rate, "--no-settings", "--json"]
        recorder = bench.start("fleet", "record", "--via", address, *words)
        recorder.line()
        viewer = bench.start("fleet", "watch", "--via", address, "--every", "1s", "--json")
        threading.Thread(target=lambda: [None for _ in viewer.process.stdout], daemon=True).start()
        member.lives()
        ends, times = threading.Event(), []
        commander = threading.Thread(target=command, args=(member, ends, times))
        commander.start()
        latency = Latency(address)
        bench.callback(latency.session.close)
        time.sleep(5)
        latency.taken()
        times.clear()
        programs = [recorder, viewer, *nodes]
        began, before = time.monotonic(), [program.cpu() for program in programs]
        time.sleep(SECONDS)
        took = time.monotonic() - began
        used = [100 * (program.cpu() - cpu) / took for program, cpu in zip(programs, before)]
        ages = latency.taken()
        ends.set()
        commander.join()
        member.dies()
        recorder.send(2)
        end = recorder.wait()[-1]
        ms = lambda value: f"{value * 1000:.1f}"
        return [
            count * drives, count, turning, round(end["values"] / end["seconds"]), end["lost"],
            f"{max((gap['seconds'] for gap in end['gaps']), default=0):.1f}",
            f"{used[0]:.1f}", f"{sum(used[2:]) / count:.1f}", f"{used[1]:.1f}",
            ms(percentile(ages, 0.5)), ms(percentile(ages, 0.99)),
            ms(percentile(times, 0.5)), ms(percentile(times, 0.99)), ms(max(times)),
        ]


def main():
    rows = []
    for count, drives in SIZES:
        rows.append(measure(count, drives))
        print(rows[-1], file=sys.stderr, flush=True)
    publish("fleet-scale", table(HEADS, rows))


if __name__ == "__main__":
    main()
